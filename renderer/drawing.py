"""What a drawing back end does, whichever way: tiles/ by OpenCL, gl/ by quads."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from contextlib import AbstractContextManager

import moderngl
import numpy as np

from shapeshift.rasterizer.resolve import WindowOverlay
from shapeshift.renderer.colors.false_colors import Shade
from shapeshift.renderer.settings import RenderSettings
from shapeshift.renderer.surface import Surface
from shapeshift.renderer.timing import PassTimer
from shapeshift.runtime_models.leaf_levels import LeafSplats
from shapeshift.runtime_models.model import BadFile, Model
from shapeshift.runtime_models.stop_weights import Controls
from shapeshift.scene.appearance import Appearance, Background
from shapeshift.scene.pose import View

SAMPLE = 4096  # splats, for a median


class Drawing(ABC):
    """The arena of all objects, and the passes that draw it.

    Its life: allocate, decode what changed, place, draw.
    """

    decodes_on_gpu: bool  # says which clock times the decoding: GL's or the wall's
    backends: dict[str, str]  # what is in use: drawing, mlps, sort
    sorts: int  # of the last frame, as order_age: see FrameStats
    order_age: int
    counts_age = 0  # frames since the one that `counts` told of last
    draws_heat: bool  # in addition to the colours, from the next frame on
    shares_pages = False  # copies of an object may draw the same pages
    weighs_pages = False  # pages may be drawn as a part of themselves

    @abstractmethod
    def allocate(self, models: list[Model]) -> None:
        """Room for these objects; what was decoded before is gone."""

    def exchange(self, models: list[Model]) -> list[bool]:
        """Room for other models of the same objects; of which what is decoded is kept.  Raises
        ValueError as `allocate` does.
        """
        self.allocate(models)
        return [False] * len(models)

    def allocate_pages(
        self, models: list[Model], pages: int, coefficients: int, stored: int | None = None
    ) -> None:
        """The same, with pages of rasterizer/pages.py for what a budget draws of models with
        leaves (streaming/); coefficients: harmonics of each of their splats; stored: pages that
        they lie in at first, where copies share them.
        """
        raise BadFile("only tiles draw by a budget; add --drawing tiles, or leave --budget out.")

    def pages_of(self, i: int) -> np.ndarray:
        """Pages that hold splats of object i, rising: the order of `read_splats`."""
        raise TypeError("this drawing has no pages.")

    def place_pages(self, pages: np.ndarray, owner: np.ndarray, given: LeafSplats) -> None:
        """Splats (n PAGE,), of opacity 0 where there are none, into pages (n,) of objects (n,)."""
        raise TypeError("this drawing has no pages.")

    def share_pages(self, pages: np.ndarray, owner: np.ndarray, like: np.ndarray) -> None:
        """Draws in pages (n,) of objects (n,) the splats of pages `like` (n,).  Where one of these
        objects is changed later, it has splats of its own from then on.
        """
        raise TypeError("this drawing shares no pages.")

    def weigh_pages(self, pages: np.ndarray, part: float) -> None:
        """Draws pages (n,) as a part of themselves from now on, until they are cleared;
        1 is as they are.
        """
        raise TypeError("this drawing weighs no pages.")

    def trim(self) -> int:
        """Gives back what passes of other sizes left behind; bytes of main memory that all arrays
        have then, 0 where they lie elsewhere.
        """
        return 0

    def clear_pages(self, pages: np.ndarray) -> None:
        """Nothing is in these pages any more."""
        raise TypeError("this drawing has no pages.")

    def shade_pages(self, pages: np.ndarray) -> None:
        """Colours of pages whose splats look alike from everywhere, in all sets."""
        raise TypeError("this drawing has no pages.")

    @abstractmethod
    def decode_geometry(
        self,
        i: int,
        x: Controls,
        eye_object: np.ndarray | None = None,
        seen: np.ndarray | None = None,
    ) -> None:
        """Means, covariances and opacities of object i at control value x; (A,): one an anchor.

        eye_object: (3,) in the object's frame, for a model that follows it; seen: (A,) bool, the
        anchors of such a model that are there, None: all.
        """

    @abstractmethod
    def color_set(self, which: int, count: int) -> None:
        """From now on colours are decoded into set `which` of `count`: 1 for all views of a frame,
        or one a view; more where `draw` is told which.
        """

    @abstractmethod
    def decode_color(
        self,
        i: int,
        shade: Shade,
        eye_object: np.ndarray,
        seen: np.ndarray | None = None,
        at_once: bool = False,
        grade: Appearance | None = None,
    ) -> None:
        """Colours of object i, towards an eye (3,) in the object's frame, and what of them is heat.

        seen: (A,) bool, one an anchor (tiles: a splat of layers): the rest may keep what it has.
        at_once: the heat becomes colours of its palettes here.  grade: of what is not heat.
        """

    def seen_splats(
        self, i: int, views: Sequence[View], settings: RenderSettings
    ) -> np.ndarray | None:
        """(n,) bool: which splats of object i these views may see, never False where one does;
        None: nobody knows, or it would not pay.
        """
        return None

    @abstractmethod
    def read_splats(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        """mean_opacity (n, 4) and covariance (n, 8) of object i, in its frame; copies."""

    @abstractmethod
    def write_splats(self, i: int, mean_opacity: np.ndarray, covariance: np.ndarray | None) -> None:
        """Replaces what `read_splats` gives, until object i is decoded again; None: shapes stay."""

    @abstractmethod
    def wait_decoded(self) -> None:
        """Returns when what was decoded is there, or when what follows waits for it anyway."""

    @abstractmethod
    def set_poses(self, world_from_objects: np.ndarray) -> None:
        """Poses (O, 4, 4) of all objects; one full of NaN hides its object."""

    @abstractmethod
    def draw(
        self, views: list[View], settings: RenderSettings, timer: PassTimer, first: int = 0,
        sets: Sequence[int] = (), again: bool = False,
    ) -> None:  # fmt: skip
        """Draws every view; view i is then image(first + i).

        sets: whose colours each view has; none: its own where there is a set for each, else the
        one.  again: in the order of the frame before, whose views have seen all that these see.
        """

    @abstractmethod
    def order_set_aside(self) -> AbstractContextManager[None]:
        """Whatever the body does to the order, afterwards it is the one that was in use before."""

    @abstractmethod
    def counts(self, wait: bool = False) -> dict[str, int]:
        """{drawn, *CULL_REASONS} of the view drawn last: gates in their order; once a frame.  On a
        GPU of counts_age frames before, unless it is waited for.
        """

    @property
    def hidden(self) -> int:
        """Splats that the last frame left out behind others: no gate was asked about them."""
        return 0

    @abstractmethod
    def presentable(self, i: int) -> np.ndarray | moderngl.Texture:
        """The image of view i as resolve takes it: (H, W, 4), row 0 on top, or on the GPU, row 0 at
        the bottom; its colours count in unit_of(i).
        """

    @abstractmethod
    def unit_of(self, i: int) -> float:
        """The display value that 1 in presentable(i) stands for."""

    @abstractmethod
    def presentable_heat(self, i: int) -> np.ndarray | moderngl.Texture:
        """What resolve takes in addition, of a frame with heat."""

    @abstractmethod
    def presentable_depth(self, i: int) -> np.ndarray | moderngl.Texture:
        """Of view i where settings.depth_scale is above 0: metres along the view times coverage in
        red, coverage in alpha, (H, W, 4) with row 0 on top, or on the GPU, row 0 at the bottom.

        Metres over coverage is the expected depth: each splat where the ray is halfway through its
        ellipsoid, weighed by alpha times transmittance.
        """

    def presentable_bytes(
        self, i: int, background: Background, view: View, palette: np.ndarray | None = None,
        heat: bool = False, as_window: bool = False, overlay: WindowOverlay | None = None,
    ) -> np.ndarray:  # fmt: skip
        """(H, W, 4) uint8 of view i as a window shows it, opaque: red first and row 0 at the
        bottom, or as a window has it in memory, blue first and row 0 on top.

        view: whose directions a sky is seen in.  palette: of the heat, where the view has any, else
        of the picture.  overlay: over a window's.  Only where presentable() is an array.
        """
        raise TypeError("this drawing's pictures are textures; present them by GL.")

    @abstractmethod
    def image(self, i: int) -> np.ndarray:
        """(H, W, 4) float32 premultiplied, row 0 on top, of the view last drawn as number i."""

    @abstractmethod
    def heat(self, i: int) -> np.ndarray:
        """(H, W, 2) float32, row 0 on top, of the same view: value and weight, both times alpha."""

    @abstractmethod
    def splat_points(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """mean_opacity (N, 4), object index (N,), covariance (N, 8), for debug views."""

    @abstractmethod
    def write_colors(self, color: np.ndarray) -> None:
        """Replaces the colours of all splats, (N, 3) display sRGB, until they are decoded again."""

    @abstractmethod
    def read_colors(self, i: int) -> tuple[np.ndarray, np.ndarray | None]:
        """(n, 3) colours of object i in the set that is decoded into, and beside them (n, 4) heat:
        0 to 2 value times weight or colour, 3 weight; None: there is none.  Copies.
        """

    @abstractmethod
    def replace_colors(self, i: int, color: np.ndarray, heat: np.ndarray | None) -> None:
        """Writes what `read_colors` gives, until object i is decoded again."""

    @abstractmethod
    def overdraw(self, i: int, view: View, settings: RenderSettings) -> np.ndarray:
        """(H, W): how many splats each pixel of view i, just drawn, blends, for a debug view."""

    @abstractmethod
    def edges(self, i: int, view: View, settings: RenderSettings, kind: str) -> np.ndarray:
        """(H, W, 4) of view i, just drawn: splats as one of settings.EDGES, for a debug view."""

    @abstractmethod
    def surface(self, view: View, settings: RenderSettings) -> Surface:
        """Depth, normals and coverage from a view; the last frame and its counts stay."""

    @abstractmethod
    def close(self) -> None:
        """Gives the memory of the scene back."""


def median_distance(
    eye_from_objects: np.ndarray, mean_opacity: np.ndarray, owner: np.ndarray
) -> float:
    """Metres from an eye to the median of the splats that are there; 0 without any.

    eye_from_objects (O, 4, 4); of a sample of the splats mean_opacity (n, 4) and their object (n,).
    """
    rows = eye_from_objects[owner, :3]  # (n, 3, 4)
    places = (rows[..., :3] @ mean_opacity[:, :3, None])[..., 0] + rows[..., 3]
    distance = np.linalg.norm(places[mean_opacity[:, 3] > 0], axis=1)
    distance = distance[np.isfinite(distance)]
    return float(np.median(distance)) if distance.size else 0.0
