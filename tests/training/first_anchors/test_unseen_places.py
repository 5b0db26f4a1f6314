"""Starts where cameras look at no one place, and hulls of what was photographed from one side."""

import numpy as np

from shapeshift.scene.pose import View
from shapeshift.training.first_anchors.hull import seen_part, visual_hull
from shapeshift.training.first_anchors.initial import (
    FARTHEST,
    NEAREST,
    RANDOM_POINTS,
    filler_points,
    free_sight,
    points_before,
    random_points,
)
from shapeshift.training.first_anchors.views import common_box, distance_of, pixel_of, seen_first
from shapeshift.training.photos import LoadedPhoto
from tools.synthetic.strangers import KINDS

SIZE = (64, 48)


def views_of(kind: str, count: int = 24) -> list[View]:
    return KINDS[kind].views(count, SIZE)


def photos_of(views: list[View]) -> list[LoadedPhoto]:
    pixels = np.zeros((SIZE[1], SIZE[0], 4), np.uint8)
    return [LoadedPhoto(view, "RGB", pixels, None, f"{i}") for i, view in enumerate(views)]


def depth_in(view: View, points: np.ndarray) -> np.ndarray:
    camera_from_world = view.pinhole()[0]
    return points @ camera_from_world[2, :3] + camera_from_world[2, 3]


def test_a_flight_starts_before_its_cameras_and_in_all_photos_alike():
    views = views_of("aerial")
    points, away = points_before(views, np.random.default_rng(0)), distance_of(views)
    assert np.array_equal(random_points(photos_of(views), np.random.default_rng(0)).shape[1:], (3,))
    assert len(points) > RANDOM_POINTS / 2
    farthest, counts = np.zeros(len(points)), []
    for view in views:
        _, inside = pixel_of(view, points)
        depth = depth_in(view, points[inside])
        assert depth.min() >= 0.99 * NEAREST * away, "nothing right before a camera"
        farthest[inside] = np.maximum(farthest[inside], depth)
        counts.append(inside.sum())
    assert (farthest > 0).all(), "each point is in a photo"
    assert farthest.max() > 0.9 * FARTHEST * away
    # Each photo's own rays are 1/24 of all; some of other photos come into it.
    assert min(counts) > 0.5 * len(points) / len(views)


def test_cameras_that_look_at_one_place_start_within_it():
    views = views_of("object_white")
    points = random_points(photos_of(views), np.random.default_rng(3))
    centre, half = common_box(views)
    assert (np.abs(points - centre) <= half).all()
    seen = np.sum([pixel_of(view, points)[1] for view in views], axis=0)
    assert (seen >= len(views) // 3).all()


def test_of_a_flight_the_common_place_holds_next_to_nothing():
    """What the start along rays is for: of 20,000 places so few would be left."""
    views = views_of("aerial", 48)
    centre, half = common_box(views)
    cloud = centre + half * np.random.default_rng(0).uniform(-1, 1, (RANDOM_POINTS, 3))
    seen = np.sum([pixel_of(view, cloud)[1] for view in views], axis=0)
    assert (seen >= len(views) // 3).sum() < 100
    started = random_points(photos_of(views), np.random.default_rng(0))
    assert len(started) > RANDOM_POINTS / 2


def test_no_guess_stands_right_before_a_camera_that_looks_past_it():
    """In a room, where cameras look across each other's places."""
    views = views_of("room", 40)
    rng = np.random.default_rng(1)
    corner = np.array([2.2, 1.25, 1.8])
    wall = rng.uniform(-1, 1, (600, 3)) * corner + np.array([0, 1.25, 0])
    wall[:, 0] = np.sign(wall[:, 0]) * 2.2
    guesses = filler_points(wall, photos_of(views), rng)
    assert len(guesses) > 1000
    before = 0
    for view in views:
        _, inside = pixel_of(view, wall)
        nearest = np.percentile(depth_in(view, wall[inside]), 5)
        _, seen = pixel_of(view, guesses)
        before += (depth_in(view, guesses[seen]) < nearest / 2).sum()
    assert before == 0
    middle = np.array([[0, 1.25, 0]])  # where nearly all of them look
    assert not free_sight(middle, wall, views)[0]
    assert free_sight(middle + np.array([2.1, 0, 0]), wall, views)[0]
    assert free_sight(middle, wall[:0], views)[0], "without points nothing is near"


def ball(count: int, radius: float) -> np.ndarray:
    """(count, 3) evenly on a ball about the origin."""
    i = np.arange(count) + 0.5
    up, turn = 1 - 2 * i / count, np.pi * (1 + 5**0.5) * i
    level = np.sqrt(1 - up**2)
    return radius * np.stack([level * np.cos(turn), up, level * np.sin(turn)], axis=1)


def test_what_is_seen_of_a_ball_is_the_half_before_the_camera():
    """Against the ball's own geometry: its horizon is where rays touch it."""
    points, edge = ball(4000, 0.3), 0.3 * (4 * np.pi / 4000) ** 0.5
    view = views_of("object_white")[5]
    eye = np.asarray(view.world_from_eye.position)
    centre = np.array([0, 0.22, 0])
    seen = seen_first(points + centre, edge, [view])
    towards = (eye - centre) / np.linalg.norm(eye - centre)
    height = points @ towards / 0.3  # 1: nearest to the eye
    horizon = 0.3 / np.linalg.norm(eye - centre)
    # Steeper than 45 degrees to the view the nearest of nine cells hides its neighbours.
    assert seen[height > 0.75].mean() > 0.9
    assert not seen[height < horizon - 0.45].any()
    views = views_of("object_white")
    spokes = np.array([np.asarray(v.world_from_eye.position) - centre for v in views])
    facing = (points / 0.3 @ (spokes / np.linalg.norm(spokes, axis=1)[:, None]).T).max(axis=1)
    assert seen_first(points + centre, edge, views)[facing > 0.75].mean() > 0.97
    assert not seen_first(points[:0], edge, [view]).size
    assert not seen_first(points + 100 * towards, edge, [view])[height < 0].any()


def test_a_hull_behind_what_was_seen_from_above_is_left_out():
    """A disc at y = 0 from above: its hull is a cone below it, that no photo shows."""
    views = KINDS["twelve"].views(12, SIZE)
    shapes = []
    rows, columns = (g + 0.5 for g in np.mgrid[: SIZE[1], : SIZE[0]])
    for view in views:
        camera_from_world, fx, fy, cx, cy = view.pinhole()
        ray = np.stack([(columns - cx) / fx, (rows - cy) / fy, np.ones_like(rows)], axis=-1)
        ray = ray @ camera_from_world[:3, :3]
        eye = np.asarray(view.world_from_eye.position)
        at = eye + ray * np.where(ray[..., 1] < 0, -eye[1] / ray[..., 1], 0)[..., None]
        shapes.append((view, (ray[..., 1] < 0) & (np.hypot(at[..., 0], at[..., 2]) < 0.6)))
    centre, half = common_box(views)
    hull = visual_hull(shapes, centre, half)
    assert len(hull) > 200
    assert (hull[:, 1] > -0.25).mean() > 0.9
    whole = np.concatenate([hull, hull - np.array([0, 0.5, 0])])
    assert len(seen_part(whole, views)) == len(whole), "of a hull seen for the most part all stays"


def test_a_hull_of_a_point_or_none_is_left_alone():
    views = views_of("object_white")
    for count in (0, 1):
        hull = np.zeros((count, 3))
        assert np.array_equal(seen_part(hull, views), hull)
