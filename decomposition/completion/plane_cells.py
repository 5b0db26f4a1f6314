"""A grid of cells on a plane: what lies in each of them, and how it looks."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shapeshift.decomposition.completion.anchor_looks import AnchorLooks
from shapeshift.decomposition.completion.plane import Plane

CELL = 1.8  # spacings of anchors: the side of a cell
ON_PLANE = 1.4  # spacings above or below
BELOW, ABOVE = 5.0, 3.5  # spacings: what is dropped there was guessed, or is contact shadow
ROOM = 4  # empty cells around all
SHADOW = 0.78  # of the plane's usual brightness, below which a cell may be in shadow
NEAR_TOP = 0.5  # of the thing's height: its footprint is what is lower
SEEN = 0.25  # of a usual cell's evidence: what photos show of the plane stays as it is
LOW_THINGS = 25.0  # spacings above the plane: other things there keep their place free of sources


class Footprint(NamedTuple):
    hole: np.ndarray  # (X, Y) bool: cells that are filled anew
    shade: np.ndarray  # (X, Y) bool: those of them that photos show, in the thing's shadow
    good: np.ndarray  # (X, Y) bool: cells of the plane that may be copied
    ring: np.ndarray  # (X, Y) bool: cells around the hole whose look a patch has to go on


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
    good = covered & ~grow(there(low)) & ~hole & ~thin
    return Footprint(hole, hole & ~stands, good, ring)


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
