"""Hulls: no finer than the photos, and without photos that contradict the others."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.scene.pose import View
from shapeshift.training.first_anchors.hull import (
    FINE_SIDE,
    FINEST,
    Silhouette,
    contradicting,
    median_neighbour,
    uncovered,
    visual_hull,
    visual_hulls,
)
from shapeshift.training.first_anchors.views import common_box, pixel_of, pixel_size
from shapeshift.training.photos import LoadedPhoto
from tools.synthetic.strangers import KINDS

RNG = np.random.default_rng
CENTRE, RADIUS = np.array([0, 0.22, 0]), 0.3
SIZE = (64, 48)


def ball_in(view: View, centre: np.ndarray = CENTRE) -> np.ndarray:
    """(H, W) bool which rays of a view meet the ball."""
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    rows, columns = (g + 0.5 for g in np.mgrid[: view.size[1], : view.size[0]])
    ray = np.stack([(columns - cx) / fx, (rows - cy) / fy, np.ones_like(rows)], axis=-1)
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    towards = camera_from_world[:3, :3] @ centre + camera_from_world[:3, 3]
    along = ray @ towards
    return (along > 0) & (towards @ towards - along**2 < RADIUS**2)


def ball_photos(count: int, wrong: dict[int, np.ndarray], size=SIZE) -> list[Silhouette]:
    """Silhouettes of the ball from all around; some show it a shift from where it is."""
    views = KINDS["object_white"].views(count, size)
    nowhere = np.zeros(3)
    return [(v, ball_in(v, CENTRE + wrong.get(i, nowhere))) for i, v in enumerate(views)]


def test_a_pixel_wide_step_moves_a_point_by_one_pixel():
    """The size of a pixel against the projection, sideways at the depth of a point."""
    view = KINDS["object_white"].views(8, SIZE)[3]
    inward = RNG(0).uniform(-0.2, 0.2, (50, 3)) + CENTRE
    right = view.world_from_eye.matrix()[:3, 0]
    size = pixel_size(inward, [view])
    before, after = (pixel_of(view, p)[0] for p in (inward, inward + size[:, None] * right))
    np.testing.assert_allclose(after - before, np.tile([1.0, 0.0], (50, 1)), atol=1e-9)


def test_the_finest_view_counts_and_none_is_infinite():
    views = KINDS["object_white"].views(8, SIZE)
    near = replace(views[3], size=(640, 480))
    one, both = pixel_size(CENTRE[None], views[3:4]), pixel_size(CENTRE[None], [views[3], near])
    assert both[0] == pytest.approx(one[0] / 10)
    behind = np.asarray(views[3].world_from_eye.position)[None] * 3
    assert np.isinf(pixel_size(behind, views[3:4])).all()
    assert pixel_size(np.zeros((0, 3)), views).shape == (0,)


def test_cells_of_a_hull_are_no_finer_than_the_photos():
    photos = ball_photos(40, {})
    centre, half = common_box([view for view, _ in photos])
    hull = visual_hull(photos, centre, half)
    pixel = np.median(pixel_size(hull, [view for view, _ in photos]))
    # The coarse hull, whose pixel it goes by, is up to one of its cells larger.
    assert median_neighbour(hull, RNG(0)) == pytest.approx(FINEST * pixel, rel=0.1)
    away = np.abs(np.linalg.norm(hull - CENTRE, axis=1) - RADIUS)
    assert np.percentile(away, 95) < 1.5 * FINEST * pixel


def test_of_large_photos_the_grid_decides():
    photos = ball_photos(24, {}, (1280, 960))
    centre, half = common_box([view for view, _ in photos])
    hull = visual_hull(photos, centre, half)
    extent = np.ptp(hull, axis=0).max()
    assert median_neighbour(hull, RNG(0)) < 1.3 * extent / (FINE_SIDE - 2 * 10)
    assert len(hull) > 6000


@pytest.mark.parametrize("wrong", [[], [7], [0, 20], [3, 11, 12, 39]])
def test_photos_that_show_the_object_elsewhere_are_found(wrong):
    aside = np.array([0.25, 0, 0.1])
    photos = ball_photos(40, {i: aside * (-1) ** i for i in wrong})
    assert contradicting(photos, *common_box([view for view, _ in photos])) == set(wrong)


def test_more_than_a_tenth_are_no_outliers():
    photos = ball_photos(20, {i: np.array([0.25, 0, 0.1 * i]) for i in (1, 5, 9)})
    assert contradicting(photos, *common_box([view for view, _ in photos])) == set()


def test_a_photo_of_another_distance_is_found_by_what_it_denies():
    """Its silhouette lies within the hull's, and is smaller."""
    photos = ball_photos(40, {})
    view, _ = photos[5]
    back = view.world_from_eye.matrix()[:3, 2]
    photos[5] = view, ball_in(view, CENTRE - 1.2 * back)
    assert photos[5][1].sum() < 0.5 * ball_in(view).sum()
    assert contradicting(photos, *common_box([v for v, _ in photos])) == {5}


def test_silhouettes_are_covered_by_the_hull_and_by_nothing_else():
    photos = ball_photos(24, {})
    centre, half = common_box([view for view, _ in photos])
    hull = visual_hull(photos, centre, half)
    edge = median_neighbour(hull, RNG(0))
    assert (uncovered(photos, hull, edge) < 0.02).all()
    assert (uncovered(photos, hull + np.array([0, 3.0, 0]), edge) == 1).all()
    assert (uncovered(photos, np.zeros((0, 3)), edge) == 1).all()
    empty = [(view, np.zeros_like(shape)) for view, shape in photos]
    assert (uncovered(empty, hull, edge) == 0).all(), "nothing is shown, nothing lacks"


def loaded(photos: list[Silhouette]) -> list[LoadedPhoto]:
    out = []
    for number, (view, shape) in enumerate(photos):
        rgba = np.repeat(np.where(shape, 255, 0).astype(np.uint8)[..., None], 4, axis=2)
        out.append(LoadedPhoto(view, "RGB", rgba, None, f"/somewhere/{number:02}.png"))
    return out


def test_the_hull_is_that_of_the_photos_that_agree_and_the_others_are_named():
    shift = {4: np.array([0.25, 0, 0]), 9: np.array([0, 0.3, 0])}
    photos = ball_photos(30, shift)
    (hull,), (doubt,) = visual_hulls(loaded(photos), None)
    right = [photo for i, photo in enumerate(photos) if i not in shift]
    box = common_box([view for view, _ in photos])
    assert np.array_equal(hull, visual_hull(right, *box))
    assert doubt.startswith("RGB: 04.png, 09.png show the subject")
    (alone,), doubts = visual_hulls(loaded(right), None)
    assert doubts == () and len(alone)
