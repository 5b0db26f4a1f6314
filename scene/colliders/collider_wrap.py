"""A closed skin around points: filled where nothing gets in from outside, simplified, tight.

Points become cells of a grid; gaps of a few cells are closed; what cannot be reached from outside
is solid; the surface runs most of a cell outside of that, is simplified there and only then moved
back (simplified after it, thin parts break).  Meshes are not smoothed: that costs a fifth of the
accuracy.
"""

from collections.abc import Callable

import numpy as np

from shapeshift.scene.colliders.marching_tetrahedra import find_surface
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh, separate

CELLS = 128  # along the longest side
GAP = 2  # cells on either side of a gap that is closed
WIDE_GAP = 6  # the same, tried where the skin would else be a shell
ROOM = WIDE_GAP + 3  # empty cells around everything
OFFSET = 0.9  # cells that the surface runs outside of the points before it is moved back
FAR = 4.0  # cells; no distance beyond is needed, and to look for them takes minutes
LEAST_HALF = 0.35  # cells that half of a thin part keeps
LEAST_PART = 0.01  # of the cells of the largest piece; a smaller piece is a floater
LEAST_ROOM = 4000  # cells of a room inside of a hollow object; what is smaller is filled
LEAKS = 2.0  # times the solid cells that closing more must give for the skin to have leaked
MOST_POINTS = 400_000  # that distances are measured to
MOST_OVER = 1.1  # times the faces wanted that a simplified mesh may have
CRUMB = 1e-3  # of the largest part's volume
UNIT = 0.2  # the size that a mesh is given to be simplified: the package's tolerances have units
SLOW = (3, 5, 7)  # how slowly edges merge; the package's own 7 harms thin parts and comes last
Progress = Callable[[str, float], None]


def wrap(
    points: np.ndarray, cell_m: float, faces: int, progress: Progress, hollow: bool = False
) -> TriangleMesh:
    """A watertight mesh of about `faces` faces around points (M, 3) metres, M > 0.

    hollow: what they enclose stays free, as the inside of a room; else it is solid.
    """
    progress("wrapping the splats", 0.2)
    low = points.min(0) - (ROOM + 0.5) * cell_m
    solid, points = fill(points, low, cell_m, hollow)
    progress("wrapping the splats", 0.4)
    field = distance_field(solid, points, low, cell_m, hollow)
    progress("wrapping the splats", 0.6)
    skin = find_surface(field)
    vertices = (skin.vertices + np.float32(0.5)) * np.float32(cell_m)  # from low: short numbers
    coarse = simplify(TriangleMesh(vertices, skin.faces), faces)
    progress("wrapping the splats", 0.9)
    tight = draw_in(coarse, field < 0, cell_m)
    return TriangleMesh((tight.vertices + low).astype(np.float32), tight.faces)


def fill(
    points: np.ndarray, low: np.ndarray, cell_m: float, hollow: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Solid cells (X, Y, Z) bool without floaters, and the points that lie in them."""
    from scipy import ndimage

    cells = ((points - low) / cell_m).astype(np.int32)
    taken = np.zeros(cells.max(0) + ROOM + 2, bool)
    taken[tuple(cells.T)] = True
    away = squared_distances(taken, WIDE_GAP)
    solid = ~within(away > GAP**2, GAP) if hollow else all_solid(away)
    pieces, count = ndimage.label(solid, np.ones((3, 3, 3)))
    sizes = np.bincount(pieces.reshape(-1), minlength=count + 1)
    sizes[0] = 0
    kept = sizes >= LEAST_PART * sizes.max()
    solid = kept[pieces]
    return solid, points[solid[tuple(cells.T)]]


def squared_distances(taken: np.ndarray, reach: int) -> np.ndarray:
    """(X, Y, Z) uint8 squared cells to the nearest taken one; 255 beyond `reach`, at most 15.

    The squares of the distances along each axis add up, so one axis after the other is looked
    along: a tenth of the time of a transform that knows all distances.
    """
    out = np.where(taken, np.uint8(0), np.uint8(255))
    for axis in range(3):
        line = np.moveaxis(out, axis, 0)
        before = line.copy()
        for step in range(1, min(reach, len(line) - 1) + 1):
            far = np.minimum(before, np.uint8(255 - step**2)) + np.uint8(step**2)
            np.minimum(line[step:], far[:-step], out=line[step:])
            np.minimum(line[:-step], far[step:], out=line[:-step])
    out[out > reach**2] = 255
    return out


def within(taken: np.ndarray, reach: int) -> np.ndarray:
    """(X, Y, Z) bool: at most `reach` cells from a taken one."""
    return squared_distances(taken, reach) <= reach**2


def all_solid(away: np.ndarray) -> np.ndarray:
    """Cells that count as solid, of an object that is solid throughout; of a leaking skin, too.

    away: squared cells from each to the nearest taken one.
    """
    solid = enclosed(away, GAP)
    roofed = under_a_roof(away, WIDE_GAP)
    for more in (enclosed(away, WIDE_GAP), roofed):
        if more.sum() > (1 + LEAKS) * solid.sum():
            solid |= more
    # Caves that open downward, without the fillets that a wide closing leaves in corners.
    return solid | (roofed & walled(solid))


def enclosed(away: np.ndarray, gap: int) -> np.ndarray:
    """Cells that nothing outside comes within `gap` of, if it keeps as far from what is taken.

    away: squared cells from each to the nearest taken one.  A closing and the filling of holes in
    one.
    """
    from scipy import ndimage

    free, _ = ndimage.label(away > gap**2)
    return ~within(free == free[0, 0, 0], gap)


def under_a_roof(away: np.ndarray, gap: int) -> np.ndarray:
    """Cells with walls above (+Y) and on all four sides: the inside of what stood on a floor.

    away: squared cells from each to the nearest taken one.  Holes up to `gap` either way let
    nothing in.
    """
    walls = away <= gap**2
    return ~within(~(walls | walled(walls)), gap)


def walled(solid: np.ndarray) -> np.ndarray:
    """Cells with a solid one somewhere above (+Y) and to all four sides."""
    shut = np.ones_like(solid)
    for axis, way in ((1, -1), (0, 1), (0, -1), (2, 1), (2, -1)):
        turned = np.flip(solid, axis) if way < 0 else solid
        seen = np.logical_or.accumulate(turned, axis)
        shut &= np.flip(seen, axis) if way < 0 else seen
    return shut


def distance_field(
    solid: np.ndarray, points: np.ndarray, low: np.ndarray, cell_m: float, hollow: bool = False
) -> np.ndarray:
    """(X, Y, Z) float32 cells to the surface OFFSET outside of points and solid, below 0 inside."""
    from scipy.spatial import cKDTree

    taken = np.zeros_like(solid)
    taken[tuple(((points - low) / cell_m).astype(np.int32).T)] = True
    bare = solid & (squared_distances(taken, 2) > 3)  # no point in the cells around it
    out = cells_away(solid).astype(np.float32)
    near = (out < 3) & (~solid | (squared_distances(~solid, 3) < 9))
    where = np.argwhere(near)
    tree = cKDTree(thin((points - low) / cell_m))
    away = tree.query(where + 0.5, distance_upper_bound=FAR)[0].astype(np.float32)
    away = np.minimum(away, FAR)  # Inf where no point is so near
    if bare.any():
        away = np.minimum(away, cells_away(bare)[near])
    field = np.where(solid, np.float32(-OFFSET), out)
    field[near] = np.where(solid[near], np.minimum(away - OFFSET, -0.1), away - OFFSET)
    field[field == 0] = 1e-6
    return without_channels(field, hollow)


def cells_away(taken: np.ndarray) -> np.ndarray:
    """(X, Y, Z) float64 cells to the nearest taken one, FAR at most."""
    return np.minimum(np.sqrt(np.arange(256.0)), FAR)[squared_distances(taken, int(FAR))]


def without_channels(field: np.ndarray, hollow: bool) -> np.ndarray:
    """The field with what is free but shut in made solid; rooms of what is hollow stay."""
    from scipy import ndimage

    free, count = ndimage.label(field > 0)
    kept = np.zeros(count + 1, bool)
    if hollow:
        kept = np.bincount(free.ravel(), minlength=count + 1) >= LEAST_ROOM
    kept[free[0, 0, 0]] = True
    field[(field > 0) & ~kept[free]] = -0.1  # channels that the offset has closed
    return field


def thin(cells: np.ndarray) -> np.ndarray:
    """Points in units of a cell, (M, 3): where there are many, one a quarter of a cell."""
    if len(cells) <= MOST_POINTS:
        return cells
    quarter = (cells * 4).astype(np.int64)
    key = (quarter[:, 0] << 40) + (quarter[:, 1] << 20) + quarter[:, 2]
    return cells[np.unique(key, return_index=True)[1]]


def simplify(mesh: TriangleMesh, faces: int) -> TriangleMesh:
    """About `faces` faces of a closed mesh; more where no more edges can be merged."""
    import fast_simplification

    size = float(np.ptp(mesh.vertices, axis=0).max())
    vertices, rows = mesh.vertices * (UNIT / size), mesh.faces
    for slow in SLOW:
        if len(rows) > MOST_OVER * faces:
            vertices, rows = fast_simplification.simplify(
                vertices, rows, target_count=faces, agg=slow
            )
    vertices = (np.asarray(vertices, np.float64) * (size / UNIT)).astype(np.float32)
    rows = np.asarray(rows, np.int32)
    if not is_closed(rows):
        return mesh
    return without_crumbs(stitch(TriangleMesh(vertices, rows)))


def without_crumbs(mesh: TriangleMesh) -> TriangleMesh:
    """The mesh without closed parts of next to no volume, which merging edges leaves behind."""
    parts = separate(mesh)
    sizes = [abs(volume(part.vertices, part.faces)) for part in parts]  # a room's is below 0
    kept = [p for p, size in zip(parts, sizes, strict=True) if size > CRUMB * max(sizes)]
    return join_meshes(kept) if 0 < len(kept) < len(parts) else mesh


def join_meshes(parts: list[TriangleMesh]) -> TriangleMesh:
    """Several meshes as one, side by side."""
    starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    faces = [part.faces + int(start) for part, start in zip(parts, starts, strict=True)]
    vertices = np.concatenate([part.vertices for part in parts])
    return TriangleMesh(vertices, np.concatenate(faces).astype(np.int32))


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Cubic metres within a closed mesh."""
    a, b, c = (vertices[faces[:, i]].astype(np.float64) for i in range(3))
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


def draw_in(mesh: TriangleMesh, inside: np.ndarray, cell_m: float) -> TriangleMesh:
    """Every vertex moved back by the OFFSET, or less where the mesh is thin, in three steps."""
    from scipy import ndimage

    depth = cells_away(~inside).astype(np.float32)  # no vertex goes back by more than OFFSET
    vertices = mesh.vertices.astype(np.float64)
    inward = -normals(vertices, mesh.faces)
    half = np.zeros(len(vertices))
    for cells in (0.5, 1, 1.5, 2):
        at = vertices / cell_m - 0.5 + cells * inward
        half = np.maximum(half, ndimage.map_coordinates(depth, at.T, order=1, mode="nearest"))
    step = np.clip(half - LEAST_HALF, 0, OFFSET)[:, None] * cell_m / 3
    for _ in range(3):
        vertices -= normals(vertices, mesh.faces) * step
    return TriangleMesh(vertices.astype(np.float32), mesh.faces)


def normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(V, 3) unit, the mean of the faces around each vertex by area; zero where there is none."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    total = np.stack(
        [
            np.bincount(faces.reshape(-1), np.repeat(across[:, i], 3), len(vertices))
            for i in range(3)
        ],
        1,
    )
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.zeros_like(total), where=length > 0)


# A mesh whose surface touches itself, made watertight: every edge gets exactly two faces.
#
# Merging edges pinches thin parts: then four faces meet at an edge. The surface is still closed,
# so each face's edge finds one that runs the other way; the corners are named anew along these
# pairs.


def stitch(mesh: TriangleMesh) -> TriangleMesh:
    """The same surface, vertices split where sheets touch.  The mesh must be closed (is_closed)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    faces = without_flaps(mesh.faces)
    half, other = paired_halves(faces)
    # Of a half edge, corner `h` is its start and `following(h)` its end; the pair runs back.
    rows = np.concatenate([half, following(half)])
    columns = np.concatenate([following(other), other])
    size = 3 * len(faces)
    graph = coo_array((np.ones(len(rows), bool), (rows, columns)), (size, size))
    count, of_corner = connected_components(graph, directed=False)
    vertices = np.empty((count, 3), np.float32)
    vertices[of_corner] = mesh.vertices[faces.reshape(-1)]
    return split_doubles(vertices, of_corner.reshape(-1, 3).astype(np.int32), half, other)


def is_closed(faces: np.ndarray) -> bool:
    """Whether as many faces (F, 3) run along every edge one way as the other."""
    if not len(faces):
        return False
    start, end = (faces[:, k].reshape(-1).astype(np.int64) for k in ([0, 1, 2], [1, 2, 0]))
    most = int(faces.max()) + 1
    return np.array_equal(np.sort(start * most + end), np.sort(end * most + start))


def is_watertight(faces: np.ndarray) -> bool:
    """Whether every edge has two faces (F, 3), which run along it in opposite ways."""
    start, end = faces.reshape(-1).astype(np.int64), faces[:, [1, 2, 0]].reshape(-1)
    along = start * (int(faces.max(initial=0)) + 1) + end
    return is_closed(faces) and len(np.unique(along)) == len(along)


def following(corner: np.ndarray) -> np.ndarray:
    """The next corner of the same face; corners count 3 a face."""
    return corner - corner % 3 + (corner + 1) % 3


def without_flaps(faces: np.ndarray) -> np.ndarray:
    """(F, 3) without faces that have a vertex twice or lie on one that looks the other way."""
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    order = np.sort(faces, axis=1)
    a, b, c = faces.astype(np.int64).T
    turns = np.sign(b - a) * np.sign(c - b) * np.sign(a - c) < 0  # an even order of the vertices
    _, name, count = np.unique(order, axis=0, return_inverse=True, return_counts=True)
    name, kept = name.reshape(-1), np.ones(len(faces), bool)
    for which in np.flatnonzero(count > 1):
        rows = np.flatnonzero(name == which)
        one, back = rows[turns[rows]], rows[~turns[rows]]
        both = min(len(one), len(back))
        kept[one[:both]] = kept[back[:both]] = False
    return faces[kept]


def paired_halves(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(E,) half edges, by their first corner, from the lower vertex, and the ones that run back."""
    start, end = faces.reshape(-1).astype(np.int64), faces[:, [1, 2, 0]].reshape(-1)
    key = np.minimum(start, end) * (int(faces.max(initial=0)) + 1) + np.maximum(start, end)
    ahead, back = np.flatnonzero(start < end), np.flatnonzero(start > end)
    ahead = ahead[np.argsort(key[ahead], kind="stable")]
    return ahead, back[np.argsort(key[back], kind="stable")]


def split_doubles(
    vertices: np.ndarray, faces: np.ndarray, half: np.ndarray, other: np.ndarray
) -> TriangleMesh:
    """A vertex in the middle of every edge that another edge has both ends in common with."""
    names = faces.reshape(-1)
    ends = np.sort(np.stack([names[half], names[following(half)]], 1), axis=1)
    _, first = np.unique(ends, axis=0, return_index=True)
    doubles = np.setdiff1d(np.arange(len(half)), first)
    middle, more = np.full(3 * len(faces), -1), []
    for number, edge in enumerate(doubles):
        more.append((vertices[ends[edge, 0]] + vertices[ends[edge, 1]]) / 2)
        middle[[half[edge], other[edge]]] = len(vertices) + number
    kept: list = []
    added: list[np.ndarray] = []
    for face, on_edges in zip(faces, middle.reshape(-1, 3), strict=True):
        if (on_edges < 0).all():
            kept.append(face)
            continue
        ring = [n for pair in zip(face, on_edges, strict=True) for n in pair if n >= 0]
        centre = len(vertices) + len(doubles) + len(added)  # a fan from within: no flat triangle
        added.append(vertices[face].mean(0))
        kept += [(a, b, centre) for a, b in zip(ring, ring[1:] + ring[:1], strict=True)]
    every = np.array([*vertices, *more, *added], np.float32).reshape(-1, 3)
    return TriangleMesh(every, np.array(kept, np.int32).reshape(-1, 3))
