"""A package with fewer anchors for the same networks: those of a cell of a grid become one.

What an anchor counts for is what it shows: the area of its splats times their opacity, over all
stops.  The one that stands for a cell reaches as far as its splats lay together, by a frame of its
own, so that the networks stay as they are.
"""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import MOST_LABEL, AnchorFrames, AnchorModel
from shapeshift.runtime_models.rotation import normalize

LEAST_SHOWN = 1e-6  # of the mean: an anchor that shows nothing still has a place
MOST_CELLS = 2.0**62  # numbers of cells are int64
EDGES = (1e-4, 2.0)  # of the longest side: of the smallest cells and of one for all
HALVINGS = 14  # of that range's logarithm: to a thousandth
MOST_GROWTH = 8.0  # of an anchor's sizes; beyond it the networks' scales are clipped anyway


def average_anchors(model: AnchorModel, cell: float) -> AnchorModel:
    """The anchors of each cell, cubes with an edge of `cell` metres, as one; those of different
    objects stay apart.  Cells in the order of the first anchor in them.
    """
    group, count = cells_of(model, cell)
    shown, spread = anchor_looks(model)

    def mean(rows: np.ndarray) -> np.ndarray:
        """(count, n) float64 of (A, n), weighed by what each shows."""
        columns = rows.reshape(len(rows), -1).T.astype(np.float64)
        sums = [np.bincount(group, shown * column, count) for column in columns]
        return np.stack(sums, 1) / weight[:, None]

    weight = np.bincount(group, shown, count)
    places = mean(model.anchors)
    first = np.full(count, len(group))
    np.minimum.at(first, group, np.arange(len(group)))
    frames = frames_of(model)
    # The same side of each quaternion as the one that shows most, or two alike cancel out.
    leading = np.zeros(count, np.int64)
    order = np.argsort(shown, kind="stable")
    leading[group[order]] = order
    side = np.einsum("ac,ac->a", frames.wxyz, frames.wxyz[leading[group]])
    turns = normalize(mean(frames.wxyz * np.where(side < 0, -1, 1)[:, None]))
    sizes = np.exp(mean(np.log(frames.scales)))
    away = model.anchors - places[group]
    own = mean(spread[:, None])[:, 0]
    together = own + mean(np.einsum("ac,ac->a", away, away)[:, None])[:, 0]
    growth = np.sqrt(together / np.maximum(own, 1e-30))
    sizes *= np.clip(growth, 1, MOST_GROWTH)[:, None]
    return replace(
        model,
        anchors=places.astype(np.float32),
        features=mean(model.features).astype(np.float32),
        frames=AnchorFrames(sizes.astype(np.float32), turns.astype(np.float32)),
        labels=None if model.labels is None else model.labels[first],
        light=None if model.light is None else mean(model.light).astype(np.float32),
    )


def cells_of(model: AnchorModel, cell: float) -> tuple[np.ndarray, int]:
    """(A,) the cell that each anchor lies in, and how many cells there are."""
    _, first, group = np.unique(cell_keys(model, cell), return_index=True, return_inverse=True)
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first, kind="stable")] = np.arange(len(first))
    return rank[group.ravel()], len(first)


def cell_keys(model: AnchorModel, cell: float) -> np.ndarray:
    """(A,) a number of the cell of each anchor, labels apart.  Raises ValueError."""
    places = model.anchors.astype(np.float64)
    across = np.ptp(places, axis=0) / cell if cell > 0 else np.full(3, np.inf)
    sides = np.append(np.floor(across) + 2, MOST_LABEL + 1)
    if not np.prod(sides) < MOST_CELLS:
        raise ValueError(f"cells of {cell} m; a longer edge is wanted for anchors so far apart.")
    keys = np.floor((places - places.min(axis=0)) / cell)
    labels = np.zeros(len(places)) if model.labels is None else model.labels
    every = (*keys.T.astype(np.int64), labels.astype(np.int64))
    return np.ravel_multi_index(every, tuple(sides.astype(np.int64)))


def cell_for(model: AnchorModel, share: float) -> float:
    """Metres: the edge of the cells that leave about so much of the anchors, 0 to 1; at least 1."""
    low, high = EDGES[0], EDGES[1]  # of the longest side
    longest = max(float(np.ptp(model.anchors.astype(np.float64), axis=0).max()), 1e-30)
    for _ in range(HALVINGS):
        middle = (low * high) ** 0.5
        found = len(np.unique(cell_keys(model, middle * longest)))
        low, high = (middle, high) if found > share * len(model.anchors) else (low, middle)
    return high * longest


def frames_of(model: AnchorModel) -> AnchorFrames:
    """Its anchors' frames; the object's axes and size 1 where they have none."""
    if model.frames is not None:
        return model.frames
    count = len(model.anchors)
    axes = np.zeros((count, 4), np.float32)
    axes[:, 0] = 1
    return AnchorFrames(np.ones((count, 3), np.float32), axes)


def anchor_looks(model: AnchorModel) -> tuple[np.ndarray, np.ndarray]:
    """(A,) what each anchor shows, m^2 in the mean of the stops, above 0; (A,) the mean square of
    how far its splats reach about it, m^2, weighed by what they show.
    """
    evaluator, count = Evaluator(model), len(model.anchors)
    stops = [stop.x for stop in model.stops] or [0.0]
    shown, moment = np.zeros(count), np.zeros(count)
    for x in stops:
        means, scales, _, opacity = evaluator.geometry(x, unit=False)
        size = np.sort(scales.astype(np.float64), axis=1)
        area = np.maximum(opacity, 0) * size[:, 1] * size[:, 2]  # of its broad side
        away = (means.reshape(count, -1, 3) - model.anchors[:, None]).reshape(-1, 3)
        square = np.einsum("nc,nc->n", away, away) + np.einsum("nc,nc->n", size, size)
        shown += area.reshape(count, -1).sum(axis=1)
        moment += (area * square).reshape(count, -1).sum(axis=1)
    spread = moment / np.maximum(shown, 1e-30)
    shown = shown / len(stops)
    return shown + LEAST_SHOWN * max(float(shown.mean()), 1e-30), spread
