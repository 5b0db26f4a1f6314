"""When an order is kept: frames, degrees, changes, and what eyes share."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.settings import RenderSettings
from shapeshift.renderer.sort_policy import SortPolicy, sort_frames
from shapeshift.scene.pose import Pose, View

TANGENTS = (-0.5, 0.5, -0.4, 0.4)


def view(yaw: float = 0.0, position=(0.0, 0.0, 0.0), size=(64, 48)) -> View:
    """Looks along -z, turned by `yaw` degrees about +y."""
    half = np.radians(yaw) / 2
    wxyz = np.array([np.cos(half), 0, np.sin(half), 0])
    return View(Pose(np.array(position, float), wxyz), TANGENTS, 0.1, 50.0, size)


def ages(policy: SortPolicy, views: list[View], settings: RenderSettings, changed=()) -> list[int]:
    """Age of the order in every frame of a film."""
    plans = [
        policy.plan([v], settings, i in changed, lambda frame: 2.0) for i, v in enumerate(views)
    ]
    assert all(p.sorts == (p.age == 0) for p in plans)
    return [p.age for p in plans]


def test_by_default_every_frame_is_sorted_and_holds_only_what_is_seen():
    policy = SortPolicy()
    for _ in range(3):
        plan = policy.plan([view()], RenderSettings(), False, lambda frame: 1.0)
        assert (plan.sorts, plan.age, plan.keep_outside) == (1, 0, False)


def test_every_third_frame():
    assert ages(SortPolicy(), [view()] * 8, RenderSettings(resort_frames=3)) == [0, 1, 2] * 2 + [
        0,
        1,
    ]


def test_never_because_of_frames():
    assert ages(SortPolicy(), [view()] * 5, RenderSettings(resort_frames=0)) == [0, 1, 2, 3, 4]


def test_after_a_turn_measured_from_the_last_sort():
    film = [view(yaw) for yaw in (0, 2, 4, 6, 5, 3, 0.5)]
    settings = RenderSettings(resort_frames=0, resort_degrees=5.0)
    assert ages(SortPolicy(), film, settings) == [0, 1, 2, 0, 1, 2, 0]


def test_frames_or_degrees_whichever_comes_first():
    film = [view(yaw) for yaw in (0, 6, 6, 6, 6)]
    settings = RenderSettings(resort_frames=3, resort_degrees=5.0)
    assert ages(SortPolicy(), film, settings) == [0, 0, 1, 2, 0]


def test_by_distance_it_is_the_eye_that_has_to_move():
    settings = RenderSettings(order="distance", resort_frames=0, resort_degrees=5.0)
    assert ages(SortPolicy(), [view(0), view(90)], settings) == [0, 1]
    step = 2.0 * np.tan(np.radians(5.0))  # seen from the median splat, 2 m away
    film = [view(position=(x * step, 0, 0)) for x in (0, 0.9, 1.1, 1.9, 2.2)]
    assert ages(SortPolicy(), film, settings) == [0, 1, 0, 1, 0]


def test_what_changed_in_the_scene_sorts_anew():
    settings = RenderSettings(resort_frames=0)
    assert ages(SortPolicy(), [view()] * 5, settings, changed={2}) == [0, 1, 0, 1, 2]


@pytest.mark.parametrize(
    "change",
    [{"order": "distance"}, {"key_bits": 16}, {"min_alpha": 0.1}, {"resort_frames": 1}],
    ids=lambda change: next(iter(change)),
)
def test_settings_that_the_order_depends_on_sort_anew(change):
    policy, kept = SortPolicy(), RenderSettings(resort_frames=0)
    asked = [kept, kept, replace(kept, **change), kept, kept, replace(kept, max_pixels=4)]
    plans = [policy.plan([view()], s, False, lambda frame: 1.0) for s in asked]
    assert [p.age for p in plans] == [0, 1, 0, 0, 1, 2]


def test_size_and_number_of_views_sort_anew():
    policy, settings = SortPolicy(), RenderSettings(resort_frames=0)
    groups = [[view()], [view(size=(32, 48))], [view(), view()], [view(), view(0.5)], [view()]]
    plans = [policy.plan(group, settings, False, lambda frame: 1.0) for group in groups]
    assert [p.age for p in plans] == [0, 0, 0, 1, 0]


def test_parallel_eyes_share_the_line_of_sight_and_others_do_not():
    left, right = view(position=(-0.03, 0, 0)), view(position=(0.03, 0.1, 0))
    (centre,) = sort_frames([left, right], RenderSettings())
    np.testing.assert_array_equal(centre[2], left.eye_from_world()[2])  # the very same depths
    np.testing.assert_allclose(centre @ [0, 0.05, 0, 1], [0, 0, 0, 1], atol=1e-12)
    assert len(sort_frames([left, right], RenderSettings(stereo_sort="each"))) == 2
    assert len(sort_frames([left, view(0.99)], RenderSettings())) == 1
    assert len(sort_frames([left, view(1.01)], RenderSettings())) == 2


def test_between_eyes_that_are_turned_a_little_lies_the_mean():
    (centre,) = sort_frames([view(-0.4), view(0.4)], RenderSettings())
    np.testing.assert_allclose(centre[:3, :3], np.eye(3), atol=1e-12)
    (rolled,) = sort_frames([view(0.2), view(0.6)], RenderSettings())
    np.testing.assert_allclose(rolled[:3, :3] @ rolled[:3, :3].T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(rolled[:3, :3], view(0.4).eye_from_world()[:3, :3], atol=1e-9)
