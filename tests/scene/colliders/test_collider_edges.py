"""The edges of colliders that the debug view draws."""

import numpy as np
import pytest

from shapeshift.scene.colliders.collider import Collider, box_around
from shapeshift.scene.colliders.collider_edges import edges_of, hull_edges, mesh_edges
from tests.support.scene.physics_things import box, cup


def lengths(edges: np.ndarray) -> list[float]:
    return sorted(np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1).round(5))


def test_a_box_has_twelve_edges():
    hull = box(0.1, 0.2, 0.3)
    both = Collider((hull,), box_around(hull))
    for edges in (hull_edges(both), mesh_edges(both)):
        assert edges.dtype == np.float32
        assert lengths(edges) == [0.2] * 4 + [0.4] * 4 + [0.6] * 4


def test_every_piece_has_its_own():
    hulls = cup()
    edges = hull_edges(Collider(tuple(hulls), box_around(hulls[0])))
    assert len(edges) == sum(len(hull_edges(Collider((h,), box_around(h)))) for h in hulls)
    assert len(hull_edges(Collider((), box_around(hulls[0])))) == 0
    flat = box(0.1, 0.1, 0.0)
    assert len(hull_edges(Collider((flat,), box_around(flat)))) == 0


@pytest.mark.parametrize("turned", [False, True])
def test_an_open_mesh_keeps_its_border(turned):
    corners = np.array(
        [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], float
    )
    if turned:  # the second triangle the other way round
        corners[1] = corners[1, ::-1]
    assert lengths(edges_of(corners)) == [1.0] * 4  # a square, without its diagonal
    corners[1, 0 if turned else 2, 2] = 0.3
    assert len(edges_of(corners)) == 5


def test_no_triangles_have_no_edges():
    assert edges_of(np.zeros((0, 3, 3))).shape == (0, 2, 3)
