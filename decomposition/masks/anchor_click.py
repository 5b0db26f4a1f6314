"""What a click on one anchor means: nested sets around it, the likeliest first, without a network.

On the graph of anchor_walk.py a random walk that starts at the click, and may end at every step
(personalised PageRank), stays where edges are strong; in the order of how often it comes by, every
prefix is a set, and the one that is cut off best is the thing (sweep cut: Andersen, Chung and Lang,
"Local graph partitioning using PageRank vectors", 2006).
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from shapeshift.decomposition.masks.anchor_walk import AnchorGraph, conjugate_gradients

RETURN = 1e-3  # of an anchor's edges: the chance that a walk ends there
# The cut of a set is told by its volume to this power.  By 1 (conductance) the largest set wins, by
# 0.5, as the border of a surface grows, the smallest; 0.6 was best of 0.3 to 1 on the demo.
BY_VOLUME = 0.6  # docs/bench/clicks.csv has what it gives
LEAST, MOST = 8, 0.3  # anchors, part of all that a walk may reach: what a click may mean
FEW, MOST_OF_FEW = 2000, 0.6  # of a small scene a thing may be more: so many anchors, that part
NEAR = 20_000  # anchors about the click that the walk may reach: it bounds its time
WALL = 1e6  # largest degrees: an anchor that is no part of it ends every walk
TOLERANCE, MOST_STEPS = 1e-3, 80


@dataclass(frozen=True)
class Growth:
    """Nested sets of nodes of a graph: the first n of `nodes`, for any n."""

    nodes: np.ndarray  # (n,) the likeliest first
    count: int  # of the set that is cut off best


def grow(
    graph: AnchorGraph, seeds: np.ndarray, against: np.ndarray, within: np.ndarray | None = None
) -> Growth:
    """Sets about the nodes `seeds` (s,), at least one, that hold none of the nodes `against` (r,).

    within: (N,) bool, the nodes that they may reach; None: any near by.
    """
    part = near_nodes(graph, seeds, within)
    row_of = np.full(len(graph.nodes.rows), -1)
    row_of[part] = np.arange(len(part))
    weights = graph.weights[part][:, part]
    degrees = graph.degrees[part]  # with the edges that leave the part
    walls = row_of[against][row_of[against] >= 0]
    held = degrees * (1 + RETURN)
    held[walls] += WALL * degrees.max(initial=1.0)
    start = np.zeros((len(part), 1))
    start[row_of[seeds]] = 1 / len(seeds)

    def multiply(x: np.ndarray) -> np.ndarray:
        return held[:, None] * x - weights @ x

    # Its solution is how often the walk comes by, over the degree: what a sweep goes by.
    visits = conjugate_gradients(
        multiply, held, start, np.zeros_like(start), TOLERANCE, MOST_STEPS
    )[:, 0]
    visits[walls] = -np.inf
    visits[row_of[seeds]] = np.inf
    order = np.argsort(-visits, kind="stable")[: np.count_nonzero(visits > -np.inf)]
    most = len(part)
    if within is None:
        most = max(int(MOST * most), min(FEW, int(MOST_OF_FEW * most)))
    return Growth(part[order], best_cut(weights, degrees, order, len(np.unique(seeds)), most))


def near_nodes(graph: AnchorGraph, seeds: np.ndarray, within: np.ndarray | None) -> np.ndarray:
    """(n,) the nodes that a walk from the seeds may reach: at most about NEAR, the nearest."""
    part = np.arange(len(graph.nodes.rows)) if within is None else np.flatnonzero(within)
    if len(part) > NEAR:
        means = graph.nodes.means
        far = np.linalg.norm(means[part] - means[seeds].mean(axis=0), axis=1)
        part = part[np.argpartition(far, NEAR)[:NEAR]]
    return np.union1d(part, seeds)


def best_cut(
    weights: sparse.csr_array, degrees: np.ndarray, order: np.ndarray, least: int, most: int
) -> int:
    """How many of the first nodes in `order` (n,) make the set whose border is the weakest.

    At least LEAST or `least` of them, and at most `most`.
    """
    count = len(order)
    rank = np.full(len(degrees), count)  # what may not be taken comes after all
    rank[order] = np.arange(count)
    edges = weights.tocoo()
    ends = np.stack([rank[edges.row], rank[edges.col]])
    # An edge, which is there both ways, is cut by the set of the first n where low < n <= high.
    low, high = (np.bincount(end, edges.data, count + 1) for end in (ends.min(0), ends.max(0)))
    leaving = degrees - np.asarray(weights.sum(axis=1)).ravel()  # out of the part that was walked
    cut = np.cumsum((low - high)[:count]) / 2 + np.cumsum(leaving[order])
    volume = np.cumsum(degrees[order])
    score = cut / np.maximum(volume, 1e-12) ** BY_VOLUME
    first = min(max(LEAST, least), count)
    last = min(max(first, most), count)
    return first + int(np.argmin(score[first - 1 : last])) if count else 0


def anchors_of(graph: AnchorGraph, nodes: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """(A,) bool: the anchors of some nodes, with those that show nothing and lie nearest to them.

    owner: (A,) as of `owners`.
    """
    inside = np.zeros(len(graph.nodes.rows) + 1, bool)  # the last: of a model that shows nothing
    inside[nodes] = True
    return inside[owner]


def owners(graph: AnchorGraph, anchors: np.ndarray) -> np.ndarray:
    """(A,) int: the node of each anchor (A, 3), of one that is not there the nearest; N of none."""
    from scipy.spatial import cKDTree

    count = len(graph.nodes.rows)
    owner = np.full(len(anchors), count)
    if count:
        owner[:] = cKDTree(graph.nodes.means).query(np.nan_to_num(anchors))[1]
        owner[graph.nodes.rows] = np.arange(count)
    return owner
