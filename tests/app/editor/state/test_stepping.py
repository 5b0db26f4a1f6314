"""The cameras that the viewer steps through: order, flight, what of a camera the window shows."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app.editor.state.camera.camera import EditorCamera, Push
from shapeshift.app.editor.state.camera.viewpoint import (
    FLIGHT_S,
    Steps,
    between,
    fitted,
    picture_box,
)
from shapeshift.scene.cameras.camera_list import CameraList
from shapeshift.scene.cameras.framing import orbit_path
from shapeshift.scene.pose import Pose, look_at
from tests.support.scene.camera_files import NAMES, cameras, views

SIZE, FREE = (1280, 720), (292.0, 0.0, 1280.0, 604.0)
NOW = orbit_path(1, np.zeros(3), 1.0, SIZE)[0]


def steps(count: int = 3) -> Steps:
    out = Steps()
    out.set_cameras(cameras(count=count))
    return out


def shown(at: Steps):
    return at.view(SIZE, FREE, 0.01, 200.0)


def test_next_and_previous_go_around():
    at = steps()
    assert at.text == "3 cameras" and not at.at_camera
    order = []
    for by in (1, 1, 1, 1, -1, -1):
        assert at.step(by, NOW)
        order.append(at.index)
    assert order == [0, 1, 2, 0, 2, 1]
    assert at.text == f"camera 2 of 3 {NAMES[1]}"
    at.leave()
    assert at.text == "3 cameras"
    at.step(1, NOW)
    assert at.index == 2  # goes on from where it was left
    other = steps()
    other.step(-1, NOW)
    assert other.index == 2  # the last one first
    assert not Steps().step(1, NOW) and Steps().text == ""
    assert Steps().count == 0 and steps(1).text == "1 camera"


def test_a_long_name_is_cut_at_its_beginning():
    at = Steps()
    at.set_cameras(CameraList(views(1), ("x" * 300 + "/photo.jpg",), "test"))
    at.go_to(0)
    assert at.text.endswith("/photo.jpg") and len(at.text) < 70


def test_a_flight_begins_where_one_was_and_ends_at_the_camera():
    at = steps()
    at.step(1, NOW)
    assert at.moving
    first = shown(at)
    np.testing.assert_allclose(first.world_from_eye.matrix(), NOW.world_from_eye.matrix())
    np.testing.assert_allclose(first.tangents, NOW.tangents)
    places = []
    for _ in range(10):
        at.advance(FLIGHT_S / 9.99)
        places.append(shown(at).world_from_eye.position)
        turn = shown(at).world_from_eye.matrix()[:3, :3]
        np.testing.assert_allclose(turn.T @ turn, np.eye(3), atol=1e-9)
    assert not at.moving
    wanted = at.cameras.views[0].world_from_eye
    np.testing.assert_allclose(places[-1], wanted.position)
    way = np.linalg.norm(np.array(places) - wanted.position, axis=1)
    assert (np.diff(way) <= 1e-9).all()
    at.go_to(1)
    assert not at.moving  # at once


@pytest.mark.parametrize("view", views(8))
def test_the_whole_picture_of_a_camera_lies_in_what_is_free(view):
    seen = fitted(view, SIZE, FREE)
    box = np.array(picture_box(view, seen))
    left, top, right, low = box
    assert FREE[0] - 1e-6 <= left < right <= FREE[2] + 1e-6
    assert FREE[1] - 1e-6 <= top < low <= FREE[3] + 1e-6
    fills = np.isclose([right - left, low - top], [FREE[2] - FREE[0], FREE[3] - FREE[1]])
    assert fills.any()  # as large as may be
    np.testing.assert_allclose(((left + right) / 2, (top + low) / 2), (786, 302))
    l, r, d, u = seen.tangents
    assert (r - l) / SIZE[0] == pytest.approx((u - d) / SIZE[1])  # pixels are square
    assert seen.world_from_eye is view.world_from_eye


def test_between_two_views_half_way():
    one = replace(NOW, world_from_eye=look_at((0, 0, 2), (0, 0, 0)))
    other = replace(NOW, world_from_eye=look_at((2, 0, 0), (0, 0, 0)))
    half = between(one, other, 0.5)
    np.testing.assert_allclose(half.world_from_eye.position, (1, 0, 1))
    forward = -half.world_from_eye.matrix()[:3, 2]
    np.testing.assert_allclose(forward, np.array([-1, 0, -1]) / np.sqrt(2), atol=1e-12)


# The hand's camera takes over where one was left


def hand() -> EditorCamera:
    return EditorCamera(NOW, np.zeros(3), 1.0)


@pytest.mark.parametrize("flying", [False, True])
@pytest.mark.parametrize("view", views(12, seed=3))
def test_the_eye_stays_and_looks_the_same_way(view, flying):
    camera, pose = hand(), view.world_from_eye
    if flying:
        camera.toggle_flying()
    camera.stand(pose, 0.9)
    np.testing.assert_allclose(camera.position, pose.position, atol=1e-9)
    seen = camera.view(SIZE).world_from_eye
    np.testing.assert_allclose(seen.matrix(), pose.matrix(), atol=1e-6)
    assert camera.fov_y == 0.9
    camera.step(5.0)
    axes = camera.view(SIZE).world_from_eye.matrix()[:3, :3]
    np.testing.assert_allclose(axes[:, 2], pose.matrix()[:3, 2], atol=1e-6)
    assert axes[1, 0] == pytest.approx(0, abs=1e-9)  # level
    assert axes[1, 1] * pose.matrix()[1, 1] >= 0  # the nearer way: upside down stays so


def test_upside_down_hands_mean_what_they_see():
    """Dragging to the right turns what is seen to the right, whichever way up."""
    upright = look_at((0, 0, 4), (0, 0, 0))
    turned = Pose(upright.position, np.array([0.0, 0.0, 0.0, 1.0]))  # half a turn about the sight
    point = np.array([0.0, 0.0, 1.0, 1.0])  # nearer than what the orbit goes around
    moved = []
    for pose in (upright, turned):
        camera = hand()
        camera.stand(pose, 0.8)
        camera.turn(-0.1, -0.1)
        camera.step(5.0)
        x, y, z, _ = camera.view(SIZE).eye_from_world() @ point
        moved.append((x / -z, y / -z))
    np.testing.assert_allclose(moved[0], moved[1], atol=1e-9)
    assert moved[0][0] != 0
    camera.step(0.1, Push(up=1.0))
    camera.step(5.0)
    assert camera.position[1] < 0  # up in the picture is down in the world
    camera.reset()
    camera.step(5.0)
    np.testing.assert_allclose(
        camera.view(SIZE).world_from_eye.matrix(), NOW.world_from_eye.matrix(), atol=1e-9
    )
