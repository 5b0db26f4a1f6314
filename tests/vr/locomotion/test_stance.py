"""A room moved about the world: what stays where it was, at any scale and turn."""

import math

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.vr.play_space import (
    FAR_M,
    LEAST_SCALE,
    MOST_SCALE,
    PlaySpace,
    heading,
    moved,
    pinned,
    play_space_before,
    resized,
    scaled,
    turned,
    underfoot,
)
from tests.support.vr.vr_frames import at, tilted, yawed

POINTS = np.random.default_rng(3).uniform(-2, 2, (20, 3))  # metres
ANYWHERE = PlaySpace(Pose(np.array([3.0, -1, 7]), yawed(0.7)), 2.5)


def slow_point(play_space: PlaySpace, play: np.ndarray) -> np.ndarray:
    room = play_space.world_from_play
    return room.position + play_space.scale * (room.matrix()[:3, :3] @ play)


@pytest.mark.parametrize("point", POINTS)
def test_the_pivot_stays_and_all_else_turns_about_it(point):
    now = turned(ANYWHERE, 0.4, point)
    assert np.allclose(now.point(point), slow_point(ANYWHERE, point), atol=1e-12)
    other = point + np.array([1, 0.5, 0])
    before, after = (s.point(other) - s.point(point) for s in (ANYWHERE, now))
    assert math.isclose(np.linalg.norm(before), np.linalg.norm(after), rel_tol=1e-12)
    assert before[1] == pytest.approx(after[1])
    swept = math.atan2(after[0], after[2]) - math.atan2(before[0], before[2])
    assert math.remainder(swept - 0.4, math.tau) == pytest.approx(0, abs=1e-12)


def test_left_is_left():
    right = turned(PlaySpace(), math.pi / 2, np.zeros(3)).point(np.array([1.0, 0, 0]))
    assert np.allclose(right, [0, 0, -1])  # what was on the right is ahead: one looks left


@pytest.mark.parametrize("scale", [0.02, 1.0, 40.0])
def test_a_scale_keeps_its_point(scale):
    for point in POINTS:
        now = scaled(ANYWHERE, scale, point)
        assert now.scale == scale
        assert np.allclose(now.point(point), ANYWHERE.point(point), atol=1e-9)


def test_scales_and_places_have_bounds():
    assert scaled(ANYWHERE, 1e9, np.zeros(3)).scale == MOST_SCALE
    assert scaled(ANYWHERE, 0.0, np.zeros(3)).scale == LEAST_SCALE
    far = moved(ANYWHERE, np.array([1e9, 0, -1e9])).world_from_play.position
    assert far.tolist() == [FAR_M, -1, -FAR_M]


def test_feet_stay_on_their_floor():
    head = at(0.4, 1.7, -0.2)
    now = resized(ANYWHERE, head, 1.0)
    assert np.allclose(now.point(underfoot(head)), ANYWHERE.point(underfoot(head)))


def test_pinned():
    now = pinned(ANYWHERE, POINTS[0], np.array([9.0, 8, 7]))
    assert np.allclose(now.point(POINTS[0]), [9, 8, 7])


@pytest.mark.parametrize("angle", [0.0, 1.0, -3.0, math.pi])
@pytest.mark.parametrize("tilt", [0.0, 1.2, -1.2, math.pi / 2, -math.pi / 2])
def test_heading_holds_where_one_looks_up_or_down(angle, tilt):
    level, tilts = (Pose(np.zeros(3), q).matrix() for q in (yawed(angle), tilted(tilt)))
    wxyz = Pose.from_matrix(level @ tilts).wxyz
    assert math.remainder(heading(wxyz) - angle, math.tau) == pytest.approx(0, abs=1e-9)


def test_one_starts_before_the_eye_on_the_floor():
    eye = Pose.from_matrix(
        Pose(np.array([1.0, 5, 2]), yawed(2)).matrix() @ Pose(np.zeros(3), tilted(-0.5)).matrix()
    )
    head = Pose(np.array([0.3, 1.7, -0.4]), yawed(-0.6))
    for scale in (1.0, 0.25):
        play_space = play_space_before(eye, head, -0.7, scale)
        assert np.allclose(play_space.point(head.position), [1, -0.7 + 1.7 * scale, 2])
        looks = play_space.pose(head).matrix()[:3, 2]
        assert math.atan2(looks[0], looks[2]) == pytest.approx(2)
        assert play_space.point(underfoot(head))[1] == pytest.approx(-0.7)
    assert np.allclose(play_space_before(eye, head).point(head.position), [1, 5, 2])
