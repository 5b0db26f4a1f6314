"""What enters the physics, checked at its door, and the engine's shapes of it."""

import math
from collections.abc import Iterable
from types import ModuleType
from typing import Any

import numpy as np

from shapeshift.runtime_models.model import BadFile, Finding
from shapeshift.runtime_models.program import package_words
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh
from shapeshift.scene.pose import UNIT_SLACK, Pose

FAR = 1e4  # metres from the world's origin: beyond, float32 is coarser than a millimetre
LEAST_EXTENT = 1e-4  # metres: a hull thinner than a tenth of a millimetre has no inside
LEAST_AREA = 1e-12  # square metres: a triangle with less has no normal
MOST_FRICTION = 10.0
LEAST_MASS, MOST_MASS = 0.05, 5.0  # kg: any two bodies are within 1 : 100, as the solver needs


def checked_point(values: Any, what: str) -> np.ndarray:
    """(3,) float64 metres, finite and within FAR.  Raises ValueError."""
    point = np.asarray(values, np.float64)
    if point.shape != (3,) or not (np.abs(point) <= FAR).all():
        raise ValueError(
            f"{what} is {values}; three finite numbers within {FAR:.0f} are wanted, metres or m/s."
        )
    return point


def checked_number(value: float, what: str, least: float, most: float) -> float:
    """The number if it lies in [least, most].  Raises ValueError."""
    if not least <= value <= most:
        raise ValueError(f"{what} is {value}; a number from {least:g} to {most:g} is wanted.")
    return float(value)


def checked_pose(pose: Pose, what: str) -> Pose:
    """The pose with its quaternion's length made exactly 1.  Raises ValueError."""
    position = checked_point(pose.position, f"the position of {what}")
    wxyz = np.asarray(pose.wxyz, np.float64)
    length = math.hypot(*wxyz) if wxyz.shape == (4,) else 0.0
    if not abs(length - 1) <= UNIT_SLACK:
        raise ValueError(
            f"the rotation of {what} is {pose.wxyz}; a quaternion w x y z of length 1 is wanted."
        )
    return Pose(position, wxyz / length)


def clamped_mass(mass_kg: float) -> tuple[float, Finding | None]:
    """The mass that the solver can hold in a stack, and a finding when it is another one."""
    if not 0 < mass_kg < math.inf:
        raise ValueError(f"a mass is {mass_kg} kg; a finite number above 0 is wanted.")
    held = min(max(float(mass_kg), LEAST_MASS), MOST_MASS)
    if held == mass_kg:
        return held, None
    what = f"the mass {mass_kg:g} kg is outside {LEAST_MASS:g} to {MOST_MASS:g} kg"
    return held, Finding(what, 1, f"taken as {held:g} kg", repaired=True)


def isometry(pose: Pose) -> Any:
    """The engine's word for a pose."""
    from rapier3d import Isometry3, Rotation3

    return Isometry3(three(pose.position), Rotation3(*map(float, pose.wxyz)))


def pose_of(isometry: Any) -> Pose:
    """The pose, exactly the numbers (float32) that the engine holds."""
    p, q = isometry.translation, isometry.rotation
    return Pose(np.array([p.x, p.y, p.z]), np.array([q.w, q.i, q.j, q.k]))


def compound_shape(hulls: Any) -> Any:
    """The engine's shape of convex pieces, each (V, 3) metres, object frame.  Raises ValueError."""
    from rapier3d import Isometry3, MeshConversionError, SharedShape

    parts: list[Any] = []  # (Isometry3, SharedShape)
    for i, hull in enumerate(hulls):
        points = np.ascontiguousarray(hull, np.float32)
        if points.ndim != 2 or points.shape[1] != 3 or not (np.abs(points) <= FAR).all():
            raise ValueError(
                f"hull {i} has shape {points.shape}, or numbers not finite or beyond {FAR:.0f} m; "
                "(V, 3) metres are wanted."
            )
        if len(points) < 4 or not thinnest_extent(points) >= LEAST_EXTENT:
            raise ValueError(
                f"hull {i} is flat or has under 4 points; a solid at least "
                f"{LEAST_EXTENT * 1e3:g} mm thick is wanted."
            )
        try:
            shape = SharedShape.convex_hull(with_firm_faces(points))
            parts.append((Isometry3.identity(), shape))
        except MeshConversionError as why:
            raise ValueError(f"hull {i} cannot be made convex: {why}; thicken it.") from why
    if not parts:
        raise ValueError("a collider has no hulls; at least one is wanted.")
    return SharedShape.compound(parts)


def thinnest_extent(points: np.ndarray) -> float:
    """Metres across the least axis of the points (V, 3)."""
    centred = points - points.mean(axis=0, dtype=np.float64)
    axes = np.linalg.svd(centred, full_matrices=False)[2]  # (3, 3), rows
    return float(np.ptp(centred @ axes[-1]))


def mesh_shape(mesh: TriangleMesh) -> tuple[Any, list[Finding]]:
    """The engine's shape of a static triangle mesh, thickened.  Raises ValueError.

    Inner edges are smoothed: without, a box that slides over a flat grid of triangles stumbles.
    """
    from rapier3d import SharedShape, TriMeshFlags

    vertices, faces = np.ascontiguousarray(mesh.vertices), mesh.faces
    if not (np.abs(vertices) <= FAR).all():
        raise ValueError(
            f"a static mesh reaches {np.abs(vertices).max():g} m; {FAR:.0f} m is the "
            "most, see whether its units are metres."
        )
    a, b, c = (vertices[faces[:, i]].astype(np.float64) for i in range(3))  # (F, 3) each
    solid = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2 >= LEAST_AREA
    if not solid.any():
        raise ValueError("a static mesh has no triangle with an area; at least one is wanted.")
    findings = []
    if lost := int((~solid).sum()):
        findings.append(Finding(f"{lost} triangles of a static mesh have no area", lost, "dropped"))
    points, triangles, outward = thickened(vertices, faces[solid])
    flags = TriMeshFlags.FIX_INTERNAL_EDGES
    if not outward:
        flags = TriMeshFlags.FIX_INTERNAL_EDGES_TWO_SIDED
        what = "neighbours in a static mesh are wound against each other"
        findings.append(Finding(what, 0, "met from both sides, not thickened", repaired=False))
    return SharedShape.trimesh(points, triangles, flags), findings


# The engine's settings, by sweeps of figures in tests/scene/world/test_physics_figures.py.

MOST_SPEED = 40.0  # m/s: whatever is faster is slowed to it
LENGTH_UNIT = 0.1  # metres: what objects to be held measure; scales the engine's tolerances
SOLVER_ITERATIONS = 8  # a substep; with the default of 4 a stack of 1 : 100 sinks
# Hz and damping ratio of contacts: the default of 30 Hz lets objects rest 12 mm deep.
CONTACT, STATIC_CONTACT = (240.0, 10.0), (480.0, 10.0)
PREDICTION = 0.02  # metres: contacts are foreseen this far; with 2 mm, 12 mm go in at 5 m/s
# m/s and metres: where nothing is faster, contacts are foreseen only so far.  Pieces of one body of
# which several may touch soon let it rock for ever.
SLOW, SLOW_PREDICTION = 0.5, 0.002
# m/s: above, a step has twice and four times its substeps, so that nothing passes a thin plate.
BRISK, FAST = 7.0, 14.0


def engine() -> ModuleType:
    """The engine, or one sentence (BadFile) where it is not installed or does not load."""
    try:
        import rapier3d
    except ImportError as why:
        raise BadFile(
            f"nothing can move or be touched: the package rapier3d does not load ({why}); "
            f"{package_words('rapier3d')} installs it."
        ) from why
    return rapier3d


def new_world(gravity_m_s2: float) -> Any:
    """An empty world of the engine in which small, light, stiff objects keep apart."""
    from rapier3d import PhysicsWorld, SpringCoefficients

    world = PhysicsWorld(gravity=(0.0, -gravity_m_s2, 0.0))
    rules = world.integration_parameters
    rules.num_solver_iterations = SOLVER_ITERATIONS
    rules.length_unit = LENGTH_UNIT
    rules.normalized_prediction_distance = PREDICTION / LENGTH_UNIT
    rules.normalized_max_linear_velocity = MOST_SPEED / LENGTH_UNIT
    rules.contact_softness = SpringCoefficients(*CONTACT)
    rules.static_contact_softness = SpringCoefficients(*STATIC_CONTACT)
    return world


def prediction(speeds: dict[int, tuple[float, float, float]]) -> float:
    """How far contacts are foreseen in a step, in units of LENGTH_UNIT."""
    slow = all(x * x + y * y + z * z <= SLOW**2 for x, y, z in speeds.values())
    return (SLOW_PREDICTION if slow else PREDICTION) / LENGTH_UNIT


def stopped_bodies(world: Any, handles: dict[int, Any]) -> list[Finding]:
    """The engine stops a body whose numbers are no longer finite where it last was."""
    lost = world.quarantine.bodies
    return [
        Finding(f"body {number} was thrown out of all numbers", 1, "stopped where it last was")
        for number, handle in (handles.items() if lost else ())
        if handle in lost
    ]


# m/s and rad/s: what floats and was touched is faster; twice the speed below which things sleep, so
# that what merely leans on it, or lies in it by a hair, does not count.
STIRS, TURNS = 0.02, 0.2
FLOAT_DAMPING = 10.0  # 1/s


def float_body(body: Any) -> None:
    """The engine's body has no weight, and loses what little speed it gets."""
    body.gravity_scale, body.linear_damping, body.angular_damping = 0.0, *[FLOAT_DAMPING] * 2


def end_floats(bodies: dict[int, Any], held: set[int]) -> None:
    """What floats weighs again once it stirs or is held: something has touched it."""
    for number, body in bodies.items():
        if body.gravity_scale == 0:
            v, w = body.linvel, body.angvel
            if number in held or not is_slow((v.x, v.y, v.z), (w.x, w.y, w.z)):
                body.gravity_scale, body.linear_damping, body.angular_damping = 1.0, 0.0, 0.0


def is_slow(line: Iterable[float], turn: Iterable[float]) -> bool:
    """m/s and rad/s of what nothing has touched."""
    return math.hypot(*line) < STIRS and math.hypot(*turn) < TURNS


def more_substeps(speeds: dict[int, tuple[float, float, float]], pressed: bool) -> int:
    """1, 2 or 4 times as many: what the fastest body moves in one must stay near PREDICTION.

    pressed: a hand holds something at a mesh; a light cup that flips there gets 2 mm in with 1.
    """
    fastest = max((x * x + y * y + z * z for x, y, z in speeds.values()), default=0.0)
    return 4 if fastest > FAST**2 else 2 if fastest > BRISK**2 or pressed else 1


# Hulls whose broad faces have four corners, so that things stand on them as wide as they are.
#
# The engine takes the first four corners of a hull's face as where it may touch (parry,
# `ConvexPolyhedron::local_support_feature`). Of a box these are all; of a cup's round base they
# lie on one side of it, so that the cup tips over, or rocks and walks for ever. Here the four
# corners of such a face that lie farthest apart stay and all others are drawn in a little: what
# is left of the face is broad, and touches with all of its corners.

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
        if not total[number] >= BROAD * total.sum():
            break
        triangles = np.flatnonzero(face == number)
        if corner_count(hull.simplices[triangles]) > MOST_CORNERS:
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


# A static triangle mesh made a solid: an open sheet gets a back, so that each place has an inside.
#
# A sheet without thickness pushes a corner that got through out on its far side.

THICKNESS = 0.02  # metres, behind the faces: a table top's


def rim_of(faces: np.ndarray, count: int) -> np.ndarray | None:
    """(R, 2) edges of triangles (F, 3) int64 without a neighbour, as the triangles go around them;
    None where two go along one in the same way.  count: of the vertices.
    """
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])  # (3F, 2)
    code, back = edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0]
    ordered = np.sort(code)
    if (ordered[1:] == ordered[:-1]).any():
        return None
    at = np.searchsorted(ordered, back).clip(max=len(ordered) - 1)
    return edges[ordered[at] != back]


def thickened(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
    """(V', 3) float32, (F', 3) uint32, and whether that is a solid whose faces look outward.

    vertices (V, 3) metres, faces (F, 3), anticlockwise seen from outside.  A closed mesh stays as
    it is, turned outward; an open one gets a back THICKNESS behind it and a rim.  Where faces are
    wound both ways there is no behind: the mesh comes back as it was, and False.
    """
    points, f = vertices, faces.astype(np.int64)
    rim = rim_of(f, len(points))
    if rim is None or len(rim):
        points, row = np.unique(vertices, axis=0, return_inverse=True)  # seams in files are cuts
        f = row.reshape(-1)[faces].astype(np.int64)  # (F, 3)
        f = f[(f[:, 0] != f[:, 1]) & (f[:, 1] != f[:, 2]) & (f[:, 2] != f[:, 0])]
        rim = rim_of(f, len(points))
    if rim is None:
        return vertices, faces.astype(np.uint32), False
    corners = points[f].astype(np.float64)  # (F, 3, 3)
    if not len(rim):  # closed, perhaps where two of its corners touch
        volume = np.linalg.det(corners - points.mean(axis=0)).sum()
        return points, (f if volume > 0 else f[:, ::-1]).astype(np.uint32), True
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])  # (F, 3)
    normals = np.zeros(points.shape)
    for corner in range(3):
        np.add.at(normals, f[:, corner], across)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    back = points - THICKNESS * normals / np.maximum(lengths, 1e-30)
    a, b = rim[:, 0], rim[:, 1]
    a_back, b_back = a + len(points), b + len(points)
    sides = np.concatenate([np.stack([b, a, a_back], 1), np.stack([b, a_back, b_back], 1)])
    solid = np.concatenate([f, f[:, ::-1] + len(points), sides])
    return np.concatenate([points, back]).astype(np.float32), solid.astype(np.uint32), True
