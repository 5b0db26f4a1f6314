"""Antialiased scenes (Mip-Splatting), each beside the oracle."""

from dataclasses import replace

import numpy as np

from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.renderer.reference_reasons import reference_counts
from tests.support.splat_scenes import (
    alone,
    front_view,
    psnr_db,
    random_layers,
    stereo_views,
)

TURNED = Pose(np.array([0.9, -0.2, 0.3]), np.array([0.5, 0.5, -0.5, 0.5]))
LIMITS = {
    "none": RenderSettings(),
    "no low-pass": RenderSettings(low_pass=0.0),
    "wide low-pass": RenderSettings(low_pass=2.0),
    "hard": RenderSettings(max_pixels=9, max_distance=4.6, min_pixels=1.2),
    "soft": RenderSettings(max_pixels=30, max_distance=6, min_pixels=1.2, fade=0.3),
}


def thin(count: int, seed: int = 0, size: float = 0.12) -> SplatLayers:
    """A cloud whose splats are mostly smaller than a pixel of a picture 160 pixels wide."""
    layers = random_layers(count, seed)
    return replace(layers, scales=layers.scales * np.float32(size), antialiased=True)


def mixed(count: int = 3000) -> Scene:
    """An antialiased object between two plain ones; rows of one vector belong to two of them."""
    plain = replace(thin(count // 3 + 5, 3), antialiased=False)
    return Scene(
        (
            SceneObject("plain", random_layers(count // 3 + 3, 1)),
            SceneObject("antialiased", thin(count, 2), TURNED),
            SceneObject("plain, too", plain),
        )
    )


def flat(count: int) -> SplatLayers:
    """Needles, discs and balls, some of no extent at all."""
    rng = np.random.default_rng(8)
    sizes = np.array([0, 1e-12, 0.003, 0.05, 0.3], np.float32)
    return replace(thin(count, 7), scales=rng.choice(sizes, (count, 3)))


SCENES = {
    "one alone": lambda: alone(thin(3000, 5)),
    "mixed": mixed,
    "a hidden one": lambda: Scene((*mixed(300).objects, SceneObject("h", thin(9), visible=False))),
    "flat ones": lambda: alone(flat(400)),
    "seven splats": lambda: Scene((SceneObject("a", thin(3)), SceneObject("b", random_layers(4)))),
}
CASES = [(name, limits) for name in SCENES for limits in LIMITS]
CASES.remove(("flat ones", "no low-pass"))  # whether they have any area float32's last digits say


def check_counts(told: dict, want: dict, name: str) -> None:
    """Equal; of flat splats two may be drawn that the oracle has no light left for."""
    off = {reason: abs(told[reason] - want[reason]) for reason in want}
    assert max(off.values()) <= (2 if name == "flat ones" else 0), off


def decoded_all(scene: Scene) -> Scene:
    """Nothing hidden: what never showed was never decoded, and counts as absent."""
    return Scene(tuple(replace(obj, visible=True) for obj in scene.objects))


def check_frame(renderer: Renderer, name: str, limits: str, least_db: float) -> None:
    """One eye's picture and counts are the oracle's."""
    scene, view, settings = SCENES[name](), front_view((160, 120)), LIMITS[limits]
    renderer.settings = settings
    renderer.update(decoded_all(scene))
    renderer.update(scene)
    stats = renderer.draw([view])
    want = reference_counts(scene, view, settings)
    check_counts({"drawn": stats.drawn, **stats.culled}, want, name)
    assert psnr_db(renderer.image(), reference_image(scene, view, settings)) > least_db


def check_eyes(renderer: Renderer, limits: str, least_db: float) -> None:
    """Both eyes' pictures are the oracle's, each with an opacity of its own."""
    scene, views, settings = mixed(900), stereo_views((96, 80)), LIMITS[limits]
    renderer.settings = settings
    renderer.update(scene)
    renderer.draw(views)
    for i, view in enumerate(views):
        want = reference_image(scene, view, settings)
        assert psnr_db(renderer.image(i), want) > least_db
