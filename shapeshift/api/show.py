"""A scene in a notebook: the page for browsers in a frame of its own."""

import base64
import html
import io
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.api.opened import OpenedScene
from shapeshift.app.errors import UsageError

HEIGHTS = (100, 4000)  # pixels


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
