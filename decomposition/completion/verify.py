"""Render and verify: a patch stays only where it closes holes and harms nothing (OWD, section 3.4).

Holes are pixels of the thing's own mask through which nothing of the background is seen, and those
that show a ghost or a scar: over the place that is filled, what lies off its plane or has a colour
that is nowhere around.  All other
pixels of background are protected: they may hardly change, and around the mask they may not become
less like the photos.  What fills a hole has to look as the background around the mask does, and to
lie on the plane that it fills.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from shapeshift.decomposition.completion.plane import SHADOW, Cells, away_of, shown_cells
from shapeshift.decomposition.masks.label_maps import SILENT
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

MOST_KEPT = 100_000_000  # bytes of pictures of a model that are used again
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
        self.kept: dict = {}  # (id of a view, x): the view, which keeps the id, and what it saw
        self.room = MOST_KEPT

    def draw(self, view: View, x: Controls) -> np.ndarray:
        """(H, W, 4) float32, premultiplied."""
        if self._empty:
            width, height = view.size
            return np.zeros((height, width, 4), np.float32)
        self._decode(x)
        eye = np.asarray(view.world_from_eye.position, np.float32)
        return self._rasterize(view, self._evaluator.color(x, eye))

    def seen(self, view: View, x: Controls) -> tuple[np.ndarray, np.ndarray]:
        """The same, and (H, W) metres along the view behind which LEFT of the light is left, Inf
        where more is.  Read only: kept for the next call, as far as there is room.
        """
        width, height = view.size
        if self._empty:
            return self.draw(view, x), np.full((height, width), np.inf, np.float32)
        key = id(view), str(x)
        if key not in self.kept:
            self._decode(x)
            eye = np.asarray(view.world_from_eye.position, np.float32)
            picture, clear, metres = self._rasterize_depth(view, self._evaluator.color(x, eye))
            rgba = np.concatenate([np.moveaxis(picture, 0, 2), 1 - clear[..., None]], 2)
            if self.room < rgba.nbytes + metres.nbytes:
                return rgba, metres
            self.room -= rgba.nbytes + metres.nbytes
            self.kept[key] = view, (rgba, metres)
        return self.kept[key][1]

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
        picture, _, metres = self._rasterize_depth(view, color)
        return metres, picture[0]

    def _rasterize_depth(self, view: View, color: np.ndarray) -> tuple[np.ndarray, ...]:
        """(3, H, W) of colours (N, 3), (H, W) of the light left, and metres as in seen()."""
        means, scales, wxyz, opacity = self._geometry
        colors = self._device.upload(np.asarray(color, np.float32))
        camera = Camera(*view.pinhole(), view.size, view.near)
        projected = project(self._device, means, scales, wxyz, opacity, colors, camera)
        tiles = bin_tiles(self._device, projected, view.size)
        surfaces = surface(self._device, means, scales, wxyz, camera, projected)
        drawn = rasterize_depth(
            self._device, projected, tiles, surfaces, view.size, light_left=LEFT
        )
        planes = drawn.frame.image, drawn.frame.transmittance, drawn.metres
        picture, clear, metres = (self._device.download(plane).copy() for plane in planes)
        return picture, clear, np.where(metres > 0, metres, np.float32(np.inf))

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
SPREAD = 12.0  # pixels: how far the plane around tells what is behind a thing
LEAST_NEAR = 1e-3  # of a pixel's weight; with less, the mean of all is expected
MOST_COLORS = 4000  # around a mask that are compared with


@dataclass(frozen=True)
class PhotoView:
    """A labelled picture with its photo; None: nothing to compare with."""

    labelled: LabelledView
    photo: np.ndarray | None = None  # (H, W, 3) display sRGB 0..1


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
    usual: int = 0  # pixels of the plane around
    usual_bad: int = 0  # of those, that would count as holes
    # Squares of filled pixels from the colour that is expected there, before and after, by the
    # label of the thing that a photo shows instead.
    unlike: np.ndarray = field(default_factory=lambda: np.zeros((2, SILENT + 1)))


def verify(
    device: Device,
    before: AnchorModel | ModelPictures,
    after: AnchorModel | ModelPictures,
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
    drawings = [
        each if isinstance(each, ModelPictures) else ModelPictures(device, each)
        for each in (before, after)
    ]
    for view in sorted(views, key=lambda view: str(view.labelled.x)):
        mask = view.labelled.labels == label
        if mask.sum() < LEAST_PIXELS:
            continue
        pair = [each.seen(view.labelled.view, view.labelled.x) for each in drawings]
        add_view(tally, view, mask, pair, background, cells, shadows)
    return judge(tally)


def add_view(
    tally: Tally,
    view: PhotoView,
    mask: np.ndarray,
    pair: Sequence[tuple[np.ndarray, np.ndarray]],
    background: tuple[float, float, float],
    cells: Cells | None,
    shadows: bool,
) -> None:
    """One view's pictures (H, W, 4) before and after, each with its depths (H, W) metres."""
    from scipy import ndimage

    camera = view.labelled.view
    pictures = [over(picture, background) for picture, _ in pair]
    near = around_mask(mask, MARGIN + AROUND)  # the rest of the picture is only protected
    grown = np.zeros_like(mask)
    grown[near] = ndimage.binary_dilation(mask[near], iterations=MARGIN)
    protected = ~grown & (view.labelled.labels == 0)
    if cells is not None and shadows:
        protected &= ~shown_cells(camera, cells.middles, cells.side_m)
    if protected.any():
        error = ((pictures[0] - pictures[1]) ** 2).mean(2)[protected]
        tally.alike_db = min(tally.alike_db, decibels(float(error.mean())))
    beside = ndimage.binary_dilation(grown[near], iterations=AROUND) & protected[near]
    photo = None if view.photo is None else view.photo[near]
    if view.photo is not None and photo is not None:
        own = ((pictures[0] - view.photo) ** 2).mean(2)
        after = ((pictures[1][near] - photo) ** 2).mean(2)
        tally.beside += int(beside.sum())
        tally.error_before += float(own[near][beside].sum())
        tally.error_after += float(after[beside].sum())
        tally.own += int(protected.sum())
        tally.own_error += float(own[protected].sum())
    here = [(picture[near], pair[i][0][near][..., 3]) for i, picture in enumerate(pictures)]
    aways = [np.zeros(beside.shape)] * 2
    place, plane = mask[near], beside
    behind = ~np.isin(view.labelled.labels[near], (0, SILENT))  # all things are taken away
    if cells is not None:
        aways = [away_of(camera, metres, cells)[near] for _, metres in pair]
        place = place & shown_cells(camera, cells.middles, cells.side_m / 2)[near]
        behind &= shown_cells(camera, cells.middles, cells.side_m)[near]
        if len(cells.around):
            plane = beside & shown_cells(camera, cells.around, cells.side_m / 2)[near]
    add_fills(tally, mask[near], place, beside, plane, here, aways, photo)
    wanted = None if photo is None else expected_colors(photo, plane, behind)
    if wanted is not None:
        whose = view.labelled.labels[near][behind]
        for sums, (picture, _) in zip(tally.unlike, here, strict=True):
            sums += np.bincount(whose, ((picture[behind] - wanted) ** 2).sum(1), SILENT + 1)


def add_fills(
    tally: Tally,
    mask: np.ndarray,
    place: np.ndarray,
    beside: np.ndarray,
    plane: np.ndarray,
    pair: Sequence[tuple[np.ndarray, np.ndarray]],
    aways: Sequence[np.ndarray],
    photo: np.ndarray | None,
) -> None:
    """What became of the pixels of a mask (H, W), of those that show filled cells, `place`.

    beside: pixels around the mask, plane: those of them on its plane.  pair: colours (H, W, 3) and
    alpha (H, W) before and after; aways: sides of a cell to the plane.
    """
    tally.views += 1
    known = (pair[0][0] if photo is None else photo)[beside]
    # A training may leave a floor of its background's own colour nearly clear all over.
    clear = OPEN * max(float(a[beside].mean()) for _, a in pair) if beside.any() else OPEN
    bad = [mask & (alpha < clear) for _, alpha in pair]
    for wrong, (picture, _), away in zip(bad, pair, aways, strict=True):
        wrong |= place & (away > MOST_AWAY)
        here = place & ~wrong
        if len(known):
            wrong[here] = strangeness(picture[here], known) > SCAR
    tally.usual += int(plane.sum())
    tally.usual_bad += int((plane & ((pair[0][1] < clear) | (aways[0] > MOST_AWAY))).sum())
    there = place & (pair[1][1] >= clear)
    tally.away += float(aways[1][there].sum())
    tally.placed += int(there.sum())
    tally.before += int(bad[0].sum())
    tally.after += int(bad[1].sum())
    meant = place & bad[0]
    tally.meant += int(meant.sum())
    tally.met += int((meant & ~bad[1]).sum())
    filled = bad[0] & (pair[1][1] >= clear)
    if filled.any() and len(known):
        tally.strange += float(strangeness(pair[1][0][filled], known).sum())
        tally.filled += int(filled.sum())


def expected_colors(photo: np.ndarray, plane: np.ndarray, place: np.ndarray) -> np.ndarray | None:
    """(n, 3) display sRGB: of the place's pixels, what a photo (H, W, 3) shows of their plane
    around, the nearer the more; None where that is too little.

    What is dark there is left out: it may be the thing's own shadow.
    """
    from scipy import ndimage

    light = photo.sum(2)
    if plane.sum() < LEAST_PIXELS:
        return None
    lit = (plane & (light >= SHADOW * np.median(light[plane]))).astype(np.float32)
    sums = np.stack([lit, *np.moveaxis(photo * lit[..., None], 2, 0)], 2)  # (H, W, 4)
    near = ndimage.gaussian_filter(sums, (SPREAD, SPREAD, 0), mode="constant")[place]
    sure = near[:, :1] > LEAST_NEAR
    return np.where(sure, near[:, 1:] / np.where(sure, near[:, :1], 1), photo[lit > 0].mean(0))


def around_mask(mask: np.ndarray, margin: int) -> tuple[slice, slice]:
    """The rows and columns of a mask (H, W) that is not empty, and so many pixels around."""
    ends = (np.flatnonzero(mask.any(axis))[[0, -1]] for axis in (1, 0))
    rows, columns = (slice(max(low - margin, 0), high + margin + 1) for low, high in ends)
    return rows, columns


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
    usual = tally.usual_bad / max(tally.usual, 1)  # no fill is better than what it is a copy of
    why = ""
    if not tally.views:
        why = "no view shows the thing, so that nothing can be verified"
    elif not tally.meant:
        why = "there was no hole, ghost or scar"
    elif not tally.met >= LEAST_FEWER * (1 - usual) * tally.meant:
        why = f"it closes {100 * tally.met / tally.meant:.0f} % of the holes where it lies"
    elif not tally.alike_db >= least_alike(tally):
        why = f"it changes what is not behind the thing ({tally.alike_db:.1f} dB alike)"
    elif not photo[1] >= photo[0] - MOST_LOST_DB:
        why = f"it is less like the photos ({photo[0]:.1f} -> {photo[1]:.1f} dB)"
    elif not strange <= MOST_STRANGE:
        why = f"its colours are not those around the thing ({strange:.2f} away)"
    elif not away <= MOST_AWAY:
        why = f"what fills the holes lies {away:.1f} sides of a cell off the plane"
    elif not tally.unlike[1].sum() <= tally.unlike[0].sum():
        why = "what was there before is more like the plane around"
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
