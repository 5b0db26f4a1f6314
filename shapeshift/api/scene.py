"""A scene as a library has it: opened once, never changed; every edit gives another one."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from shapeshift.api.arguments import Camera, Output, PathText, Progress, Size, X
from shapeshift.api.edit import layers_of
from shapeshift.api.inspect import InspectedScene
from shapeshift.app.document import Document
from shapeshift.runtime_models.model import Model
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.scene.appearance import Background
from shapeshift.scene.pose import View
from shapeshift.scene.selectors.selector import Selector

if TYPE_CHECKING:
    from pathlib import Path

    from shapeshift.api.measure import Measured
    from shapeshift.api.picture import Picture
    from shapeshift.api.render import Context, Drawing
    from shapeshift.api.style import Paint
    from shapeshift.api.views import NotebookPage
    from shapeshift.api.write import Exported
    from shapeshift.app.training.style_options import Shape
    from shapeshift.decomposition.masks.specs import ObjectSpec
    from shapeshift.renderer.settings import RenderSettings


class Scene(InspectedScene):
    """One model, or the objects of a scene file, each at its own x.

    Nothing in it changes; `at`, `with_model`, `with_object` and `with_regions` give another scene,
    and what they do not touch is shared, not copied.

        scene = ss.load("workshop.shift")
        scene.at("Thermal").render()
    """

    def _with(self, subject: Document) -> "Scene":
        up, flip = self.turned
        return Scene(subject, self.path, up=up, flip=flip)

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

        Objects stand where the scene has them.  palette: value stops in their false colours.
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
        (docs/cameras.md), a CameraList, a View or several; or (4, 4) or (N, 4, 4) metres,
        world_from_camera as transforms.json has it (OpenGL's axes: x right, y up, it looks along
        -z), with the lens of `front`.  View.from_pinhole takes OpenCV's axes and a lens.

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
        background: Background | None = None,
        select: Sequence["str | Selector"] = (),
        eye_distance: float = 0.0,
        output: Output = "picture",
        show: str = "full",
        settings: "RenderSettings | None" = None,
        drawing: "Drawing" = "auto",
        context: "Context" = "auto",
    ) -> "Picture":
        """(H, W, 3) float32 display sRGB, row 0 on top, of the first view of a camera.

        x: as of `at`.  camera, size: as of `views`.  background: red, green, blue 0..1 as
        displayed, or a Sky; None: the scene file's sky, what the scene was trained on, else black.
        select: as of `with_regions`.
        eye_distance: metres; above 0 the picture holds two eyes, side by side.  output: `depth`
        gives (H, W) metres along the view and `normal` (H, W, 3) directions in eye axes, NaN where
        nothing is; `coverage` (H, W) how much of the background is hidden.  show: of a scene with
        objects `overlay` tints them, `background` leaves them out, `isolated` or `isolated:NAME`
        draws them alone.  settings: what may be left out (RenderSettings; its background counts,
        too).

        The renderer stays open for the next picture; for loops at full speed take `ss.Renderer`.
        Raises UsageError, BadFile, NoContext, NoDevice.

            picture = scene.render(x=0.5, camera="front", size=(640, 360))
            depth_m = scene.render(output="depth")
            motor = ss.load("room.shift").render(x="Opened", show="isolated:motor")
        """
        scene = self.at(x)
        if select:
            scene = scene.with_regions(*select)
        view = scene.views(camera, 1, size)[0]
        from shapeshift.api.views import picture_of

        if show != "full":  # in the same view and before the same background as the whole
            if settings is None and background is None:
                background = scene.subject.background
            scene = scene.showing(show)
        return picture_of(scene, view, background, eye_distance, output, settings, drawing, context)

    def show(self, height: int = 480) -> "NotebookPage":
        """The scene live in a notebook: the page for browsers in a frame, with slider, stops and
        camera, without a server or an extension; a picture of it stays where frames are not shown.

        height: of the frame, pixels.  The notebook grows by the page's size, for the demo 1.2 MB.
        Raises UsageError, BadFile for what a page cannot show.

            ss.load("workshop.shift").show()
        """
        from shapeshift.api.views import show_scene

        return show_scene(self, self.render(camera="front"), height)

    def _repr_html_(self) -> str | None:
        """What a notebook displays for a scene: a picture and a line.  None: the line alone, where
        nothing can be drawn.  The page, which grows with the scene, is for `show`."""
        from shapeshift.api.views import picture_and_line

        return picture_and_line(self)

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
        from shapeshift.api.views import choose_views, spread

        views = choose_views(self, camera, count, size)  # what cannot be is refused now
        scenes = [self.at(each) for each in spread(x, len(views))]
        return (each.render(None, view, **how) for each, view in zip(scenes, views, strict=True))

    def film(
        self,
        out: PathText,
        style_path: str = "",
        *,
        cameras: Camera = "auto",
        seconds: float | None = None,
        fps: float | None = None,
        size: Size | None = None,
        progress: Progress | None = None,
        **how: Any,
    ) -> "Path":
        """A flight through the scene while it goes from stop to stop, written to `out`: .mp4 or
        .webm (both want PyAV), .webp, .gif, or a folder of numbered pictures; gives its path.

        style_path: what is shown when, "RGB@0 Thermal@3s Opened@6s", in seconds or in % of the
        camera's way; between two keys the blend is 3SGS's beta_t, straight from one to the other.
        cameras: auto (those that lie with the scene's file, else once around it), orbit, a file or
        folder of cameras, a NAME.film.json, a CameraList, or Views.  seconds: 10 unless a file of a
        path says another, fps: 30, size: 1280x720.  progress: called with (what, part done).
        how: smooth, ease, hold, streams, stereo, supersample, every, codec, background, depth_unit,
        overwrite, drawing and context, as options of the command (docs/film.md).

        The same scene gives the same frames to the byte.  Raises UsageError, BadFile.

            scene.film("tour.webp", "RGB@0 Opened@4s", seconds=5, fps=12, size=(320, 180))
        """
        from shapeshift.api.film import film

        return film(self, out, cameras, style_path, (seconds, fps), size, progress, how)

    # ---- objects

    def segment(
        self,
        capture: PathText,
        out: PathText,
        *,
        objects: "PathText | Sequence[ObjectSpec] | None" = None,
        masks: PathText | None = None,
        segmenter: PathText | None = None,
        photos: int = 24,
        complete: bool = True,
        overwrite: bool = False,
        progress: "Callable[[str, int, int], None] | None" = None,
    ) -> "Scene":
        """Cuts a scene into objects, and gives the scene of them that it writes to `out`,
        NAME.scene.json, with the labelled model beside it (docs/objects.md).

        capture: the photos that it was trained on.  objects: objects.json or ObjectSpecs, each with
        a prompt that says in one photo where it is; or masks: a folder of label maps.  segmenter: a
        folder with the ONNX files of SAM, MobileSAM, SAM 2 or SAM 3, asked about `photos` photos;
        without one colours, heat and shape find compact things.  complete: also make what is
        touched of each object, and fill the background where it stood if the photos agree.
        progress: called with (what, done, of how many); an exception from it ends the work, which
        the same call then goes on with.

        Object-Wise Decomposition, sections 3.2 to 3.5.  Raises BadFile, UsageError, NoDevice.

            seen = ss.PhotoPrompt("rgb/012.jpg", box=(310, 200, 402, 296))
            mug = ss.ObjectSpec(1, "mug", (seen,))
            parts = scene.segment("capture", "room.scene.json", objects=[mug])
            parts.objects["mug"].move(by=(0, 0.2, 0)).render()
        """
        from shapeshift.api.segment import segment

        words = (capture, out, objects, masks, segmenter, photos, complete, overwrite, progress)
        return Scene(*segment(self, *words))

    # ---- stops

    def add_style(
        self,
        name: str,
        *,
        shape: "Shape" = "",
        network: PathText | None = None,
        weights: Mapping[int, float] | None = None,
        image: PathText | None = None,
        text: str = "",
        vgg: PathText | None = None,
        clip_model: PathText | None = None,
        quality: Literal["full", "preview"] = "full",
        paint: "Paint | None" = None,
        pictures: PathText | None = None,
        cameras: PathText | None = None,
        source: str = "",
        after: str = "",
        strength: float = 1.0,
        region: Sequence[str] = (),
        keep: Sequence[str] = (),
        steps: int = 400,
        views: int | None = None,
        size: int | None = None,
        seed: int = 0,
        pace: bool = True,
        device: Literal["cpu", "gpu"] | None = None,
        progress: "Callable[[str, float], None] | None" = None,
    ) -> "Scene":
        """The scene with one stop more; every other stop shows what it showed (docs/styles.md).

        shape: fur, blocks, bubbles, points, melt, explode or strokes, a rule for the splats.
        Colours come from one of network (an ONNX file of a style network, `weights` of its styles
        by number), image with vgg (quality="preview": its colours in seconds, without training),
        image or text with clip_model, paint (a function of a picture
        (H, W, 3) in 0..1 that gives another) or pictures (a folder, one for each of cameras).
        source: the stop that it starts from, after: the one that it comes after.  strength 0..1.
        region, keep: as of `style --region`.  views, size: of the dome that is painted.  pace:
        measure how evenly the slider moves.  progress: called with (what, part 0..1).  Raises
        BadFile, UsageError, NoDevice.

            furry = scene.add_style("Fur", shape="fur", after="RGB")
            furry.save("furry.shift"); furry.render("Fur")
        """
        from shapeshift.api.style import add_style, path_of
        from shapeshift.app.training.style_options import Options

        options = Options(
            scene=self.path or Path("scene"), out=Path(), name=name, shape=shape,
            network=path_of(network), image=path_of(image), text=text, vgg=path_of(vgg),
            clip_model=path_of(clip_model), quality=quality, pictures=path_of(pictures),
            cameras=path_of(cameras),
            from_=source, after=after, strength=strength, region=tuple(region), keep=tuple(keep),
            steps=steps, views=views, size=size, seed=seed, device=device,
        )  # fmt: skip
        return Scene.from_model(add_style(self, options, weights, paint, pace, progress))

    def add_formula(
        self,
        name: str,
        formula: str,
        *,
        value_range: tuple[float, float] | None = None,
        unit: str = "",
        palette: str = "",
        after: str = "",
        pace: bool = True,
    ) -> "Scene":
        """The scene with one stop more, whose values are a formula of other stops' values, such as
        "a / (b + 1)" (docs/thermal.md).  value_range: at the palette's ends; None: what the scene
        has.  after: the stop that it comes after.  Raises BadFile, UsageError.

            ndvi = scene.add_formula("NDVI", "(nir - red) / (nir + red)")
        """
        from shapeshift.api.style import add_formula
        from shapeshift.app.training.style_options import Options

        named: dict[str, Any] = {"range": value_range, "name": name, "formula": formula}
        named |= {"unit": unit, "palette": palette, "after": after, "pace": pace}
        options = Options(scene=self.path or Path("scene"), out=Path(), **named)
        return Scene.from_model(add_formula(self, options))

    def without_stop(self, name: str) -> "Scene":
        """The scene without one of its stops, and without what that one alone had.

        Raises BadFile.

            plain = furry.without_stop("Fur")
        """
        from shapeshift.api.style import without_stop

        return Scene.from_model(without_stop(self, name))

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
        """Frame times and the image error: as `ss.bench`.

        scene.bench(frames=20)["frame_ms"]["p50"]
        """
        from shapeshift.api.measure import bench

        return bench(self, **how)
