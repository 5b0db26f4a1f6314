"""Camera paths of films: constant apparent speed, keys that are met, orders that are ways."""

from itertools import permutations, product
from pathlib import Path

import numpy as np
import pytest

from shapeshift.scene.cameras.framing import orbit_path
from shapeshift.scene.cameras.read_cameras import read_cameras
from shapeshift.scene.film.film_path import (
    Circle,
    FilmKey,
    check_clock,
    check_keys,
    eased_places,
    exact_fps,
    frame_times,
    keyed_places,
)
from shapeshift.scene.film.flight import (
    apparent_steps,
    keyed_flight,
    ordered,
    short_way,
    subject_distance,
    tour,
)
from shapeshift.scene.pose import Pose, View, look_at, perspective

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"
SIZE = (64, 36)
FRAMES, FPS = 300, 30.0


def view_at(eye, target=(0.0, 0.0, 0.0), fov_y=0.8) -> View:
    return View(
        look_at(np.array(eye, float), np.array(target)), perspective(fov_y, SIZE), 0.05, 100, SIZE
    )


def flown(flight, frames: int = FRAMES) -> list[View]:
    places = eased_places(frame_times(frames, frames / FPS), frames / FPS, 0.12)
    return [flight.view(place, SIZE) for place in places.tolist()]


@pytest.mark.parametrize("capture", ["plush_snowmiku", "maryrose_tankard", "fern_llff"])
@pytest.mark.parametrize("shuffled", [False, True], ids=["as taken", "shuffled"])
def test_a_tour_of_a_capture_moves_evenly(capture, shuffled):
    """Bounds: a person sees a speed change by a third, and 3 degrees of a 43 degree picture a
    frame is as fast as films pan.
    """
    file = DATA / capture / "cameras.json"
    if not file.is_file():
        pytest.skip(f"{file} is not here")
    views = read_cameras(file)
    if shuffled:
        views = [views[i] for i in np.random.default_rng(0).permutation(len(views))]
    steps, turns = apparent_steps(flown(tour(views, SIZE)), subject_distance(views))
    middle = steps[FRAMES // 6 : -FRAMES // 6]
    assert middle.max() / np.median(middle) <= 1.3
    assert np.degrees(turns.max()) <= 3.0


def test_a_shaken_circle_becomes_a_circle():
    """Jitter of 3 % of the radius leaves a way of constant radius to 1.5 % and height to 1 %."""
    rng = np.random.default_rng(1)
    angles = np.linspace(0, 1.5 * np.pi, 60)
    circle = np.stack([3 * np.cos(angles), np.ones(60), 3 * np.sin(angles)], 1)
    views = [view_at(eye) for eye in circle + rng.normal(0, 0.03 * 3, (60, 3))]
    path = flown(tour(views, SIZE))
    eyes = np.array([v.world_from_eye.position for v in path])
    radius = np.hypot(eyes[:, 0], eyes[:, 2])[30:-30]
    assert np.ptp(radius) / radius.mean() < 0.06
    looks = -np.array([v.world_from_eye.matrix()[:3, 2] for v in path])
    towards = -eyes / np.linalg.norm(eyes, axis=1, keepdims=True)
    assert np.degrees(np.arccos(np.clip((looks * towards).sum(1), -1, 1))).max() < 3


def test_a_tour_is_level():
    views = [view_at((3 * np.cos(a), 1, 3 * np.sin(a))) for a in np.linspace(0, 3, 30)]
    right = np.array([v.world_from_eye.matrix()[:3, 0] for v in flown(tour(views, SIZE))])
    assert np.abs(right[:, 1]).max() < 0.01


def test_a_capture_from_straight_above_has_no_horizon_and_no_spin():
    down = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)  # columns right, up, back
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([[1, 0, 0], [0, 0, -1], [0, 1, 0]], 1)
    assert np.linalg.det(down) == 1
    views = []
    for x in np.linspace(0, 5, 40):
        matrix[:3, 3] = x, 4, 0.2 * np.sin(x)
        views.append(View(Pose.from_matrix(matrix), perspective(0.8, SIZE), 0.05, 100, SIZE))
    _, turns = apparent_steps(flown(tour(views, SIZE)), 4.0)
    assert np.degrees(turns.max()) < 0.5


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_few_cameras_are_a_way_too(count):
    views = [view_at((np.cos(a), 0.3, np.sin(a))) for a in np.linspace(0, 2, count)]
    path = flown(tour(views, SIZE), 20)
    ends = [path[0].world_from_eye.position, path[-1].world_from_eye.position]
    np.testing.assert_allclose(ends[0], views[0].world_from_eye.position, atol=1e-6)
    np.testing.assert_allclose(ends[1], views[-1].world_from_eye.position, atol=1e-6)


def test_cameras_that_all_stand_in_one_place_stand():
    views = [view_at((0, 0, 2))] * 7
    path = flown(tour(views, SIZE), 10)
    np.testing.assert_allclose(
        [v.world_from_eye.position for v in path], [[0, 0, 2]] * 10, atol=1e-9
    )


def test_cameras_that_look_outwards_have_a_way():
    views = [view_at((0.1 * np.cos(a), 1, 0.1 * np.sin(a)), (5 * np.cos(a), 1, 5 * np.sin(a)))
             for a in np.linspace(0, 5, 50)]  # fmt: skip
    steps, _ = apparent_steps(flown(tour(views, SIZE)), 1.0)
    middle = steps[FRAMES // 6 : -FRAMES // 6]
    assert middle.max() / np.median(middle) < 1.1


def test_no_smoothing_leads_through_every_camera():
    rng = np.random.default_rng(3)
    views = [
        view_at((3 * np.cos(a), 1 + rng.normal(0, 0.1), 3 * np.sin(a)))
        for a in np.linspace(0, 3, 12)
    ]
    eyes = np.array([v.world_from_eye.position for v in flown(tour(views, SIZE, 0.0), 900)])
    for view in views:
        assert np.linalg.norm(eyes - view.world_from_eye.position, axis=1).min() < 0.01


def test_a_keyed_flight_meets_its_keys():
    """Pose and lens of each key, at the place that the flight says, to what its line leaves."""
    keys = [
        view_at((3, 1, 0)),
        view_at((0, 2, 3), fov_y=0.4),
        view_at((-3, 0.2, 0)),
        view_at((-3, 0.2, 0), (0, 1, 1)),
    ]
    flight = keyed_flight(keys)
    for key, place in zip(keys, flight.key_places, strict=True):
        seen = flight.view(float(place), SIZE)
        np.testing.assert_allclose(
            seen.world_from_eye.matrix(), key.world_from_eye.matrix(), atol=0.02
        )
        assert seen.tangents[3] == pytest.approx(key.tangents[3], rel=0.02)


def test_a_keyed_flight_goes_at_constant_speed():
    keys = [view_at((3, 1, 0)), view_at((2.9, 1, 0.5)), view_at((-3, 1, 1)), view_at((-3, 3, -1))]
    views = [keyed_flight(keys).view(p, SIZE) for p in np.linspace(0, 1, 200).tolist()]
    steps, _ = apparent_steps(views, subject_distance(keys))
    assert steps.max() / np.median(steps) < 1.1


@pytest.mark.parametrize("place", [0.0, 1e-9, 0.3, 0.5, 0.99, 1.0, -1.0, 2.0])
def test_a_view_is_that_of_the_whole_spline(place):
    """Near its ends too, where the spline leans on what lies beyond them."""
    from shapeshift.scene.cameras.camera_path import along

    flight = keyed_flight([view_at((3, 1, 0)), view_at((0, 2, 3)), view_at((-3, 0.2, 0))])
    at = np.array([np.clip(place, 0, 1) * (len(flight.eyes) - 1)])
    eye = flight.view(place, SIZE).world_from_eye.position
    np.testing.assert_allclose(eye, along(flight.eyes, at, False)[0], atol=1e-12)


def test_a_short_way_is_the_shortest_of_a_few_points():
    points = np.random.default_rng(5).normal(size=(7, 3))

    def length(order):
        return np.linalg.norm(np.diff(points[list(order)], axis=0), axis=1).sum()

    best = min(map(length, permutations(range(7))))
    order = short_way(points)
    assert sorted(order) == list(range(7))
    assert length(order) <= 1.1 * best


def test_photos_in_order_keep_it_and_others_get_one():
    circle = [view_at((3 * np.cos(a), 1, 3 * np.sin(a))) for a in np.linspace(0, 4, 40)]
    assert ordered(circle) == circle
    mixed = [circle[i] for i in np.random.default_rng(2).permutation(40)]
    found = ordered(mixed)
    assert found in (circle, circle[::-1])


def test_places_are_eased_at_both_ends_and_even_between():
    times = frame_times(1001, 10.0)
    places = eased_places(times, 10.0, 0.1)
    steps = np.diff(places)
    assert places[0] == 0 and places[-1] == pytest.approx(1, abs=1e-12)
    assert (steps >= 0).all()
    np.testing.assert_allclose(steps[150:-150], steps[500], rtol=1e-9)
    assert steps[0] < 1e-3 * steps[500]
    np.testing.assert_allclose(places, 1 - places[::-1], atol=1e-12)


@pytest.mark.parametrize("ease", [0.0, 0.5])
def test_the_ends_of_easing(ease):
    places = eased_places(frame_times(11, 1.0), 1.0, ease)
    assert places[0] == 0 and places[-1] == pytest.approx(1) and (np.diff(places) > 0).all()


def test_a_hold_stands_still():
    places = eased_places(frame_times(101, 10.0), 10.0, 0.1, hold_s=2.0)
    assert (places[:21] == 0).all() and 0 < places[25] < 1
    np.testing.assert_allclose(places[80:], 1, atol=1e-12)


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_the_times_of_few_frames(frames):
    times = frame_times(frames, 5.0)
    assert times[0] == 0 and len(times) == frames
    assert frames == 1 or times[-1] == 5.0
    assert frame_times(4, 8.0, closed=True).tolist() == [0, 2, 4, 6]


def test_timed_keys_are_met_when_they_say():
    view = view_at((0, 0, 1))
    keys = [FilmKey(view, 1.0), FilmKey(view, 2.0, 1.5), FilmKey(view, 5.0)]
    places = np.array([0.0, 0.3, 1.0])
    times = np.array([0, 1, 2, 3, 3.5, 5, 9])
    np.testing.assert_allclose(
        keyed_places(keys, places, times), [0, 0, 0.3, 0.3, 0.3, 1, 1], atol=1e-12
    )
    dense = keyed_places(keys, places, np.linspace(0, 5, 500))
    assert (np.diff(dense) >= -1e-15).all()
    assert keyed_places(keys[:1], places[:1], times).tolist() == [0] * 7


@pytest.mark.parametrize(
    ("times", "said"),
    [([None, 1.0], "some have none"), ([1.0, 1.0], "times must rise"), ([2.0, 1.0], "must rise"),
     ([0.0, 11.0], "ends at 10 s"), ([], "no camera")],
)  # fmt: skip
def test_times_of_keys_that_are_no_order(times, said):
    view = view_at((0, 0, 1))
    with pytest.raises(ValueError, match=said):
        check_keys([FilmKey(view, at) for at in times], 10.0)


@pytest.mark.parametrize(
    ("seconds", "fps", "said"),
    [(0, 30, "seconds"), (float("nan"), 30, "seconds"), (10, 0.99, "fps"), (10, 241, "fps"),
     (10, float("inf"), "fps"), (36_000, 240, "frames")],
)  # fmt: skip
def test_clocks_that_cannot_run(seconds, fps, said):
    with pytest.raises(ValueError, match=said):
        check_clock(seconds, fps)


@pytest.mark.parametrize(
    ("fps", "exact"),
    [(30, (30, 1)), (29.97, (30000, 1001)), (23.976, (24000, 1001)), (12.5, (25, 2))],
)
def test_frame_rates_of_television_are_exact(fps, exact):
    assert exact_fps(fps).as_integer_ratio() == exact


def test_a_circle_comes_back_to_where_it_began():
    first = orbit_path(1, np.array([1.0, 2, 3]), 1.0, SIZE)[0]
    circle = Circle(first, np.array([1.0, 2, 3]))
    for place, size in product((0.0, 1.0), (SIZE, (36, 64))):
        pose = circle.view(place, size).world_from_eye.matrix()
        np.testing.assert_allclose(pose, first.world_from_eye.matrix(), atol=1e-12)
    wanted = orbit_path(8, np.array([1.0, 2, 3]), 1.0, SIZE)
    for k, view in enumerate(wanted):  # the path of `render --camera orbit`
        pose = circle.view(k / 8, SIZE).world_from_eye.matrix()
        np.testing.assert_allclose(pose, view.world_from_eye.matrix(), atol=1e-9)
