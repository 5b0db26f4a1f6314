"""Render and verify: a patch stays only where it closes holes and harms nothing (OWD, section 3.4).

Holes are pixels of the thing's own mask through which nothing of the background is seen, and those
that show a ghost or a scar: over the place that is filled, what lies off its plane or has a colour
that is nowhere around.  All other
pixels of background are protected: they may hardly change, and around the mask they may not become
less like the photos.  What fills a hole has to look as the background around the mask does, and to
lie on the plane that it fills.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shapeshift.decomposition.partition import LabelledView
from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.project import Camera, project
from shapeshift.rasterizer.raster import rasterize_rgba
from shapeshift.rasterizer.surface import rasterize_depth, surface
from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import AnchorModel
from shapeshift.runtime_models.stop_weights import Controls
from shapeshift.scene.pose import View

LEFT = 0.7  # of the light: a surface of splats has a thickness, and one looks at its skin

# Pictures of a model with the OpenCL tiles, one view after the other.


class ModelPictures:
    """Draws a model that stays as it is; pictures of one x in a row are quicker."""

    def __init__(self, device: Device, model: AnchorModel) -> None:
        self._device, self._evaluator = device, Evaluator(model)
        self._empty = model.splat_count == 0
        self._x: Controls | None = None
        self._geometry: list = []
        self._means = np.zeros((0, 3))  # (N, 3) metres

    def draw(self, view: View, x: Controls) -> np.ndarray:
        """(H, W, 4) float32, premultiplied."""
        if self._empty:
            width, height = view.size
            return np.zeros((height, width, 4), np.float32)
        self._decode(x)
        eye = np.asarray(view.world_from_eye.position, np.float32)
        return self._rasterize(view, self._evaluator.color(x, eye))

    def away(self, view: View, x: Controls, cells: "Cells") -> np.ndarray:
        """(H, W) sides of a cell from the cells' plane to the splats seen, by their share.

        0 where nothing is seen.  A splat counts as FARTHEST at most: what shines through from far
        behind would hide what lies on the plane.
        """
        width, height = view.size
        if self._empty:
            return np.zeros((height, width))
        self._decode(x)
        away = np.abs(self._means @ cells.normal - (cells.middles @ cells.normal).mean())
        color = np.zeros((len(away), 3), np.float32)  # drawn: shares are the picture's own
        color[:, 0] = np.minimum(away / cells.side_m, FARTHEST)
        picture = self._rasterize(view, color).astype(np.float64)
        seen = picture[..., 3] > 0
        return np.where(seen, picture[..., 0] / np.where(seen, picture[..., 3], 1), 0.0)

    def depth(self, view: View, x: Controls, marked: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(H, W) metres along the view behind which LEFT of the light is left, Inf where more is;
        and (H, W) the share of each pixel that the marked splats (N,) show.
        """
        width, height = view.size
        if self._empty:
            return np.full((height, width), np.inf, np.float32), np.zeros((height, width))
        self._decode(x)
        color = np.zeros((len(self._means), 3), np.float32)
        color[:, 0] = marked
        means, scales, wxyz, opacity = self._geometry
        colors = self._device.upload(color)
        camera = Camera(*view.pinhole(), view.size, view.near)
        projected = project(self._device, means, scales, wxyz, opacity, colors, camera)
        tiles = bin_tiles(self._device, projected, view.size)
        surfaces = surface(self._device, means, scales, wxyz, camera, projected)
        drawn = rasterize_depth(
            self._device, projected, tiles, surfaces, view.size, light_left=LEFT
        )
        metres = self._device.download(drawn.metres)
        share = self._device.download(drawn.frame.image)[0].copy()
        return np.where(metres > 0, metres, np.float32(np.inf)), share

    def _decode(self, x: Controls) -> None:
        """Geometry at x, kept on the device."""
        if self._x is None or x != self._x:
            columns = self._evaluator.geometry(x)
            self._means = np.asarray(columns[0], np.float64)
            self._geometry = [self._device.upload(np.asarray(c, np.float32)) for c in columns]
            self._x = x

    def _rasterize(self, view: View, color: np.ndarray) -> np.ndarray:
        """(H, W, 4) with these colours (N, 3)."""
        means, scales, wxyz, opacity = self._geometry
        colors = self._device.upload(np.asarray(color, np.float32))
        camera = Camera(*view.pinhole(), view.size, view.near)
        projected = project(self._device, means, scales, wxyz, opacity, colors, camera)
        tiles = bin_tiles(self._device, projected, view.size)
        return rasterize_rgba(self._device, projected, tiles, view.size).copy()


def over(picture: np.ndarray, background: np.ndarray | tuple[float, float, float]) -> np.ndarray:
    """(H, W, 3) of a premultiplied picture (H, W, 4) before a colour."""
    return picture[..., :3] + (1 - picture[..., 3:]) * np.asarray(background, np.float32)


OPEN = 0.5  # of the alpha around, below which a pixel is a hole
MARGIN = 3  # pixels around a mask that are not protected: the thing's own border
AROUND = 24  # pixels around a mask that are compared with photos, and lend their colours
LEAST_PIXELS = 30  # of a mask, for a view to say something
LEAST_FEWER = 0.75  # of the holes over the cells that were filled that must be closed
# PSNR of protected pixels, before against after, in the worst view; less where the scene itself is
# less like its photos.
LEAST_ALIKE_DB = 30.0
MOST_LOST_DB = 2.0  # that protected pixels around a mask may lose against the photos
MOST_STRANGE = 0.06  # display units from a filled pixel to the nearest colour around, mean
MOST_AWAY = 1.5  # sides of a cell off the plane: of a pixel that shows a ghost; of fills, mean
SCAR = 0.1  # display units from one pixel to the nearest colour around: noise and seams are below
FARTHEST = 4.0  # sides of a cell
MOST_COLORS = 4000  # around a mask that are compared with


@dataclass(frozen=True)
class PhotoView:
    """A labelled picture with its photo; None: nothing to compare with."""

    labelled: LabelledView
    photo: np.ndarray | None = None  # (H, W, 3) uint8 display sRGB


class Cells(NamedTuple):
    """Squares on a plane."""

    middles: np.ndarray  # (n, 3) metres
    side_m: float
    normal: np.ndarray  # (3,) unit, of the plane


@dataclass(frozen=True)
class Verdict:
    """What a step did, over all views that show the thing."""

    views: int
    holes_before: int  # pixels
    holes_after: int
    alike_db: float  # the worst view's protected pixels, before against after
    photo_before_db: float  # protected pixels around the masks, against the photos
    photo_after_db: float
    strange: float  # display units from the colours of fills to those around, mean
    away: float  # sides of a cell from what fills cells to their plane, mean
    why: str  # "": accepted; else what is wrong with it, a clause

    @property
    def is_accepted(self) -> bool:
        return not self.why

    def sentence(self) -> str:
        """For people."""
        holes = f"holes {self.holes_before:,} -> {self.holes_after:,} pixels in {self.views} views"
        return f"refused: {self.why} ({holes})" if self.why else holes


@dataclass
class Tally:
    views: int = 0
    before: int = 0
    after: int = 0
    meant: int = 0  # holes over the cells that are filled
    met: int = 0  # of those, closed
    alike_db: float = np.inf
    error_before: float = 0.0
    error_after: float = 0.0
    beside: int = 0
    strange: float = 0.0
    filled: int = 0
    away: float = 0.0  # sides of a cell, of filled pixels over the cells
    placed: int = 0
    own_error: float = 0.0  # of all protected pixels before, against the photos
    own: int = 0


def verify(
    device: Device,
    before: AnchorModel,
    after: AnchorModel,
    label: int,
    views: Sequence[PhotoView],
    background: tuple[float, float, float] = (0.0, 0.0, 0.0),
    cells: Cells | None = None,
    shadows: bool = False,
) -> Verdict:
    """Whether `after` is better than `before`, a model without the thing of that label.

    cells: where holes have to close; all over the masks, if None.  shadows: what photos show of
    these cells is not protected, since it is shadow there.
    """
    tally = Tally()
    drawings = ModelPictures(device, before), ModelPictures(device, after)
    for view in sorted(views, key=lambda view: str(view.labelled.x)):
        mask = view.labelled.labels == label
        if mask.sum() < LEAST_PIXELS:
            continue
        pair = [each.draw(view.labelled.view, view.labelled.x) for each in drawings]
        off = []
        if cells is not None:
            off = [each.away(view.labelled.view, view.labelled.x, cells) for each in drawings]
        add_view(tally, view, mask, pair, off, background, cells, shadows)
    return judge(tally)


def add_view(
    tally: Tally,
    view: PhotoView,
    mask: np.ndarray,
    pair: list[np.ndarray],
    off: Sequence[np.ndarray],
    background: tuple[float, float, float],
    cells: Cells | None,
    shadows: bool,
) -> None:
    """One view's pictures (H, W, 4) before and after, and how far each lies off the plane."""
    from scipy import ndimage

    first, second = (over(picture, background) for picture in pair)
    grown = ndimage.binary_dilation(mask, iterations=MARGIN)
    protected = ~grown & (view.labelled.labels == 0)
    if cells is not None and shadows:
        protected &= ~shown_cells(view.labelled.view, cells, 1.0)
    if protected.any():
        error = float(((first - second)[protected] ** 2).mean())
        tally.alike_db = min(tally.alike_db, decibels(error))
    beside = ndimage.binary_dilation(grown, iterations=AROUND) & protected
    photo = None if view.photo is None else view.photo.astype(np.float32) / 255
    if photo is not None:
        errors = [((each - photo) ** 2).mean(2) for each in (first, second)]
        tally.beside += int(beside.sum())
        tally.error_before += float(errors[0][beside].sum())
        tally.error_after += float(errors[1][beside].sum())
        tally.own += int(protected.sum())
        tally.own_error += float(errors[0][protected].sum())
    known = (first if photo is None else photo)[beside]
    place = mask if cells is None else mask & shown_cells(view.labelled.view, cells, 0.5)
    # A training may leave a floor of its background's own colour nearly clear all over.
    clear = OPEN * max(float(p[beside, 3].mean()) for p in pair) if beside.any() else OPEN
    bad = [mask & (picture[..., 3] < clear) for picture in pair]
    for wrong, picture, away in zip(bad, (first, second), off, strict=False):
        wrong |= place & (away > MOST_AWAY)
        here = place & ~wrong
        if len(known):
            wrong[here] = strangeness(picture[here], known) > SCAR
    if off:
        there = place & (pair[1][..., 3] >= clear)
        tally.away += float(off[1][there].sum())
        tally.placed += int(there.sum())
    tally.views += 1
    tally.before, tally.after = (
        total + int(wrong.sum())
        for total, wrong in zip((tally.before, tally.after), bad, strict=True)
    )
    meant = place & bad[0]
    tally.meant += int(meant.sum())
    tally.met += int((meant & ~bad[1]).sum())
    filled = bad[0] & (pair[1][..., 3] >= clear)
    if filled.any() and len(known):
        tally.strange += float(strangeness(second[filled], known).sum())
        tally.filled += int(filled.sum())


def shown_cells(view: View, cells: Cells, reach: float) -> np.ndarray:
    """(H, W) bool: pixels nearer than so many sides of a cell to its middle."""
    from PIL import Image, ImageDraw

    eye_from_world, fx, fy, cx, cy = view.pinhole()
    at = np.c_[cells.middles, np.ones(len(cells.middles))] @ eye_from_world.T
    picture = Image.new("1", view.size)
    pen = ImageDraw.Draw(picture)
    for x, y, z in at[at[:, 2] > view.near, :3]:
        u, v, far = fx * x / z + cx, fy * y / z + cy, reach * cells.side_m * max(fx, fy) / z
        pen.ellipse((u - far, v - far, u + far, v + far), fill=1)
    return np.array(picture)


def strangeness(colors: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(n,) display units from colours (n, 3) to the nearest of the known ones (m, 3)."""
    from scipy.spatial import cKDTree

    few = known[:: -(-len(known) // MOST_COLORS)]
    return cKDTree(few).query(colors, workers=1)[0]


def judge(tally: Tally) -> Verdict:
    """The verdict of all views."""
    beside = max(tally.beside, 1)
    photo = [decibels(e / beside) for e in (tally.error_before, tally.error_after)]
    strange = tally.strange / max(tally.filled, 1)
    away = tally.away / max(tally.placed, 1)
    why = ""
    if not tally.views:
        why = "no view shows the thing, so that nothing can be verified"
    elif not tally.meant:
        why = "there was no hole, ghost or scar"
    elif not tally.met >= LEAST_FEWER * tally.meant:
        why = f"it closes {100 * tally.met / tally.meant:.0f} % of the holes where it lies"
    elif not tally.alike_db >= least_alike(tally):
        why = f"it changes what is not behind the thing ({tally.alike_db:.1f} dB alike)"
    elif not photo[1] >= photo[0] - MOST_LOST_DB:
        why = f"it is less like the photos ({photo[0]:.1f} -> {photo[1]:.1f} dB)"
    elif not strange <= MOST_STRANGE:
        why = f"its colours are not those around the thing ({strange:.2f} away)"
    elif not away <= MOST_AWAY:
        why = f"what fills the holes lies {away:.1f} sides of a cell off the plane"
    return Verdict(
        tally.views,
        tally.before,
        tally.after,
        tally.alike_db,
        photo[0],
        photo[1],
        strange,
        away,
        why,
    )


def least_alike(tally: Tally) -> float:
    """dB that protected pixels have to stay alike: no more than the scene itself reaches there."""
    own = decibels(tally.own_error / tally.own) if tally.own else np.inf
    return min(LEAST_ALIKE_DB, own) if own == own else LEAST_ALIKE_DB


def decibels(error: float) -> float:
    """PSNR of a mean squared error."""
    return np.inf if error == 0 else float(-10 * np.log10(error))  # NaN stays
