"""Points that fill the splats of an object, without floaters: what a collider is wrapped around."""

from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.fit_harmonics import spread_directions
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.rotation import normalize, rotation_matrices
from shapeshift.scene.colliders.collider_wrap import CELLS

OPAQUE = 0.3  # opacity; a fainter splat counts where several together stop as much light
FAINT = 0.02  # a fainter one never counts
WIDEST = 0.25  # of the object's longest side; a wider splat is haze
NEIGHBOURS = 8
LONELY = 3.0  # times the usual distance to its neighbours: a floater
LONELIER = 2.0  # times the distance that its neighbours have to theirs
BESIDE = 2.5  # times its own size: with neighbours so near it is none
SPACING = 1.3  # cells are no smaller than this times the distance between splats
COARSEST = 24  # cells along the longest side, however few splats there are
MOST_LOOKED_AT = 300_000  # splats for distances
ROUGH_SPLATS = 4000  # that a rough hull is made of
NEEDLE = 4.0  # cells from its centre that a splat reaches where it is alone
CLASSES = (1, 12, 48, 192, 768)  # points a splat gets, by its size in cells


@dataclass(frozen=True)
class Filling:
    points: np.ndarray  # (M, 3) float64 metres
    cell_m: float  # what the points are dense enough for
    splats: int  # that they come from


NOTHING = Filling(np.zeros((0, 3)), 0.0, 0)


def fill_splats(
    means: np.ndarray,
    scales: np.ndarray,
    wxyz: np.ndarray,
    opacity: np.ndarray,
    cells: int = CELLS,
) -> Filling:
    """Points within one sigma of the splats that count.  (N, 3) metres twice, (N, 4), (N,).

    cells: along the longest side, at most.
    """
    known = np.isfinite(means).all(1) & np.isfinite(scales).all(1) & np.isfinite(wxyz).all(1)
    rows = np.flatnonzero(known & (opacity >= FAINT))
    if not len(rows):
        return NOTHING
    solid = solid_or_all(opacity[rows])
    kept = in_the_object(means[rows], solid)
    rows = rows[kept]
    solid = solid_or_all(opacity[rows])
    longest = np.ptp(means[rows[solid]], axis=0).max()
    slender = scales[rows].max(1) <= WIDEST * longest
    if (slender & solid).any():
        rows, solid = rows[slender], solid[slender]
    rows, solid, spacing = without_lonely(means, scales, rows, solid)
    if not len(rows):
        return NOTHING
    reach = np.ptp(means[rows], axis=0) + 2 * np.median(scales[rows].max(1))
    cell_m = float(max(reach.max() / cells, min(SPACING * spacing, reach.max() / COARSEST)))
    if not cell_m > 0:
        return Filling(means[rows].astype(np.float64), 0.0, len(rows))
    axes = rotation_matrices(normalize(wxyz[rows].astype(np.float64))) * scales[rows, None, :]
    centres = means[rows].astype(np.float64)
    points, of = keep_dense(
        scatter(centres, axes, scales[rows], cell_m), opacity[rows], solid, cell_m
    )
    return Filling(without_needles(points, of, centres, cell_m), cell_m, len(rows))


def hull_points(
    means: np.ndarray, scales: np.ndarray, wxyz: np.ndarray, opacity: np.ndarray
) -> np.ndarray:
    """(V, 3) metres: the ends of at most ROUGH_SPLATS of the splats that fill_splats() takes, six
    each.  Raises BadFile where none is opaque enough.
    """
    known = np.isfinite(means).all(1) & np.isfinite(scales).all(1) & np.isfinite(wxyz).all(1)
    rows = np.flatnonzero(known & (opacity >= FAINT))
    if not len(rows):
        raise BadFile(nothing_to_touch(len(means)))
    rows = rows[solid_or_all(opacity[rows])]
    rows = rows[:: -(-len(rows) // ROUGH_SPLATS)]
    rows = rows[in_the_object(means[rows], np.ones(len(rows), bool))]
    slender = scales[rows].max(1) <= WIDEST * np.ptp(means[rows], axis=0).max()
    rows = rows[slender] if slender.any() else rows
    near = neighboured(means[rows].astype(np.float64), scales[rows])[0]
    rows = rows[near] if near.any() else rows
    axes = rotation_matrices(normalize(wxyz[rows].astype(np.float64))) * scales[rows, None, :]
    ends = np.concatenate([axes, -axes], 2).swapaxes(1, 2)  # (n, 6, 3)
    return (means[rows, None].astype(np.float64) + ends).reshape(-1, 3)


def solid_or_all(opacity: np.ndarray) -> np.ndarray:
    """(n,) bool: the opaque ones; where all of them are faint, what is there counts."""
    solid = opacity >= OPAQUE
    return solid if solid.any() else np.ones(len(opacity), bool)


def in_the_object(means: np.ndarray, solid: np.ndarray) -> np.ndarray:
    """(n,) bool: not far outside of where nearly all of the solid ones are."""
    low, high = np.percentile(means[solid], (1, 99), axis=0)
    room = 0.25 * (high - low).max() + 0.25 * (high - low)
    return ((means >= low - room) & (means <= high + room)).all(1)


def without_lonely(
    means: np.ndarray, scales: np.ndarray, rows: np.ndarray, solid: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """The rows and their `solid` without floaters, and the metres from a splat to the next.

    A solid one needs solid neighbours; a faint one any, as it only counts where several add up.
    """
    centres = means[rows].astype(np.float64)
    near = np.zeros(len(rows), bool)
    near[solid], usual, spacing = neighboured(centres[solid], scales[rows[solid]])
    if not solid.all():
        near[~solid] = neighboured(centres, scales[rows], usual)[0][~solid]
    return rows[near], solid[near], spacing


def neighboured(
    centres: np.ndarray, scales: np.ndarray, usual: float | None = None
) -> tuple[np.ndarray, float, float]:
    """(n,) bool: not lonely among themselves; the usual metres to neighbours, to the nearest one.

    centres (n, 3) metres, scales (n, 3); usual: what others have as the usual distance.
    """
    from scipy.spatial import cKDTree

    step = -(-len(centres) // MOST_LOOKED_AT)
    tree = cKDTree(centres[::step])
    count = min(NEIGHBOURS + 1, tree.n)
    if count < 2:
        return np.ones(len(centres), bool), 0.0, 0.0
    away, which = (found[:, 1:] for found in tree.query(centres, k=count))
    mean = away.mean(1)
    usual = float(np.median(mean)) if usual is None else usual
    of_theirs = mean[::step][which]  # (n, count - 1)
    near = (mean <= LONELY * usual) & (mean <= LONELIER * np.median(of_theirs, axis=1))
    near |= mean <= BESIDE * scales.max(1)
    return near, usual, float(np.median(away[:, 0])) / step ** (1 / 3)


def scatter(
    means: np.ndarray, axes: np.ndarray, scales: np.ndarray, cell_m: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """For each class of sizes: splats (n,), and their points (n, k, 3), at most a cell apart."""
    order = np.sort(scales.astype(np.float64), axis=1)
    wanted = 4 * np.pi * order[:, 2] * order[:, 1] / cell_m**2 + order[:, 2] * 4 / cell_m
    kind = np.searchsorted(CLASSES[:-1], wanted)
    found = []
    for number, count in enumerate(CLASSES):
        rows = np.flatnonzero(kind == number)
        if len(rows):
            ball = spread_directions(count) * radii(count)[:, None]
            found.append((rows, means[rows, None] + ball @ np.swapaxes(axes[rows], 1, 2)))
    return found


def radii(count: int) -> np.ndarray:
    """(count,) sigmas from the centre: two of three points on the outside, the rest within."""
    if count == 1:
        return np.zeros(1, np.float32)
    return np.where(np.arange(count) % 3 == 2, 0.5, 1.0).astype(np.float32)


def keep_dense(
    points: list[tuple[np.ndarray, np.ndarray]],
    opacity: np.ndarray,
    solid: np.ndarray,
    cell_m: float,
) -> tuple[np.ndarray, np.ndarray]:
    """(M, 3) the points of solid splats, and of faint ones in cells where they add up; and (M,)
    int32 the splat of each.
    """
    points = [(rows.astype(np.int32), at) for rows, at in points]
    found = [at[solid[rows]].reshape(-1, 3) for rows, at in points]
    of = [np.repeat(rows[solid[rows]], at.shape[1]) for rows, at in points]
    faint = [(rows[~solid[rows]], at[~solid[rows]]) for rows, at in points]
    del points
    splat = np.concatenate([np.repeat(rows, at.shape[1]) for rows, at in faint])
    if len(splat):
        places = np.concatenate([at.reshape(-1, 3) for _, at in faint])
        _, cell = np.unique(cells_of(places, cell_m)[0], return_inverse=True)
        once = np.unique(cell * (len(opacity) + 1) + splat)  # a splat counts once in a cell
        stopped = -np.log1p(-np.clip(opacity[once % (len(opacity) + 1)], 0, 0.99))
        total = np.bincount(once // (len(opacity) + 1), stopped, cell.max() + 1)
        enough = total[cell] >= -np.log1p(-OPAQUE)
        found.append(places[enough])
        of.append(splat[enough])
    return np.concatenate(found), np.concatenate(of)


def cells_of(points: np.ndarray, cell_m: float) -> tuple[np.ndarray, tuple[int, ...]]:
    """(M,) int64: the cell of each point (M, 3) in a grid around all, and the grid's shape."""
    axes = [((x - x.min()) / cell_m).astype(np.int32) for x in points.T]
    shape = tuple(int(axis.max()) + 1 for axis in axes)
    return np.asarray(np.ravel_multi_index(tuple(axes), shape)), shape


def without_needles(
    points: np.ndarray, splat: np.ndarray, means: np.ndarray, cell_m: float
) -> np.ndarray:
    """(m, 3) the points without ends of long splats that stand out where no other splat is.

    points (M, 3), the splat (M,) of each, means (N, 3) of splats: metres.
    """
    from scipy import ndimage

    if not len(points):
        return points
    cell, shape = cells_of(points, cell_m)
    lowest, highest = np.full(shape, len(means), np.int32), np.full(shape, -1, np.int32)
    np.minimum.at(lowest.reshape(-1), cell, splat)
    np.maximum.at(highest.reshape(-1), cell, splat)
    alone = ndimage.minimum_filter(lowest, 3) == ndimage.maximum_filter(highest, 3)
    lone = np.flatnonzero(alone.reshape(-1)[cell])  # few: who stands alone is also looked at
    far = np.linalg.norm(points[lone] - means[splat[lone]], axis=1) > NEEDLE * cell_m
    return np.delete(points, lone[far], axis=0)


def nothing_to_touch(splats: int) -> str:
    return (
        f"none of {splats:,} splats is opaque enough to be touched; name a mesh file as the "
        "object's collider, or choose another x."
    )
