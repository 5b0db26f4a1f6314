"""Shapeshift: captured scenes of Gaussian splats that change their colours and their shape.

    import shapeshift as ss

    scene = ss.load("workshop.shift")  # whatever the viewer opens
    picture = scene.render(x="Thermal", size=(640, 360))  # (H, W, 3) float32, display sRGB

Everything below is loaded when it is first asked for: importing this package takes a millisecond.
`dir(shapeshift)` lists the names, `help(shapeshift.load)` explains one, examples/ shows them in the
order in which a person learns them.

In a checkout the folders beside this one (app/, renderer/, scene/, ...) are its subpackages, in a
wheel they lie inside it: `shapeshift.renderer.renderer` is the same module in both, once.
"""

import os

_here = os.path.dirname(os.path.abspath(__file__))
if not os.path.isdir(os.path.join(_here, "renderer")):  # a checkout
    __path__.append(os.path.dirname(_here))

# Module below this package: the names that it gives to it.  __init__.pyi says the same to type
# checkers and editors.
_NAMES_OF = {
    "api.load": ("info", "lint", "load"),
    "api.scene": ("Scene",),
    "api.picture": ("Picture",),
    "api.render": ("Renderer",),
    "api.write": ("Exported", "WrittenLevels", "export", "lod"),
    "api.learn": ("FittedScene", "TrainedScene", "fit", "train", "update"),
    "api.measure": ("bench", "change", "chart", "compare", "evaluate", "stability"),
    "api.play": ("Step", "cameras", "colliders", "poses", "simulate"),
    "app.change.find_change": ("SceneChange",),
    "app.inspection.thermal": ("Inspection",),
    "app.paths": ("DEMO", "TOUCH"),
    "app.errors": ("UsageError",),
    "decomposition.masks.specs": ("ObjectSpec", "PhotoPrompt"),
    "rasterizer.device": ("NoDevice",),
    "renderer.colors.heat_over_shape": ("heat_over_shape",),
    "renderer.gl.context": ("NoContext",),
    "renderer.settings": ("FrameStats", "RenderSettings"),
    "runtime_models.model": ("AnchorModel", "BadFile", "ScaffoldModel", "SplatLayers", "Stop"),
    "runtime_models.splats.plain_splats": ("PlainSplats",),
    "runtime_models.stop_weights": ("StopWeights",),
    "scene.appearance": ("Appearance", "Sky"),
    "scene.cameras.camera_list": ("CameraList",),
    "scene.change.places": ("ChangedPlace",),
    "scene.inspection.marks": ("Isotherm", "Mark", "MarkReading"),
    "scene.inspection.value_picture": ("ValuePicture",),
    "scene.metrics": ("psnr", "ssim"),
    "scene.pose": ("Pose", "View", "look_at", "perspective", "stereo_pair"),
    "scene.scene": ("SceneObject",),
    "scene.sections.section": ("BoxShape", "PlaneShape", "SceneSection"),
    "scene.selectors.selector": ("Box", "HalfSpace", "Lens", "Sphere"),
}
_MODULE_OF = {name: module for module, names in _NAMES_OF.items() for name in names}
__all__ = sorted(_MODULE_OF)


def __getattr__(name: str) -> object:
    if name == "__version__":
        from shapeshift.runtime_models.program import version

        return version()
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'shapeshift' has no attribute '{name}'")
    import importlib

    value = getattr(importlib.import_module(f"shapeshift.{_MODULE_OF[name]}"), name)
    globals()[name] = value  # the next one finds it at once
    return value


def __dir__() -> list[str]:
    return [*__all__, "__doc__", "__file__", "__path__", "__version__"]
