"""The first anchors keep what points say: their density, distances, surfaces and colours."""

import numpy as np
import pytest

from shapeshift.runtime_models.rotation import rotation_matrices
from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training.first_anchors.first_anchors import (
    FLATNESS,
    SIZES,
    cap_of_shapes,
    choose_positions,
    first_anchors,
    neighbour_distance,
    photo_colors,
    subsample,
    surface_axes,
)
from shapeshift.training.first_anchors.initial import GUESSES, InitialPoints
from shapeshift.training.photos import LoadedPhoto

RNG = np.random.default_rng
GRID = np.stack(np.meshgrid(*[np.arange(6.0)] * 3), axis=-1).reshape(-1, 3)


def sphere(count: int) -> np.ndarray:
    """(count, 3) even places on a sphere of radius 1, a spiral from pole to pole."""
    up = 1 - 2 * (np.arange(count) + 0.5) / count
    turn = np.pi * (1 + 5**0.5) * np.arange(count)
    around = np.sqrt(1 - up**2)
    return np.stack([around * np.cos(turn), up, around * np.sin(turn)], axis=1)


def first_of(points: np.ndarray, guesses: np.ndarray | None = None) -> InitialPoints:
    guesses = np.zeros((0, 3)) if guesses is None else guesses
    return InitialPoints(points, "points", (points,), guesses)


def rows_of(found: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Which of the points each one is."""
    return np.array([np.flatnonzero((points == place).all(axis=1))[0] for place in found])


@pytest.mark.parametrize("most", [1, 2, 3, 99, 100, 101, 999, 1000, 1001])
def test_as_many_different_points_as_asked_for_or_all(most):
    points = RNG(0).normal(size=(1000, 3))
    found = rows_of(subsample(points, most), points)
    assert len(np.unique(found)) == len(found) == min(most, 1000)


def test_places_are_as_dense_as_points():
    dense, thin = RNG(0).random((9000, 3)), 5 + RNG(1).random((1000, 3))
    found = subsample(np.concatenate([thin, dense]), 200)
    assert (found[:, 0] > 3).sum() == 20


def test_places_are_even_where_points_are():
    """Each stands for as many points: nearest neighbours of places differ less than by chance."""
    points = RNG(0).random((8000, 3))
    even, chance = subsample(points, 500), points[RNG(1).choice(8000, 500, replace=False)]
    kept, drawn = (neighbour_distance(p) for p in (even, chance))
    assert kept.std() / kept.mean() < 0.7 * drawn.std() / drawn.mean()


def test_a_size_is_the_distance_to_the_neighbours():
    np.testing.assert_allclose(neighbour_distance(GRID * 0.25), 0.25, rtol=1e-12)
    pair = np.array([[0.0, 0, 0], [0, 3, 4]])
    np.testing.assert_allclose(neighbour_distance(pair), 5, rtol=1e-12)
    assert neighbour_distance(np.zeros((1, 3))).tolist() == [1]


def test_axes_of_a_plane_have_its_normal_as_the_thinnest():
    rng = RNG(0)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    flat = np.concatenate([rng.random((2000, 2)), np.zeros((2000, 1))], axis=1) @ turn.T
    factors, wxyz = surface_axes(flat[::20], flat)
    matrices = rotation_matrices(wxyz)
    np.testing.assert_allclose(np.linalg.det(matrices), 1, atol=1e-9)
    np.testing.assert_allclose(np.abs(matrices[:, :, 0] @ turn[:, 2]), 1, atol=1e-6)
    assert (factors[:, 0] == FLATNESS[0]).all() and (factors[:, 1:] > 1).all()


def test_points_all_about_give_hardly_any_axis():
    factors, _ = surface_axes(GRID[86:87], GRID)  # inside: its neighbours lie in all directions
    assert factors.min() > 0.6 and factors.max() < 1.5


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_points_have_no_surface(count):
    factors, wxyz = surface_axes(GRID[:count], GRID[:count])
    assert (factors == 1).all() and (wxyz == (1, 0, 0, 0)).all()


def photo_of(rgb: tuple[int, int, int], alpha: int = 255) -> LoadedPhoto:
    view = View(look_at((0, 0, 5), (0, 0, 0)), perspective(0.5, (32, 24)), 0.05, 100.0, (32, 24))
    rgba = np.zeros((24, 32, 4), np.uint8)
    rgba[..., :3], rgba[..., 3] = rgb, alpha
    return LoadedPhoto(view, "RGB", rgba, None, "p")


def test_colours_are_the_mean_of_what_photos_show():
    places = np.array([[0.0, 0, 0], [0, 0, 9]])  # the second stands behind the eye
    photos = [photo_of((255, 0, 51)), photo_of((0, 0, 51))]
    np.testing.assert_allclose(photo_colors(places, photos, (0, 0, 0))[0], [0.5, 0, 0.2])
    np.testing.assert_allclose(photo_colors(places, photos, (0, 0, 0))[1], 0.5)
    through = photo_colors(places, [photo_of((255, 0, 51), 0)], (0, 1, 0))
    np.testing.assert_allclose(through[0], [0, 1, 0])


def test_guesses_get_their_share_at_most():
    points, guesses = RNG(0).random((3000, 3)), RNG(1).random((2000, 3)) + 10
    places = choose_positions(first_of(points, guesses), 1000)
    assert len(places) == 1000
    assert (places[:, 0] > 5).sum() == GUESSES * 1000
    assert len(choose_positions(first_of(points, guesses[:7]), 10_000)) == 3007


def test_a_small_shape_within_a_large_one_has_as_many_places_as_alone():
    """Guesses of several shapes; where two are the same, the places are there once."""
    small = 0.3 * sphere(2000)
    large, same, points = sphere(8000), sphere(8000), np.zeros((20, 3))
    shapes = (small, large, same)
    first = InitialPoints(points, "points", (points,), np.concatenate(shapes), 0.3, shapes)
    distance = np.linalg.norm(choose_positions(first, 1000)[1:], axis=1)  # all points are one
    inner = (distance < 0.5).sum()
    assert inner == 300 and 300 <= (distance > 0.5).sum() <= 400
    crowd = first._replace(points=RNG(2).random((5000, 3)) + 10)  # points keep their share
    places = choose_positions(crowd, 1000)
    assert len(places) == 1000 and (places[:, 0] > 5).sum() == 700
    alone = choose_positions(first._replace(guesses=small, guess_shapes=(small,)), 1000)
    one = choose_positions(first._replace(guesses=small, guess_shapes=()), 1000)
    np.testing.assert_array_equal(alone, one)


def hulls_of(*shapes: np.ndarray) -> InitialPoints:
    """Hulls beside twenty triangulated points."""
    points = RNG(3).random((20, 3))
    return InitialPoints(points, "points", (points,), np.concatenate(shapes), 0.3, shapes)


def test_a_cap_counts_the_shapes_that_hulls_are():
    """Layers one within the other, one that two stops share, and halves of one."""
    small, large = 0.3 * sphere(2000), sphere(8000)
    assert cap_of_shapes(hulls_of(small, large), 1000) == 2000
    assert cap_of_shapes(hulls_of(small, 2 * sphere(4000), large), 1000) == 3000
    assert cap_of_shapes(hulls_of(large, large.copy()), 1000) == 1000
    assert cap_of_shapes(hulls_of(small, large, large.copy()), 1000) == 2000
    turned = large @ np.linalg.qr(RNG(5).normal(size=(3, 3)))[0]  # the same shape, other points
    assert cap_of_shapes(hulls_of(large, turned), 1000) == 1000
    for apart, shapes in ((0.24, 1), (0.26, 2)):  # on either side of a quarter
        low = np.quantile(large[:, 1], apart)
        moved = np.where(large[:, 1:2] < low, large - (0, 9, 0), large)
        assert cap_of_shapes(hulls_of(large, moved), 1000) == 1000 * shapes
    assert cap_of_shapes(hulls_of(small, large)._replace(guess_shapes=()), 1000) == 1000


@pytest.mark.parametrize("most", [1, 3, 4, 100])
def test_a_cap_is_never_less_than_it_was(most):
    """One shape, none, and a share that is less than an anchor (of 3 and fewer)."""
    both = hulls_of(sphere(50), sphere(50) + 9)
    assert cap_of_shapes(first_of(GRID), most) == most
    assert cap_of_shapes(hulls_of(sphere(50)), most) == most
    assert cap_of_shapes(both, most) == (2 * most if most > 3 else most)
    places = first_anchors(both, most, [photo_of((9, 9, 9))], None, by_shape=True)
    assert places.most == cap_of_shapes(both, most) and len(places.anchors) <= places.most
    assert first_anchors(both, most, [photo_of((9, 9, 9))], None).most == most


def test_what_the_optimiser_starts_with():
    points = GRID * 0.2
    start = first_anchors(first_of(points), 10**6, [photo_of((255, 128, 0))], None)
    assert start.voxel == pytest.approx(0.2) and len(start.anchors) == len(points)
    sizes = np.exp(start.frames[:, :3])
    inner = (np.abs(start.anchors - 0.5) < 0.35).all(axis=1)
    np.testing.assert_allclose(np.prod(sizes[inner], axis=1), 1, rtol=0.3)
    np.testing.assert_allclose(np.linalg.norm(start.frames[:, 3:], axis=1), 1, rtol=1e-6)
    colors = 1 / (1 + np.exp(-start.colors[np.abs(start.anchors).max(axis=1) < 0.5]))
    np.testing.assert_allclose(colors, [[0.98, 128 / 255, 0.02]] * len(colors), rtol=1e-5)


@pytest.mark.parametrize("points", [
    np.zeros((50, 3)), np.tile(GRID[:4], (30, 1)), np.full((9, 3), 1e6),
    np.concatenate([GRID, np.full((1, 3), 1e8)]), GRID[:1], GRID[:2] * 1e-12,
])  # fmt: skip
def test_points_that_coincide_or_lie_very_far_give_finite_anchors(points):
    start = first_anchors(first_of(points), 100, [photo_of((9, 9, 9))], None)
    assert all(np.isfinite(array).all() for array in start[:3]) and start.voxel > 0
    assert len(start.anchors) == min(len(np.unique(points, axis=0)), 100)
    assert np.abs(start.frames[:, :3]).max() <= np.log(SIZES * FLATNESS[1]) + 1e-6
