"""A scene as a library has it: opened once, never changed; every edit gives another one."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shapeshift.api.arguments import DEFAULT_SIZE, Camera, Output, PathText, Size, X
from shapeshift.api.edit import changed, describe, layers_of, regions_of, stops_of
from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.model import Finding, Model, Stop
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.stop_weights import Control, StopWeights
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene as DrawnScene
from shapeshift.scene.scene import SceneObject
from shapeshift.scene.selectors.selector import Selector

if TYPE_CHECKING:
    from shapeshift.api.measure import Measured
    from shapeshift.api.picture import Picture
    from shapeshift.api.render import Context, Drawing
    from shapeshift.api.write import Exported
    from shapeshift.renderer.settings import RenderSettings


class Scene:
    """One model, or the objects of a scene file, each at its own x.

    Nothing in it changes; `at`, `with_model`, `with_object` and `with_regions` give another scene,
    and what they do not touch is shared, not copied.

        scene = ss.load("workshop.shift")
        scene.at("Thermal").render()
    """

    def __init__(
        self, subject: Document, path: Path | None = None, *, up: str = "", flip: bool = False
    ) -> None:
        self._subject = subject
        self.turned = (up, flip)  # as `load` was given them: cameras of its world are, too
        self.path = path  # what it was read from; None: it was made

    def __repr__(self) -> str:
        names = ", ".join(stop.name for stop in self.stops)
        where = f" of {self.path.name}" if self.path else ""
        parts = f"{len(self.objects)} objects, " if len(self.objects) > 1 else ""
        return f"<Scene{where}: {parts}{self.splat_count:,} splats, stops {names or 'none'}>"

    # ---- what is in it

    @property
    def objects(self) -> tuple[SceneObject, ...]:
        """Each with name, model, world_from_object (Pose, metres), x, label, visible, selectors.

        [thing.name for thing in ss.load("room.scene.json").objects]
        """
        return self._subject.scene.objects

    @property
    def stops(self) -> tuple[Stop, ...]:
        """The named places on the slider, by x: name, x 0..1, kind, palette, value_range, unit.

        {stop.name: stop.x for stop in scene.stops}
        """
        return stops_of(self._subject)

    @property
    def x(self) -> Control | None:
        """Where the slider stands, 0..1, or a blend of stops; None where objects differ.

        scene.at(0.25).x == 0.25
        """
        return self._subject.x

    @property
    def model(self) -> Model:
        """The AnchorModel, SplatLayers or ScaffoldModel of a scene of one.  Raises UsageError.

        Its arrays are numpy's: copy what you change, and put it back by `with_model`.

            anchors = scene.model.anchors  # (A, 3) metres
        """
        models = self._subject.models
        if len(models) != 1:
            raise UsageError("this scene has several models; take scene.object(NAME).model.")
        return models[0]

    def object(self, name: str) -> SceneObject:
        """The object of that name.  Raises UsageError that lists those that there are.

        cup = ss.load("room.scene.json").object("cup")
        """
        for thing in self.objects:
            if thing.name == name:
                return thing
        names = ", ".join(thing.name for thing in self.objects)
        raise UsageError(f"there is no object '{name}'; there are {names}.")

    def _one(self, name: str | None) -> SceneObject:
        """The object of that name; without one the only object."""
        if name is None and len(self.objects) != 1:
            raise UsageError("this scene has several objects; say which one is meant: name=.")
        return self.objects[0] if name is None else self.object(name)

    @property
    def splat_count(self) -> int:
        """Of all objects, also of those that are absent at this x.

        ss.load("workshop.shift").splat_count
        """
        return self._subject.scene.splat_count

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was wrong with the files and what was done about it, as `lint` says it.

        for finding in scene.findings: print(finding.what, finding.done)
        """
        return tuple(found for model in self._subject.models for found in model.findings)

    @property
    def bounds(self) -> tuple[np.ndarray, float]:
        """Centre (3,) and radius in metres, world; a few far splats move neither.

        centre, radius = scene.bounds
        """
        return self._subject.bounds()

    @property
    def origin(self) -> np.ndarray:
        """(3,) float64 metres: where this scene's zero lies in the world of its file.

        Files far from zero are re-centred when they are opened; cameras of that world are moved
        with them, exports are put back.

        in_file = splats.means + scene.origin
        """
        return self._subject.origin

    @property
    def drawn(self) -> DrawnScene:
        """What `shapeshift.renderer.renderer.Renderer.update` takes: the objects alone.

        frames.update(scene.drawn)
        """
        return self._subject.scene

    @property
    def subject(self) -> Document:
        """The same scene as the commands have it, with its scene file if it came from one.

        scene.subject.file.gravity_m_s2
        """
        return self._subject

    def info(self) -> dict[str, Any]:
        """What `info` gives of it.

        scene.info()["format"]
        """
        return describe(self)

    # ---- another scene

    def _with(self, subject: Document) -> "Scene":
        up, flip = self.turned
        return Scene(subject, self.path, up=up, flip=flip)

    def at(self, x: X | None) -> "Scene":
        """The scene with all sliders at x: a number from 0 to 1, a stop's name, a way between two
        stops ("RGB..Thermal:0.5"), or StopWeights.  None: as it is.

        In a scene of several objects those that have no such stop stay.  Raises UsageError that
        lists the stops, ValueError for a number outside 0..1.

            thermal = scene.at("Thermal")
            halfway = scene.at("RGB..Thermal:0.5")
        """
        if x is None:
            return self
        if isinstance(x, str):
            return self._with(self._subject.placed(x, "x"))
        control = x if isinstance(x, StopWeights) else float(x)
        return self._with(replace(self._subject, scene=self._subject.at(control)))

    def with_model(self, model: Model, name: str | None = None) -> "Scene":
        """The scene with another model, at the same x: the way back for arrays that were edited.

        name: of the object, where there are several.  Raises UsageError where it is needed.

            lifted = replace(scene.model, anchors=scene.model.anchors + [0, 1, 0])
            scene.with_model(lifted).render()
        """
        old = self._one(name)
        made = tuple(replace(t, model=model) if t is old else t for t in self.objects)
        scene = self._with(replace(self._subject, scene=DrawnScene(made)))
        scene.path = None  # what lies there is another one
        return scene

    def with_object(
        self,
        name: str,
        *,
        position: Sequence[float] | None = None,
        wxyz: Sequence[float] | None = None,
        x: X | None = None,
        visible: bool | None = None,
    ) -> "Scene":
        """The scene with an object elsewhere (metres, world), turned (quaternion, w first), at
        another x, shown or hidden; what is None stays.  Raises UsageError, ValueError.

            room.with_object("cup", position=(0.0, 1.2, 0.0), x="fire")
        """
        return self._with(changed(self._subject, self.object(name), position, wxyz, x, visible))

    def with_regions(self, *regions: "str | Selector", name: str | None = None) -> "Scene":
        """The scene with parts that have an x of their own; none: without any.

        A region is a Sphere, Box, HalfSpace or Lens in metres of the object's frame, or a text such
        as "sphere:0,1,0:0.5:Thermal:0.1" (centre, radius, x, border).  A later one lies over an
        earlier one.  name: of the object, where there are several.  Raises UsageError.

            scene.with_regions(ss.Sphere(centre=(0, 0.4, 0), radius=0.3, x=1.0, border=0.1))
        """
        thing = self._one(name)
        chosen = regions_of(regions, thing.model, self._subject.view(DEFAULT_SIZE))
        things = tuple(
            replace(each, selectors=chosen) if each is thing else each for each in self.objects
        )
        return self._with(replace(self._subject, scene=DrawnScene(things)))

    # ---- splats as arrays

    def splats(
        self,
        x: X | None = None,
        *,
        sh_degree: int = 3,
        palette: bool = True,
        eye: Sequence[float] | None = None,
    ) -> PlainSplats:
        """The splats that are there at x, as arrays of your own, float32: means (N, 3) metres,
        scales (N, 3) metres of one sigma, wxyz (N, 4) unit, opacity (N,) 0..1, sh (N, M, 3)
        spherical harmonics (colour = 0.5 + sum, display sRGB).

        Objects stand where the scene has them.  palette: thermal stops in their false colours.
        eye (3,) metres: for scenes whose shape depends on it (Scaffold-GS).  Raises BadFile,
        UsageError.

            splats = scene.splats("Thermal")
            splats.means[:, 1] += 1.0; ss.Scene.from_splats(splats).render()
        """
        from shapeshift.api.write import bake_scene

        return bake_scene(self.at(x), sh_degree, palette, eye)

    @staticmethod
    def from_model(model: Model) -> "Scene":
        """A scene of one AnchorModel, SplatLayers or ScaffoldModel, at its first stop.

        scene = ss.Scene.from_model(replace(model, stops=model.stops[:2]))
        """
        return Scene(Document.of(model))

    @staticmethod
    def from_splats(*layers: PlainSplats, names: Sequence[str] = ()) -> "Scene":
        """A scene of splats: one set, or several that become stops of one slider.

        names: of the stops.  Arrays are taken over, not copied; shapes are checked.  Raises
        UsageError, ValueError.

            scene = ss.Scene.from_splats(cold, warm, names=("cold", "warm"))
        """
        return Scene.from_model(layers_of(layers, names))

    # ---- pictures

    def views(
        self, camera: Camera = "orbit", count: int = 1, size: Size | None = None
    ) -> list[View]:
        """Views of the scene: `orbit` (count views on a level circle about it), `front`, `auto`
        (the cameras that lie with its file), a file or folder of cameras in any known form
        (docs/cameras.md), a CameraList, a View or several.

        size: width, height in pixels; None leaves them to the camera, else 640x360.  Raises
        BadFile, UsageError.

            for view in scene.views("orbit", 24, (640, 360)): ...
        """
        from shapeshift.api.views import choose_views

        return choose_views(self, camera, count, size)

    def render(
        self,
        x: X | None = None,
        camera: Camera = "orbit",
        size: Size | None = None,
        *,
        background: tuple[float, float, float] | None = None,
        select: Sequence["str | Selector"] = (),
        eye_distance: float = 0.0,
        output: Output = "picture",
        settings: "RenderSettings | None" = None,
        drawing: "Drawing" = "auto",
        context: "Context" = "auto",
    ) -> "Picture":
        """(H, W, 3) float32 display sRGB, row 0 on top, of the first view of a camera.

        x: as of `at`.  camera, size: as of `views`.  background: red, green, blue 0..1 as
        displayed; None is what the scene was trained on, else black.  select: as of `with_regions`.
        eye_distance: metres; above 0 the picture holds two eyes, side by side.  output: `depth`
        gives (H, W) metres along the view and `normal` (H, W, 3) directions in eye axes, NaN where
        nothing is; `coverage` (H, W) how much of the background is hidden.  settings: what may be
        left out (RenderSettings; its background counts, too).

        The renderer stays open for the next picture; for loops at full speed take `ss.Renderer`.
        Raises UsageError, BadFile, NoContext, NoDevice.

            picture = scene.render(x=0.5, camera="front", size=(640, 360))
            depth_m = scene.render(output="depth")
        """
        scene = self.at(x)
        if select:
            scene = scene.with_regions(*select)
        view = scene.views(camera, 1, size)[0]
        from shapeshift.api.views import picture_of

        return picture_of(scene, view, background, eye_distance, output, settings, drawing, context)

    def frames(
        self,
        x: "X | Sequence[X] | None" = None,
        camera: Camera = "orbit",
        count: int = 24,
        size: Size | None = None,
        **how: Any,
    ) -> Iterator["Picture"]:
        """The pictures of a film one by one: `count` of an orbit, or one a view of a camera file.

        x: one for all, "sweep" (from 0 to 1), or one a frame; a sequence of another length is
        spread over the frames in even steps, where it holds numbers alone.  how: as of `render`.

            for i, picture in enumerate(scene.frames(x="sweep", count=48)):
                picture.save(f"{i:04d}.png")
        """
        from shapeshift.api.views import film

        return film(self, x, camera, count, size, how)

    # ---- files and figures

    def export(self, out: PathText, **how: Any) -> "Exported":
        """Writes it for other programs: as `ss.export`.

        scene.export("heat.spz", x="Thermal")
        """
        from shapeshift.api.write import export

        return export(self, out, **how)

    def save(self, path: PathText, *, overwrite: bool = False) -> "Exported":
        """Writes a trained model whole, every x of it: NAME.shift or a folder (docs/package.md).

        Raises UsageError for a scene of plain splats or of several objects, and for a file that
        exists.

            scene.save("scene.shift", overwrite=True)
        """
        from shapeshift.api.write import save

        return save(self, path, overwrite)

    def compare(self, other: "PathText | Scene", **how: Any) -> "Measured":
        """PSNR, SSIM and the largest difference: as `ss.compare`.

        scene.at("RGB").compare(scan)["mean"]["psnr_db"]
        """
        from shapeshift.api.measure import compare

        return compare(self, other, **how)

    def bench(self, **how: Any) -> "Measured":
        """Frame times beside the image error: as `ss.bench`.

        scene.bench(frames=20)["frame_ms"]["p50"]
        """
        from shapeshift.api.measure import bench

        return bench(self, **how)
