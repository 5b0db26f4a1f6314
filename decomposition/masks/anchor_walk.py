"""From a few anchors whose object is known to all others, without a network: a walk over the scene.

Nodes are the anchors that are there (of plain splats the splats themselves).  An edge to each of
the nearest is strong where colours of all stops agree, heat among them, and weak across a concave
crease, where one thing stands on another.  Made once a scene (0.4 s for 18,000 anchors); a walk
then takes less than a tenth of a second.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from shapeshift.runtime_models.evaluate import Evaluator, follows_eye
from shapeshift.runtime_models.model import Model, SplatLayers

UNKNOWN = -1
LEAST_OPACITY = 0.1  # of an anchor's splats together: less is not there
NEAR = 10  # neighbours of an anchor
FLAT = 16  # neighbours whose plane an anchor's surface is taken to be
COLOR = 8.0  # squared differences, in means of them, of which an edge is e times weaker
CREASE, BEND = 4.0, 1.0  # how much a concave edge, and any bend, weakens
LEAST_WEIGHT = 1e-5
TOLERANCE, MOST_STEPS = 1e-4, 300
LEAST_PIXELS = 1.0  # that an anchor shows, to be a seed
INSIDE_SHARE, OUTSIDE_SHARE = 0.85, 0.1  # of its pixels in the mask


@dataclass(frozen=True)
class Nodes:
    """The anchors of a model that are there."""

    count: int  # A: anchors of the model, or splats of plain layers
    rows: np.ndarray  # (N,) int: which of them
    means: np.ndarray  # (N, 3) float64 metres, the middle of what an anchor shows
    colors: np.ndarray  # (N, F) 0..1, of all stops


@dataclass(frozen=True)
class AnchorGraph:
    """Edges between the anchors of a model; `walk` is safe to call from any thread."""

    nodes: Nodes
    weights: sparse.csr_array  # (N, N) symmetric, 0..1
    degrees: np.ndarray  # (N,) sums of its rows

    def walk(self, seeds: np.ndarray, labels: int = 2) -> np.ndarray:
        """(A,) uint8: the label of every anchor; 0 where it is not there, or joined to no seed.

        seeds: (A,) ints below `labels`, UNKNOWN where nothing is known.
        """
        out = np.zeros(self.nodes.count, np.uint8)
        out[self.nodes.rows] = self.shares(seeds, labels).argmax(1)
        return out

    def shares(self, seeds: np.ndarray, labels: int = 2) -> np.ndarray:
        """(N, labels) of the nodes: the chance that a walk meets a seed of each label first."""
        here = np.asarray(seeds)[self.nodes.rows]
        free = here < 0
        known = np.zeros((len(here), labels))
        known[~free, here[~free]] = 1
        solved = [k for k in range(1, labels) if known[:, k].any()]
        if free.any() and solved:
            found = self._solve(known[:, solved], free)
            known[np.ix_(np.flatnonzero(free), np.array(solved))] = np.clip(found[free], 0, 1)
        if known[:, 0].any():  # the shares of all labels add up to 1
            known[free, 0] = np.clip(1 - known[free].sum(1), 0, 1)
        return known

    def _solve(self, known: np.ndarray, free: np.ndarray) -> np.ndarray:
        """(N, k) shares of the labels whose seeds `known` (N, k) holds."""
        mask, degrees = free[:, None], np.where(free, self.degrees, 1.0)

        def multiply(x: np.ndarray) -> np.ndarray:
            return np.where(mask, degrees[:, None] * x - self.weights @ x, x)

        right = np.where(mask, self.weights @ known, 0.0)
        return conjugate_gradients(
            multiply, degrees, right, np.zeros_like(right), TOLERANCE, MOST_STEPS
        )


def nodes_of(model: Model, eye: np.ndarray) -> Nodes:
    """What the model shows at its stops, seen from `eye` (3,) metres in the object's frame.

    A place is where the anchor is at the first stop at which it is there.
    """
    evaluator = Evaluator(model)
    k = 1 if isinstance(model, SplatLayers) else model.splats_per_anchor
    count = model.splat_count // k
    there = np.zeros(count, bool)
    means = np.zeros((count, 3))
    first = np.zeros((count, 3))  # colours at the first stop
    columns = []
    for stop in model.stops:
        at, _, _, opacity = evaluator.geometry(stop.x, eye=eye if follows_eye(model) else None)
        weight = np.maximum(opacity.reshape(count, k), 0).astype(np.float64)
        shown = weight.sum(1) > LEAST_OPACITY
        share = weight / np.maximum(weight.sum(1, keepdims=True), 1e-9)
        new = shown & ~there
        places = np.einsum("ak,akc->ac", share, at.reshape(count, k, 3))
        color = np.einsum("ak,akc->ac", share, evaluator.color(stop.x, eye).reshape(count, k, 3))
        means[new], first[new] = places[new], color[new]
        there |= shown
        # What is not there at this stop does not differ from its neighbours by it.
        color = np.where(shown[:, None], np.clip(color, 0, 1), np.clip(first, 0, 1))
        columns.append(color.mean(1, keepdims=True) if stop.is_measured else color)
    rows = np.flatnonzero(there & np.isfinite(means).all(1))
    return Nodes(count, rows, means[rows], np.concatenate(columns, axis=1)[rows])


def make_graph(nodes: Nodes, eyes: np.ndarray) -> AnchorGraph:
    """eyes: (E, 3) metres, where the scene was seen from: surfaces face the nearest of them."""
    count = len(nodes.rows)
    if count < 2:
        return AnchorGraph(nodes, sparse.csr_array((count, count)), np.full(count, LEAST_WEIGHT))
    normals = normals_of(nodes.means, eyes)
    near = min(NEAR, count - 1)
    distance, at = cKDTree(nodes.means).query(nodes.means, near + 1)
    i, j = np.repeat(np.arange(count), near), at[:, 1:].ravel()
    delta = nodes.means[j] - nodes.means[i]
    length = np.sqrt(np.einsum("ec,ec->e", delta, delta))
    usual = np.median(distance[:, 1:], axis=1)
    usual = np.maximum(np.maximum(usual[i], usual[j]), 1e-9)
    apart = np.abs(nodes.colors[i] - nodes.colors[j])
    apart = ((apart / np.maximum(apart.mean(0), 1e-4)) ** 2).mean(1)
    along = delta / np.maximum(length, 1e-12)[:, None]
    # Concave where the two surfaces face each other: the difference of normals along the edge.
    concave = np.maximum(np.einsum("ec,ec->e", normals[i] - normals[j], along), 0)
    bend = 1 - np.abs(np.einsum("ec,ec->e", normals[i], normals[j]))
    weight = np.exp(-((length / usual) ** 2) - apart / COLOR - CREASE * concave - BEND * bend)
    one_way = sparse.csr_array((weight + LEAST_WEIGHT, (i, j)), shape=(count, count))
    weights = sparse.csr_array(one_way.maximum(one_way.T))
    return AnchorGraph(nodes, weights, np.asarray(weights.sum(axis=1)).ravel())


def normals_of(means: np.ndarray, eyes: np.ndarray) -> np.ndarray:
    """(N, 3) unit: the direction in which the nearest of each place spread least, to the eye."""
    near = min(FLAT, len(means))
    _, at = cKDTree(means).query(means, near)
    apart = means[at.reshape(len(means), near)]
    apart = apart - apart.mean(1, keepdims=True)
    _, axes = np.linalg.eigh(np.einsum("nka,nkb->nab", apart, apart))
    normals = axes[:, :, 0]  # of the least eigenvalue
    eyes = np.reshape(eyes, (-1, 3))
    towards = eyes[cKDTree(eyes).query(means)[1]] - means
    facing = np.einsum("nc,nc->n", towards, normals)
    return np.where(facing[:, None] < 0, -normals, normals)


def seeds_of_evidence(inside: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """(A,) seeds, 1 the object, 0 not it: anchors of which a mask shows one side clearly.

    inside, outside: (A,) pixels that they show in the mask and out of it.
    """
    total = inside + outside
    seeds = np.full(len(total), UNKNOWN)
    enough = total > LEAST_PIXELS
    seeds[enough & (inside < OUTSIDE_SHARE * total)] = 0
    seeds[enough & (inside > INSIDE_SHARE * total)] = 1
    return seeds


# Grady's random walker: from places whose label is known to all others, along strong edges.
#
# The share of a label at a node is the chance that a walk from there first meets a seed of that
# label; it solves L x = 0 with the seeds fixed, L the graph's Laplacian (Grady 2006, equation 11).

TINY = 1e-300


def conjugate_gradients(
    multiply: Callable[[np.ndarray], np.ndarray],
    diagonal: np.ndarray,
    right: np.ndarray,
    guess: np.ndarray,
    tolerance: float,
    most: int,
) -> np.ndarray:
    """x (n, k) of A x = right (n, k) for a symmetric positive definite A, column by column.

    multiply: A times (n, k); diagonal (n,) of A, its preconditioner.  Ends at residuals of
    `tolerance` times the right-hand sides, or after `most` steps.
    Its sums are numpy's own loops: scipy's solver calls BLAS, whose threads take 20 times the
    processor time on a busy machine, and whose bits depend on their number.
    """
    x = guess.copy()
    residual = right - multiply(x)
    enough = np.maximum(tolerance**2 * dots(right, right), TINY)
    step = residual / diagonal[:, None]
    slope = dots(residual, step)
    for _ in range(most):
        if (dots(residual, residual) <= enough).all():
            break
        moved = multiply(step)
        length = slope / np.maximum(dots(step, moved), TINY)
        x += length * step
        residual -= length * moved
        scaled = residual / diagonal[:, None]
        before, slope = slope, dots(residual, scaled)
        step = scaled + slope / np.maximum(before, TINY) * step
    return x


def dots(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(k,) of columns (n, k)."""
    return np.einsum("nk,nk->k", a, b)
