"""Surfaces out of fields and touching sheets: always closed, always oriented outward."""

import numpy as np
import pytest
import trimesh

from shapeshift.scene.colliders.collider_wrap import is_closed, is_watertight, stitch
from shapeshift.scene.colliders.marching_tetrahedra import find_surface
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh, sample_faces, separate


def solid(mesh: TriangleMesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def grid(size: int) -> np.ndarray:
    return np.stack(np.meshgrid(*[np.arange(size)] * 3, indexing="ij"), -1) - (size - 1) / 2


def test_a_ball_is_found_where_it_is():
    at = grid(32)
    found = solid(find_surface(np.linalg.norm(at, axis=-1) - 11))
    assert found.is_volume and found.euler_number == 2
    assert np.linalg.norm(found.vertices - 15.5, axis=1) == pytest.approx(11, abs=0.06)
    assert found.volume == pytest.approx(4 / 3 * np.pi * 11**3, rel=0.01)


def test_a_ring_keeps_its_hole():
    at = grid(32)
    around = np.hypot(at[..., 0], at[..., 2]) - 9
    found = solid(find_surface(np.hypot(around, at[..., 1]) - 3.5))
    assert found.is_volume and found.euler_number == 0


def test_any_cells_give_a_closed_surface(count=20):
    """Also those that touch at a corner or an edge, which marching cubes tears open."""
    for seed in range(count):
        rng = np.random.default_rng(seed)
        inside = np.pad(rng.random((7, 6, 5)) < rng.choice([0.1, 0.5, 0.9]), 1)
        found = find_surface(np.where(inside, -1, 1) * rng.uniform(0.1, 1, inside.shape))
        assert is_watertight(found.faces)
        assert solid(found).is_watertight and solid(found).volume > 0


def test_nothing_inside_gives_no_surface():
    found = find_surface(np.ones((4, 4, 4)))
    assert found.faces.shape == (0, 3) and found.vertices.shape == (0, 3)
    assert not is_watertight(found.faces)


def box(at: tuple[float, ...]) -> trimesh.Trimesh:
    found = trimesh.creation.box((1, 1, 1))
    found.apply_translation(at)
    return found


@pytest.mark.parametrize("at", [(1, 1, 0), (1, 1, 1)])
def test_boxes_that_touch_are_stitched(at):
    """At an edge four faces meet, at a corner all of two boxes."""
    both = trimesh.util.concatenate([box((0, 0, 0)), box(at)])
    both.merge_vertices()
    mesh = TriangleMesh(both.vertices.astype(np.float32), both.faces.astype(np.int32))
    assert is_closed(mesh.faces)
    found = stitch(mesh)
    assert is_watertight(found.faces) and solid(found).is_watertight
    assert solid(found).volume == pytest.approx(2, rel=1e-6)
    assert solid(found).area == pytest.approx(12, rel=1e-5)


def test_faces_that_lie_on_each_other_go_away():
    """Whatever vertex either starts with: two pyramids on one base become one solid."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1]], np.float32)
    above = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
    below = [[0, 1, 2], [1, 0, 4], [2, 1, 4], [0, 2, 4]]
    for turn in range(3):
        faces = np.array([*above, [*below[0][turn:], *below[0][:turn]], *below[1:]], np.int32)
        for names in ([0, 1, 2, 3, 4], [4, 2, 0, 1, 3], [1, 0, 3, 2, 4]):
            names = np.array(names, np.int32)
            vertices = np.empty_like(corners)
            vertices[names] = corners
            found = stitch(TriangleMesh(vertices, names[faces]))
            assert len(found.faces) == 6 and is_watertight(found.faces)
            assert solid(found).volume == pytest.approx(1 / 3)


def test_what_is_closed_already_stays():
    ball = trimesh.creation.icosphere(2)
    found = stitch(TriangleMesh(ball.vertices.astype(np.float32), ball.faces.astype(np.int32)))
    assert len(found.faces) == len(ball.faces) and len(found.vertices) == len(ball.vertices)
    assert solid(found).volume == pytest.approx(ball.volume, rel=1e-5)


def test_a_mesh_of_many_corners_is_told_to_be_closed(count=6000):
    """With 46,341 vertices and more, products of two of their numbers leave 32 bits."""
    box = trimesh.creation.box()
    faces = (box.faces[None] + 8 * np.arange(count)[:, None, None]).reshape(-1, 3)
    faces = faces.astype(np.int32)
    assert is_closed(faces) and is_watertight(faces)
    assert not is_closed(faces[1:]) and not is_watertight(faces[1:])


def test_an_open_mesh_is_not_closed():
    ball = trimesh.creation.icosphere(1)
    assert is_closed(ball.faces) and not is_closed(ball.faces[1:])
    assert not is_watertight(np.vstack([ball.faces, ball.faces]))


def test_parts_are_told_apart():
    both = trimesh.util.concatenate([trimesh.creation.icosphere(1), box((5, 0, 0))])
    mesh = TriangleMesh(both.vertices.astype(np.float32), both.faces.astype(np.int32))
    ball, cube = separate(mesh)
    assert (len(ball.faces), len(cube.faces)) == (80, 12)
    assert solid(cube).volume == pytest.approx(1)


def test_samples_are_spread_by_area_and_always_the_same():
    corners = np.array(
        [[[0, 0, 0], [3, 0, 0], [0, 2, 0]], [[9, 0, 0], [10, 0, 0], [9, 2, 0]]], float
    )
    points, face = sample_faces(corners, 1000)
    assert np.array_equal(points, sample_faces(corners, 1000)[0])
    assert abs((face == 0).sum() - 751) <= 1  # 3 of 4 parts of the area, and each centre
    assert (points[face == 0, :2] / (3, 2)).sum(1).max() <= 1 + 1e-9


@pytest.mark.parametrize(
    ("faces", "word"),
    [
        (np.array([[0, 1, 3]], np.int32), "3 vertices"),
        (np.array([[0, 1, -1]], np.int32), "-1"),
        (np.array([[0, 1, 2]], np.int64), "int64"),
        (np.array([0, 1, 2], np.int32), "int32 is wanted"),
    ],
)
def test_a_mesh_refuses_faces_that_are_none(faces, word):
    with pytest.raises(ValueError, match=word):
        TriangleMesh(np.zeros((3, 3), np.float32), faces)
