"""A static mesh as a solid: open sheets get a back, closed ones are turned outward."""

import numpy as np
import pytest

from shapeshift.scene.colliders.triangle_mesh import TriangleMesh
from shapeshift.scene.world.physics import Physics
from shapeshift.scene.world.physics_shapes import THICKNESS, thickened
from tests.support.scene.physics_things import BOX_FACES, at, box, run, sheet


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Cubic metres inside of a closed mesh, below 0 where its faces look inward."""
    return float(np.linalg.det(vertices[faces].astype(np.float64)).sum() / 6)


def edge_count(faces: np.ndarray) -> dict:
    """How often each directed edge occurs, by hand."""
    count: dict[tuple[int, int], int] = {}
    for a, b, c in faces.tolist():
        for edge in ((a, b), (b, c), (c, a)):
            count[edge] = count.get(edge, 0) + 1
    return count


@pytest.mark.parametrize("cells", [1, 2, 7])
def test_an_open_sheet_becomes_a_closed_slab_behind_its_faces(cells):
    mesh = sheet(1, cells)
    vertices, faces, outward = thickened(mesh.vertices, mesh.faces)
    count = edge_count(faces)
    assert outward and all(n == 1 and (b, a) in count for (a, b), n in count.items())
    assert volume(vertices, faces) == pytest.approx(4 * THICKNESS, rel=1e-5)
    assert vertices[:, 1].max() == 0 and vertices[:, 1].min() == pytest.approx(-THICKNESS)


@pytest.mark.parametrize("inward", [False, True])
@pytest.mark.parametrize("seams", [False, True])
def test_a_closed_mesh_stays_and_looks_outward(inward, seams):
    vertices, faces = box(1, 2, 3), BOX_FACES
    if volume(vertices, faces) < 0:
        faces = faces[:, ::-1]
    faces = faces[:, ::-1] if inward else faces
    if seams:  # every triangle has corners of its own, as files with texture write them
        vertices, faces = vertices[faces.ravel()], np.arange(36).reshape(12, 3)
    points, triangles, outward = thickened(vertices, faces)
    assert outward and len(points) == 8 and len(triangles) == 12
    assert volume(points, triangles) == pytest.approx(48)


def test_faces_wound_both_ways_are_met_from_both_sides_with_a_note():
    mesh = sheet(1, 2)
    faces = mesh.faces.copy()
    faces[0] = faces[0, ::-1]
    vertices, same, outward = thickened(mesh.vertices, faces)
    assert not outward and np.array_equal(same, faces) and vertices is mesh.vertices
    pytest.importorskip("rapier3d", reason="the physics engine is not installed")
    physics = Physics()
    physics.add_static(TriangleMesh(mesh.vertices, faces), at(0, 0, 0))
    assert [finding.done for finding in physics.findings] == ["met from both sides, not thickened"]
    body = physics.add_body([box(0.05, 0.05, 0.05)], at(-0.5, 0.2, 0), 0.3)
    run(physics, 1)
    assert physics.pose(body).position[1] == pytest.approx(0.05, abs=0.001)


def test_a_closed_table_carries_on_top_and_stops_from_below():
    pytest.importorskip("rapier3d", reason="the physics engine is not installed")
    for side in (1, -1):
        physics = Physics(gravity_m_s2=9.81 * side)
        physics.add_static(TriangleMesh(box(1, 0.01, 1), BOX_FACES), at(0, 0, 0))
        body = physics.add_body([box(0.05, 0.05, 0.05)], at(0, 0.3 * side, 0), 0.3)
        run(physics, 1)
        assert physics.pose(body).position[1] * side == pytest.approx(0.06, abs=0.001)


def test_a_solid_whose_corners_touch_is_one():
    """Two boxes that touch along an edge: joined there, each side of it would be there twice."""
    one = box(1, 1, 1)
    vertices = np.concatenate([one, one + np.array([2, 2, 0], np.float32)])
    faces = BOX_FACES if volume(one, BOX_FACES) > 0 else BOX_FACES[:, ::-1]
    faces = np.concatenate([faces, faces + len(one)])
    assert len(np.unique(vertices, axis=0)) == len(vertices) - 2
    for given in (faces, faces[:, ::-1]):
        points, triangles, outward = thickened(vertices, given)
        assert outward
        np.testing.assert_array_equal(points, vertices)
        np.testing.assert_array_equal(triangles, faces)
