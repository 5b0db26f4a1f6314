"""A grid of cells on a plane: what lies in each of them, and how it looks."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import AnchorModel
from shapeshift.scene.cameras.upright import plane_of_most
from shapeshift.scene.colliders.standing import Plane
from shapeshift.scene.pose import View

# Where anchors are and how they look at every stop: what completion compares.

LEAST_OPACITY = 0.1  # of all splats of an anchor together, to be there at all


@dataclass(frozen=True)
class AnchorLooks:
    places: np.ndarray  # (A, 3) float64 metres: mean of the splats by opacity, where it is first
    there: np.ndarray  # (A,) bool: seen at one stop at least
    colors: np.ndarray  # (A, stops * 3) display sRGB, mean of the splats by opacity
    spacing_m: float  # from an anchor to the next one, median


def looks_of(model: AnchorModel) -> AnchorLooks:
    """Of every anchor, seen from in front of the model and above."""
    from scipy.spatial import cKDTree

    evaluator, count = Evaluator(model), model.splats_per_anchor
    low, high = np.percentile(model.anchors, (1, 99), axis=0)
    eye = (low + high) / 2 + np.array([0.0, 0.5, 1.5]) * (high - low).max()
    places = model.anchors.astype(np.float64)
    there = np.zeros(len(places), bool)
    colors: list[np.ndarray] = []
    for stop in reversed(model.stops):  # the first one decides where an anchor is
        splats = evaluator.geometry(stop.x)
        color = evaluator.color(stop.x, eye.astype(np.float32)).reshape(-1, count, 3)
        opacity = np.maximum(splats[3].reshape(-1, count), 0).astype(np.float64)
        total = opacity.sum(1)
        share = opacity / np.maximum(total, 1e-9)[:, None]
        here = total > LEAST_OPACITY
        means = np.einsum("ak,aki->ai", share, splats[0].reshape(-1, count, 3))
        places[here] = means[here]
        there |= here
        colors.insert(0, np.einsum("ak,aki->ai", share, color))
    seen = places[there]
    away = cKDTree(seen).query(seen, min(2, len(seen)))[0] if len(seen) > 1 else np.zeros((1, 2))
    return AnchorLooks(places, there, np.concatenate(colors, 1), float(np.median(away[:, -1])))


# The plane that a thing stood on, found among the anchors around it (RANSAC).

WITHIN = 0.7  # spacings of anchors: as near to the plane is on it while it is looked for
REACH = 2.5  # sizes of the thing around it in which the plane is looked for
LEAST_ANCHORS, LEAST_SHARE = 40, 0.2  # of the anchors around, that lie on it
FARTHEST = 5.0  # spacings between the plane and the thing's lowest anchors
LOWEST = 2.0  # percent of its anchors that may lie lower than what counts as its lowest
Refused = str  # one sentence without the thing's name


def fit_plane(points: np.ndarray, within: float, seed: int = 0) -> tuple[Plane, np.ndarray] | None:
    """The plane of most points (N, 3) metres, and which of them lie on it (N,); None of a few."""
    found = plane_of_most(points, within, seed)
    if found is None:
        return None
    plane = Plane(*found)
    return plane, np.abs(plane.height(points)) < within


def support_plane(looks: AnchorLooks, labels: np.ndarray, label: int) -> Plane | Refused:
    """The plane under a thing: of background (label 0) around it, the normal on its side.

    labels (A,).  A text says why there is none.
    """
    mine = looks.there & (labels == label)
    ground = looks.there & (labels == 0)
    if mine.sum() < 3:
        return "nothing of it can be seen"
    low, high = np.percentile(looks.places[mine], (1, 99), axis=0)
    size = np.linalg.norm(high - low)
    near = np.linalg.norm(looks.places[ground] - (low + high) / 2, axis=1) < REACH * size
    around = looks.places[ground][near]
    found = fit_plane(around, WITHIN * looks.spacing_m)
    if found is None or found[1].sum() < max(LEAST_ANCHORS, LEAST_SHARE * len(around)):
        return "nothing flat is around it"
    plane = found[0]
    height = plane.height(looks.places[mine])
    if np.median(height) < 0:
        plane = Plane(-plane.normal, -plane.offset)
        height = -height
    lowest = float(np.percentile(height, LOWEST))
    if lowest > FARTHEST * looks.spacing_m:
        return f"it stands on no plane: the next one lies {1e3 * lowest:.0f} mm under it"
    return plane


UNSEEN = 0.25  # of what the median anchor of background shows: less leaks in at an outline


def hidden_inside(
    looks: AnchorLooks, labels: np.ndarray, label: int, evidence: np.ndarray, plane: Plane | None
) -> np.ndarray:
    """(A,) bool: background in a thing's own volume, above what carries it, hardly shown by photos.

    What training put there to be covered: a ghost of the thing once that is taken away.
    evidence (A,): pixels of background that each anchor shows.
    """
    from scipy.spatial import ConvexHull, QhullError

    found = np.zeros(len(labels), bool)
    mine = looks.places[looks.there & (labels == label)]
    shown = evidence[(labels == 0) & (evidence > 0)]
    may = (labels == 0) & (evidence < UNSEEN * (np.median(shown) if len(shown) else 0.0))
    if plane is not None:
        may &= plane.height(looks.places) > ON_PLANE * looks.spacing_m
    if len(mine) < 4 or not may.any():
        return found
    low, high = np.percentile(mine, (LOWEST, 100 - LOWEST), axis=0)  # without stray ones
    mine = mine[((mine >= low) & (mine <= high)).all(1)]
    try:
        equations = ConvexHull(mine).equations  # (F, 4) outward normals
    except (QhullError, ValueError):
        return found
    rows = np.flatnonzero(may & ((looks.places >= low) & (looks.places <= high)).all(1))
    inside = (looks.places[rows] @ equations[:, :3].T + equations[:, 3] <= 0).all(1)
    found[rows[inside]] = True
    return found


CELL = 1.8  # spacings of anchors: the side of a cell
ON_PLANE = 1.4  # spacings above or below
BELOW, ABOVE = 5.0, 3.5  # spacings: what is dropped there was guessed, or is contact shadow
ROOM = 4  # empty cells around all
SHADOW = 0.78  # of the plane's usual brightness, below which a cell may be in shadow
IN_SHADOW = 6  # cells from a thing: what is dark there is copied last: it may be shadow
NEAR_TOP = 0.5  # of the thing's height: its footprint is what is lower
SEEN = 0.25  # of a usual cell's evidence: what photos show of the plane stays as it is
LOW_THINGS = 25.0  # spacings above the plane: other things there keep their place free of sources


class Footprint(NamedTuple):
    hole: np.ndarray  # (X, Y) bool: cells that are filled anew
    shade: np.ndarray  # (X, Y) bool: those of them that photos show, in the thing's shadow
    good: np.ndarray  # (X, Y) bool: cells of the plane that may be copied
    ring: np.ndarray  # (X, Y) bool: cells around the hole whose look a patch has to go on
    dark: np.ndarray  # (X, Y) bool: those of `good` that may lie in a thing's shadow


@dataclass(frozen=True)
class PlaneCells:
    plane: Plane
    low: np.ndarray  # (2,) metres along the plane's axes
    cell_m: float
    cells: np.ndarray  # (A, 2) int32: the cell above or below which each anchor lies
    height: np.ndarray  # (A,) metres above the plane
    on: np.ndarray  # (A,) bool: background that lies on it
    count: np.ndarray  # (X, Y) of anchors on it
    colors: np.ndarray  # (X, Y, C) their mean

    @property
    def shape(self) -> tuple[int, ...]:
        return self.count.shape

    def rows_in(self, chosen: np.ndarray) -> np.ndarray:
        """(A,) bool: anchors above or below the chosen cells (X, Y)."""
        return chosen[self.cells[:, 0], self.cells[:, 1]]


def cells_of(looks: AnchorLooks, labels: np.ndarray, plane: Plane, label: int) -> PlaneCells:
    """The plane's cells, as far as it and the thing reach."""
    height = plane.height(looks.places)
    on = looks.there & (labels == 0) & (np.abs(height) < ON_PLANE * looks.spacing_m)
    flat = looks.places @ plane.axes().T  # (A, 2)
    cell_m = CELL * looks.spacing_m
    reach = flat[on | (looks.there & (labels == label))]
    low = reach.min(0) - ROOM * cell_m
    shape = np.ceil((reach.max(0) + ROOM * cell_m - low) / cell_m).astype(int)
    cells = np.clip(((flat - low) / cell_m).astype(np.int32), 0, shape - 1)
    at = tuple(cells[on].T)
    count, colors = np.zeros(shape), np.zeros((*shape, looks.colors.shape[1]))
    np.add.at(count, at, 1)
    np.add.at(colors, at, looks.colors[on])
    colors /= np.maximum(count, 1)[..., None]
    return PlaneCells(plane, low, cell_m, cells, height, on, count, colors)


def footprint_of(
    looks: AnchorLooks,
    labels: np.ndarray,
    label: int,
    grid: PlaneCells,
    evidence: np.ndarray | None,
    shadows: bool,
    core: bool,
) -> Footprint:
    """What is made anew under a thing: where it stood and, around that, what no photo shows.

    evidence (A,): pixels of background that each anchor shows; None: nothing is known.  core: all
    of where it stood; else the part that no photo shows.  shadows: the cells in its shadow, too.
    """
    from scipy import ndimage

    def there(rows: np.ndarray) -> np.ndarray:
        out = np.zeros(grid.shape, bool)
        out[tuple(grid.cells[rows].T)] = True
        return out

    grow = ndimage.binary_dilation
    mine = looks.there & (labels == label)
    top = NEAR_TOP * np.percentile(grid.height[mine], 95) + BELOW * looks.spacing_m
    foot = there(mine & (grid.height < top))
    covered = ndimage.binary_closing(grid.count > 0)
    stood = ndimage.binary_fill_holes(ndimage.binary_closing(foot, iterations=2))
    inside = ndimage.binary_fill_holes(covered | stood)  # never beyond the edge of the plane
    hole = grow(stood) & inside
    if evidence is not None:
        hole &= ~seen_cells(grid, evidence, covered & ~hole) | (core & stood)
    stands = hole
    if shadows:
        hole = with_shadow(hole, covered, inside, grid)
    outer = grow(hole, iterations=1 if shadows else 4)  # beyond the contact shadow
    ring = grow(outer, iterations=3) & ~outer & (grid.count > 0)
    low = looks.there & (labels != 0) & (grid.height < LOW_THINGS * looks.spacing_m)
    usual = np.median(grid.count[grid.count > 0]) if grid.on.any() else 0.0
    thin = ndimage.uniform_filter(grid.count, 3) < 0.35 * usual
    light = grid.colors[..., :3].sum(2)
    dark = light < SHADOW * np.median(light[grid.count > 0]) if grid.on.any() else covered
    shaded = dark & grow(there(low) | hole, iterations=IN_SHADOW)
    good = covered & ~grow(there(low)) & ~hole & ~thin
    return Footprint(hole, hole & ~stands, good, ring, good & shaded)


def seen_cells(grid: PlaneCells, evidence: np.ndarray, usual: np.ndarray) -> np.ndarray:
    """(X, Y) bool: cells that photos show about as well as the usual ones."""
    shown = np.zeros(grid.shape)
    np.add.at(shown, tuple(grid.cells[grid.on].T), evidence[grid.on])
    return shown > SEEN * np.median(shown[usual]) if usual.any() else np.zeros(grid.shape, bool)


def with_shadow(
    hole: np.ndarray, covered: np.ndarray, inside: np.ndarray, grid: PlaneCells
) -> np.ndarray:
    """The hole and the dark cells that hang together with it, at most as far away as it is wide."""
    from scipy import ndimage

    light = grid.colors[..., :3].sum(2)
    usual = np.median(light[(grid.count > 0) & ~hole])
    dark = covered & (grid.count > 0) & (light < SHADOW * usual)
    away = ndimage.distance_transform_edt(~hole)
    near = away < np.sqrt(hole.sum()) * 1.5
    may = hole | ((dark | (away <= 2)) & near)
    cast = ndimage.binary_propagation(hole, mask=may)
    return ndimage.binary_dilation(cast) & inside


FARTHEST = 4.0  # sides of a cell


class Cells(NamedTuple):
    """Squares on a plane."""

    middles: np.ndarray  # (n, 3) metres
    side_m: float
    normal: np.ndarray  # (3,) unit, of the plane
    around: np.ndarray = np.zeros((0, 3))  # (m, 3) metres: free ones around them


def away_of(view: View, metres: np.ndarray, cells: Cells) -> np.ndarray:
    """(H, W) sides of a cell from the cells' plane to what is seen at depths (H, W), Inf: nothing.

    FARTHEST at most, 0 where nothing is seen.
    """
    eye_from_world, fx, fy, cx, cy = view.pinhole()
    way = eye_from_world[:3, :3] @ cells.normal  # in the camera's axes
    height, width = metres.shape
    along = (
        way[0] * ((np.arange(width) + 0.5 - cx) / fx)
        + way[1] * ((np.arange(height) + 0.5 - cy) / fy)[:, None]
        + way[2]
    )
    offset = float((cells.middles @ cells.normal).mean()) + float(way @ eye_from_world[:3, 3])
    seen = np.isfinite(metres)
    away = np.abs(np.where(seen, metres, 0) * along - offset) / cells.side_m
    return np.where(seen, np.minimum(away, FARTHEST), 0.0)


def shown_cells(view: View, middles: np.ndarray, reach_m: float) -> np.ndarray:
    """(H, W) bool: pixels nearer than that to one of the cells' middles (n, 3) metres."""
    from PIL import Image, ImageDraw

    eye_from_world, fx, fy, cx, cy = view.pinhole()
    at = np.c_[middles, np.ones(len(middles))] @ eye_from_world.T
    picture = Image.new("1", view.size)
    pen = ImageDraw.Draw(picture)
    for x, y, z in at[at[:, 2] > view.near, :3]:
        u, v, far = fx * x / z + cx, fy * y / z + cy, reach_m * max(fx, fy) / z
        pen.ellipse((u - far, v - far, u + far, v + far), fill=1)
    return np.array(picture)
