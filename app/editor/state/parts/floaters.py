"""Floaters: junk that training leaves in the air, proposed for deletion; nothing is removed here.

Two kinds, as captures show them: small groups of anchors apart from everything, and large faint
splats that hang off the surface.  What is connected with much else is the scene.
"""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from shapeshift.app.editor.state.parts.anchor_numbers import AnchorNumbers

NEIGHBOURS = 8  # of an anchor, among which connections are looked for
LINK = 3.0  # times the usual distance to the last of them: as far two anchors still touch
REACH = 2.0  # sigmas of both: large splats of a coarse surface touch over a longer way
GROUP = 0.002  # of all anchors: a group with fewer that touches no other is apart
LEAST_GROUP = 8  # anchors, however few there are in all
HUGE = 4.0  # times the usual size of those around it
FAINT = 0.4  # opacity below which a huge splat is a haze and no wall
OFF = 1.5  # times the usual distance to the last neighbour: as far off a haze hangs


def floaters(numbers: AnchorNumbers) -> np.ndarray:
    """(A,) bool: anchors that look like floaters.  About 10 s of a core for a million."""
    count = len(numbers.places)
    usable = np.isfinite(numbers.places).all(axis=1) & np.isfinite(numbers.size)
    out = np.zeros(count, bool)
    if np.count_nonzero(usable) <= NEIGHBOURS:
        return out
    rows = np.flatnonzero(usable)
    places = numbers.places[rows].astype(np.float64)
    size, opacity = numbers.size[rows], numbers.opacity[rows]
    away, near = cKDTree(places).query(places, NEIGHBOURS + 1)
    away, near = away[:, 1:], near[:, 1:]  # (n, NEIGHBOURS) metres, rows
    usual = float(np.median(away[:, -1]))
    around = np.median(size[near], axis=1)
    huge = (size > HUGE * np.maximum(around, np.median(size))) & (opacity < FAINT)
    group, largest = groups(away, near, np.where(huge, 0, size), LINK * usual, ~huge)
    apart = (largest[group] < max(GROUP * len(rows), LEAST_GROUP)) & ~huge
    surface = np.flatnonzero(~apart & ~huge)
    haze = np.zeros(len(rows), bool)
    if len(surface):
        hung = np.flatnonzero(huge)
        off = cKDTree(places[surface]).query(places[hung])[0]
        haze[hung[off > OFF * usual]] = True
    out[rows[apart | haze]] = True
    return out


def groups(
    away: np.ndarray, near: np.ndarray, size: np.ndarray, link: float, counts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) group of each anchor, and (groups,) how many of those that `counts` (n,) each has.

    away, near: (n, NEIGHBOURS) metres to the nearest others, and which these are.
    """
    reach = 2 * REACH * np.minimum(size[:, None], size[near])  # both must be large
    touches = (away <= np.maximum(link, reach)) & counts[:, None] & counts[near]
    start, which = np.nonzero(touches)
    end = near[start, which]
    edges = coo_matrix((np.ones(len(start), np.int8), (start, end)), shape=(len(away),) * 2)
    number, group = connected_components(edges, directed=False)
    return group, np.bincount(group[counts], minlength=number)
