"""What enters the physics, checked at its door, and the engine's shapes of it."""

import math
from typing import Any

import numpy as np

from shapeshift.runtime_models.model import Finding
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.colliders.thicken import thickened
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh
from shapeshift.scene.pose import UNIT_SLACK, Pose
from shapeshift.scene.world.broad_faces import with_firm_faces

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
