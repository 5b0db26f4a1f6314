"""From where a scene is drawn, and the pictures that come of it."""

import base64
import html
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

import numpy as np

from shapeshift.api.arguments import DEFAULT_SIZE, Output, Size
from shapeshift.api.opened import OpenedScene
from shapeshift.api.picture import Picture, encoded
from shapeshift.api.render import Renderer, shared_renderer
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import plain
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.stop_weights import StopWeights
from shapeshift.scene.appearance import Background
from shapeshift.scene.cameras.camera_list import CameraList, CameraReading, moved
from shapeshift.scene.cameras.framing import orbit_path
from shapeshift.scene.pose import MOST_SIDE, Pose, View, stereo_pair

SWEEP = "sweep"
AROUND = ("orbit", "front")  # cameras that take their place from the scene
OUTPUTS = ("picture", "depth", "normal", "coverage")
WIDEST_EYES_M = 1.0
RIGID = 1e-3  # most that a rotation times its transpose is off one; float32 poses are, by 1e-6
NO_CAMERA = (
    "a camera is 'orbit', 'front', 'auto', a file or folder of cameras, a View or several, or a "
    "4x4 world_from_camera with OpenGL's axes."
)


def choose_views(scene: "OpenedScene", camera: Any, count: int, size: Size | None) -> list[View]:
    """What Scene.views gives."""
    if not (isinstance(count, int | np.integer) and count >= 1):
        raise UsageError(f"count is {count}; 1 view or more are wanted.")
    size = None if size is None else pixels_of(size)
    if isinstance(camera, View):
        return [camera.resized(size) if size else camera]
    subject = scene.subject
    if isinstance(camera, str) and camera in AROUND:
        if camera == "front" or count == 1:
            return [subject.view(size or DEFAULT_SIZE)]
        return orbit_path(int(count), *subject.bounds(), size or DEFAULT_SIZE)
    if isinstance(camera, str | PathLike):
        camera = read_cameras(scene, str(camera), size)
    if isinstance(camera, CameraList):  # of the file's world
        camera = moved(camera.views, tuple(-scene.origin))
    views = list(camera) if isinstance(camera, Iterable) else []
    if views and not any(isinstance(view, View) for view in views):
        return posed_views(views, subject.view(size or DEFAULT_SIZE))
    if not views or not all(isinstance(view, View) for view in views):
        raise UsageError(NO_CAMERA)
    return [view.resized(size) if size else view for view in views]


def posed_views(rows: list[Any], lens: View) -> list[View]:
    """Views by (4, 4) or (N, 4, 4) world_from_camera, metres, OpenGL's axes.  Raises UsageError."""
    try:
        matrices = np.asarray(rows, np.float64)
    except (TypeError, ValueError):
        raise UsageError(NO_CAMERA) from None
    if matrices.ndim not in (2, 3) or matrices.shape[-2:] != (4, 4):
        raise UsageError(NO_CAMERA)
    matrices = matrices.reshape(-1, 4, 4)
    turns = matrices[:, :3, :3]
    rigid = np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max() <= RIGID
    if not (rigid and np.isfinite(matrices).all() and (np.linalg.det(turns) > 0).all()
            and (matrices[:, 3] == (0, 0, 0, 1)).all()):  # fmt: skip
        raise UsageError(
            "a 4x4 of camera= is no rigid pose: a rotation without scale or mirroring, a place in "
            "metres and the last row 0 0 0 1 are wanted, world_from_camera with OpenGL's axes "
            "(of a view matrix it is the inverse; View.from_pinhole takes OpenCV's axes)."
        )
    return [replace(lens, world_from_eye=Pose.from_matrix(matrix)) for matrix in matrices]


def pixels_of(size: Any) -> Size:
    """Width and height.  Raises UsageError of what is no number of pixels."""
    sides = list(size) if isinstance(size, Sequence | np.ndarray) else []
    whole = all(isinstance(side, int | np.integer) for side in sides)
    if not (len(sides) == 2 and whole and all(1 <= side <= MOST_SIDE for side in sides)):
        raise UsageError(
            f"size is {size!r}; (width, height) in whole pixels, 1 to {MOST_SIDE}, is wanted."
        )
    return int(sides[0]), int(sides[1])


def read_cameras(scene: "OpenedScene", camera: str, size: Size | None) -> CameraList:
    """The cameras of a file, or with `auto` those that lie with the scene's own."""
    from shapeshift.scene.cameras.read_cameras import find_cameras, find_floor, read_camera_list

    path = plain(camera)
    if camera == "auto":
        beside = scene.path and (find_cameras(scene.path) or find_floor(scene.path))
        if not beside:
            raise UsageError("no cameras lie with this scene; give camera= a file of them.")
        path = beside
    up, flip = scene.turned
    return read_camera_list(path, CameraReading(size, 0.0, up, flip))


def picture_of(
    scene: "OpenedScene",
    view: View,
    background: Background | None,
    eye_distance: float,
    output: Output,
    settings: RenderSettings | None,
    drawing: Any,
    context: Any,
) -> Picture:
    """What Scene.render gives, of one view."""
    if output not in OUTPUTS:
        raise UsageError(f"output is '{output}'; choose {', '.join(OUTPUTS)}.")
    if not 0 <= eye_distance < WIDEST_EYES_M:
        raise UsageError(f"eye_distance is {eye_distance}; metres from 0 to 1 are wanted.")
    if settings is not None and background is not None:
        settings = replace(settings, background=background)
    behind = background or scene.subject.background
    eyes = stereo_pair(view, eye_distance) if eye_distance > 0 else [view]
    with shared_renderer(drawing, context, settings, behind) as renderer:
        parts = draw_eyes(renderer, scene, eyes, output)
    picture = parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)
    return picture.view(Picture)


def draw_eyes(
    renderer: Renderer, scene: "OpenedScene", eyes: list[View], output: Output
) -> list[np.ndarray]:
    """(H, W, 3) or (H, W) of each eye."""
    if output == "picture":
        return renderer.render_views(scene, eyes)
    surfaces = [renderer.surface(scene, eye) for eye in eyes]
    if output == "coverage":
        return [surface.coverage for surface in surfaces]
    return [s.depth() if output == "depth" else s.normals() for s in surfaces]


def spread(x: Any, count: int) -> list[Any]:
    """One x a frame.  Raises UsageError."""
    if isinstance(x, str) and x == SWEEP:
        return np.linspace(0, 1, count).tolist()
    if x is None or isinstance(x, str | StopWeights) or np.ndim(x) == 0:
        return [x] * count
    values = list(x)
    if len(values) == count:
        return values
    if not values or not all(isinstance(v, int | float | np.number) for v in values):
        raise UsageError(
            f"x has {len(values)} values for {count} frames; one a frame is wanted, or numbers."
        )
    places = np.linspace(0, len(values) - 1, count)
    return np.interp(places, np.arange(len(values)), values).tolist()


# A scene in a notebook: a picture and a line, or the page for browsers in a frame of its own.

HEIGHTS = (100, 4000)  # pixels


def picture_and_line(scene: OpenedScene) -> str | None:
    """HTML of the first look at a scene and what `repr` says of it; None: it cannot be drawn."""
    from shapeshift.rasterizer.device import NoDevice
    from shapeshift.renderer.gl.context import NoContext
    from shapeshift.runtime_models.model import BadFile

    view = choose_views(scene, "front", 1, None)[0]
    try:
        picture = picture_of(scene, view, None, 0.0, "picture", None, "auto", "auto")
    except (BadFile, UsageError, NoContext, NoDevice):
        return None
    png = base64.b64encode(encoded(picture, "PNG")).decode()
    line = html.escape(repr(scene))
    return f'<img alt="The scene" src="data:image/png;base64,{png}"><br><code>{line}</code>'


@dataclass(frozen=True)
class NotebookPage:
    """What `Scene.show` gives: a notebook displays it.

    page: the whole page, as `launch.py export --out page.html` writes it.  png: a picture of it,
    which stays where a notebook is looked at without its frames.
    """

    page: str
    png: bytes
    height: int

    def _repr_html_(self) -> str:
        return self.html

    def _repr_png_(self) -> bytes:
        return self.png

    @property
    def html(self) -> str:
        """The frame: its page may run its script and nothing else, the notebook is out of its
        reach.

        Path("report.html").write_text(scene.show().html)
        """
        png = base64.b64encode(self.png).decode()
        return (
            f'<iframe sandbox="allow-scripts" allow="xr-spatial-tracking; fullscreen" '
            f'style="width: 100%; height: {self.height}px; border: 0" title="Shapeshift" '
            f'srcdoc="{html.escape(self.page)}"><img alt="The scene" '
            f'src="data:image/png;base64,{png}"></iframe>'
        )

    def __repr__(self) -> str:
        return f"<NotebookPage: {len(self.page):,} bytes; a notebook shows it>"


def show_scene(scene: OpenedScene, picture: np.ndarray, height: int) -> NotebookPage:
    """The page of a scene at its x, and (H, W, 3) of it.  Raises BadFile, UsageError."""
    from PIL import Image

    from shapeshift.app.pace import with_pace
    from shapeshift.app.page.page_file import one_file
    from shapeshift.app.page.page_scene import PageSettings, page_scene
    from shapeshift.runtime_models.model import AnchorModel
    from shapeshift.scene.scene import Scene as DrawnScene

    if not HEIGHTS[0] <= height <= HEIGHTS[1]:
        raise UsageError(f"height is {height}, expected {HEIGHTS[0]} to {HEIGHTS[1]} pixels.")
    document, objects = scene.subject, scene.subject.scene.objects
    if not document.file and len(objects) == 1 and isinstance(objects[0].model, AnchorModel):
        paced = replace(objects[0], model=with_pace(objects[0].model))
        document = replace(document, scene=DrawnScene((paced,)))
    title = scene.path.stem if scene.path else "scene"
    whole = page_scene(document, PageSettings(title), lambda *_: None)
    page = one_file(title, whole, "the page of this notebook").decode()
    kept = io.BytesIO()
    Image.fromarray((np.clip(picture, 0, 1) * 255 + 0.5).astype(np.uint8)).save(kept, "PNG")
    return NotebookPage(page, kept.getvalue(), height)
