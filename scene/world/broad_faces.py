"""Hulls whose broad faces have four corners, so that things stand on them as wide as they are.

The engine takes the first four corners of a hull's face as where it may touch (parry,
`ConvexPolyhedron::local_support_feature`).  Of a box these are all; of a cup's round base they lie
on one side of it, so that the cup tips over, or rocks and walks for ever.  Here the four corners
of such a face that lie farthest apart stay and all others are drawn in a little: what is left of
the face is broad, and touches with all of its corners.
"""

import numpy as np

MOST_CORNERS = 4  # of a face that the engine takes whole
SAME_FACE = 1 - np.sqrt(np.finfo(np.float32).eps)  # cosine, 1.5 degrees: flatter ones are joined
SLOPE = np.tan(np.deg2rad(2.5))  # of what is drawn in: the engine does not join it to the face
BROAD = 0.03  # of the hull's surface; nothing stands on a smaller face


def with_firm_faces(points: np.ndarray) -> np.ndarray:
    """The corners (V, 3) of a hull, those of its broad faces beyond four drawn in by some 1 %.

    Nothing moves where each of its broad faces has at most MOST_CORNERS corners.
    """
    from scipy.spatial import ConvexHull

    points = points.astype(np.float64)
    points = points[np.sort(ConvexHull(points).vertices)]  # what lies in a face would stand out
    for rows, normal in broad_faces(points):
        points[rows] = drawn_in(points[rows], normal)
    return points.astype(np.float32)


def broad_faces(points: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """(rows of its points, unit normal (3,)) of each broad face with too many corners."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    corners = points[hull.simplices]  # (F, 3, 3)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(across, axis=1) / 2  # (F,)
    face = faces_of(hull)  # (F,)
    total = np.bincount(face, areas)
    found = []
    for number in np.argsort(-total, kind="stable"):
        triangles = np.flatnonzero(face == number)
        many = corner_count(hull.simplices[triangles]) > MOST_CORNERS
        if many and total[number] >= BROAD * total.sum():
            normal = areas[triangles] @ hull.equations[triangles, :3]
            rows = np.unique(hull.simplices[triangles])
            found.append((rows, normal / np.linalg.norm(normal)))
    return found


def faces_of(hull) -> np.ndarray:
    """(F,) the face that each triangle of a scipy hull belongs to, joined as the engine joins."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    a = np.repeat(np.arange(len(hull.simplices)), 3)
    b = hull.neighbors.reshape(-1)
    normals = hull.equations[:, :3]
    flat = np.einsum("ni,ni->n", normals[a], normals[b]) > SAME_FACE
    graph = coo_array((np.ones(flat.sum(), bool), (a[flat], b[flat])), (len(normals),) * 2)
    return connected_components(graph, directed=False)[1]


def corner_count(triangles: np.ndarray) -> int:
    """How many vertices lie on edges that only one of the triangles (n, 3) has."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    known, count = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    return len(np.unique(known[count == 1]))


def drawn_in(rim: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """The points (n, 3) of a face, all but four behind a plane that slopes away from those."""
    four = four_far_apart(rim, normal)  # around the face
    kept = np.isin(np.arange(len(rim)), four)
    height = rim @ normal
    beyond = np.zeros(len(rim))  # metres outside of the four
    for a, b in zip(rim[four], rim[np.roll(four, -1)], strict=True):
        outward = np.cross(b - a, normal)
        outward /= max(np.linalg.norm(outward), 1e-12)
        beyond = np.maximum(beyond, (rim - a) @ outward)
    most = height[four].min() - SLOPE * beyond
    down = np.where(kept, 0.0, np.minimum(most - height, 0.0))
    return rim + down[:, None] * normal


def four_far_apart(rim: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(4,) rows of the corners (n, 3) of a face: one far out, the farthest from it, one on each
    side of the line between; anticlockwise as seen against the normal (3,).
    """
    first = np.linalg.norm(rim - rim.mean(0), axis=1).argmax()
    second = np.linalg.norm(rim - rim[first], axis=1).argmax()
    side = (rim - rim[first]) @ np.cross(normal, rim[second] - rim[first])
    return np.array([first, side.argmin(), second, side.argmax()])
