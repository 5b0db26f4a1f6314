"""Worlds that are laid together: against similarities that were made up."""

import numpy as np
import pytest

from shapeshift.scene.change.similarity import (
    Similarity,
    fit_surfaces,
    rotation_of,
    surface_normals,
)
from shapeshift.scene.inspection.value_picture import world_points
from tests.support.scene.visited_table import AFTER, BEFORE, splats_of

MADE = Similarity(rotation_of(np.array([0.3, -1.1, 0.2])), np.array([2.0, -0.7, 0.4]), 1.7)


def surface(blocks=BEFORE, seed=0) -> np.ndarray:
    """(n, 3) metres, float64."""
    return splats_of(blocks, False, seed).means.astype(np.float64)[::3]


def test_a_view_shows_in_b_what_it_shows_in_a():
    """A pixel at a depth is one place, whichever world it is asked in."""
    from tests.support.scene.warm_wall import wall_view

    view = wall_view((0.3, 0.4, 1.2))
    pixels, depth = np.array([[10.0, 20.0], [70.5, 33.0]]), np.array([0.9, 1.4])
    in_b = world_points(MADE.view_in_b(view), pixels, depth / MADE.scale)
    np.testing.assert_allclose(MADE.apply(in_b), world_points(view, pixels, depth), atol=1e-9)


def test_one_similarity_after_another():
    other = Similarity(rotation_of(np.array([0.0, 0.4, -0.2])), np.array([0.1, 0.2, 0.3]), 0.4)
    points = np.random.default_rng(0).normal(size=(20, 3))
    np.testing.assert_allclose(MADE.after(other).apply(points), MADE.apply(other.apply(points)))


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.5, np.pi / 2, 3.0])
def test_turns_are_rotations_by_their_angle(angle):
    turn = rotation_of(angle * np.array([0.0, 0.6, 0.8]))
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1)
    # 1e-7 radians: an angle of nearly 0 by its cosine
    assert Similarity(turn, np.zeros(3)).degrees == pytest.approx(np.degrees(angle), abs=1e-5)


def test_normals_of_a_plane_stand_on_it():
    rng = np.random.default_rng(0)
    flat = np.c_[rng.random((300, 2)), np.zeros(300)] @ MADE.rotation.T
    cosine = np.abs(surface_normals(flat) @ MADE.rotation[:, 2])
    assert cosine.min() > 1 - 1e-6


@pytest.mark.parametrize("scaled", [False, True])
def test_closest_points_find_a_small_motion_though_things_changed(scaled):
    """Another scatter of a millimetre, and a tenth of the surface is elsewhere: two millimetres
    are left, and of the scale a thousandth."""
    scale = 1.01 if scaled else 1.0
    made = Similarity(
        rotation_of(np.array([0.02, 0.03, -0.02])), np.array([0.02, -0.02, 0.01]), scale
    )
    a, b_in_a = surface(), surface(AFTER, seed=1)
    b = (b_in_a - made.shift) @ made.rotation / made.scale
    found, residual, shared = fit_surfaces(a, b, Similarity.identity(), 0.7, scaled)
    assert np.linalg.norm(found.apply(b) - b_in_a, axis=1).max() < 0.002
    assert found.scale == pytest.approx(scale, abs=1e-3)
    assert residual < 0.0015 and 0.8 < shared < 0.99


def test_nothing_near_is_no_fit():
    a = surface()
    found, residual, shared = fit_surfaces(a, a + 50.0, Similarity.identity(), 0.7, False)
    assert residual == float("inf") and shared == 0
    np.testing.assert_array_equal(found.shift, 0)
