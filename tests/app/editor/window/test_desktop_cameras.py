"""Cameras and files in the real window under Xvfb: dropping, stepping, leaving, keeping, menus."""

import json
from pathlib import Path

import glfw
import numpy as np
import pytest

from shapeshift.app.editor.state.user.recent import RecentFiles
from shapeshift.app.editor.window.window import Drag, Drop, KeyDown, Wheel
from shapeshift.scene.cameras.read_cameras import read_camera_list
from shapeshift.scene.cameras.write_cameras import write_cameras
from tests.support.desktop.desktop_stand import run_frames, until_opened
from tests.support.desktop.widgets import Widgets
from tests.support.scene.camera_files import NAMES, assert_same, cameras


def press(viewer, key: int, shift: bool = False) -> None:
    viewer.handle_event(KeyDown(key, shift))


def click(viewer, x: float, y: float) -> None:
    window = viewer.window
    window.on_cursor(None, x, y)
    run_frames(viewer, 2)
    for action in (glfw.PRESS, glfw.RELEASE):
        window.on_button(None, glfw.MOUSE_BUTTON_LEFT, action, 0)
        run_frames(viewer, 2)


@pytest.fixture
def dropped(viewer, tmp_path):
    """A viewer that stands at the first of three cameras."""
    path = tmp_path / "ansichten ä.json"
    write_cameras(cameras(), path, "ours")
    viewer.handle_event(Drop((path,)))
    assert "ansichten ä.json" in viewer.state.messages.note
    until_opened(viewer)
    run_frames(viewer, 30)
    return viewer


def test_dropped_cameras_are_stood_at_and_the_scene_stays(dropped):
    viewer = dropped
    assert [obj.name for obj in viewer.state.scene.objects] == ["ball"]
    first = cameras().views[0]
    np.testing.assert_allclose(
        viewer.viewpoint.view().world_from_eye.matrix(), first.world_from_eye.matrix(), atol=1e-9
    )
    assert viewer.viewpoint.steps.text == f"camera 1 of 3 {NAMES[0]}"
    assert not viewer.busy()


def test_n_and_p_step_and_moving_leaves(dropped):
    viewer = dropped
    drawn = viewer.renderer.draws
    press(viewer, glfw.KEY_N)
    run_frames(viewer, 1)
    assert viewer.busy()  # in flight
    run_frames(viewer, 40)
    assert viewer.renderer.draws > drawn + 5 and not viewer.busy()
    assert viewer.viewpoint.steps.index == 1
    press(viewer, glfw.KEY_P)
    press(viewer, glfw.KEY_P)
    run_frames(viewer, 40)
    assert viewer.viewpoint.steps.index == 2
    before = viewer.viewpoint.view()
    viewer.handle_event(Wheel(0.0))  # touches, and moves nothing
    assert not viewer.viewpoint.steps.at_camera
    after = viewer.viewpoint.view()
    np.testing.assert_allclose(
        after.world_from_eye.matrix(), before.world_from_eye.matrix(), atol=1e-6
    )
    heights = [view.tangents[3] - view.tangents[2] for view in (before, after)]
    assert heights[0] == pytest.approx(heights[1])  # the lens stays, too


@pytest.mark.parametrize("event", [Drag("left", 9, 4), Drag("right", 9, 4), Wheel(1.0)])
def test_every_hand_leaves_a_camera(dropped, event):
    dropped.handle_event(event)
    assert not dropped.viewpoint.steps.at_camera and dropped.viewpoint.steps.text == "3 cameras"


@pytest.mark.parametrize("key", [glfw.KEY_V, glfw.KEY_F])
def test_keys_that_move_leave_a_camera(dropped, key):
    press(dropped, key)
    run_frames(dropped, 3)
    assert not dropped.viewpoint.steps.at_camera


def test_without_cameras_n_says_so(viewer):
    press(viewer, glfw.KEY_N)
    assert "no cameras" in viewer.state.messages.note and not viewer.viewpoint.steps.at_camera


def test_k_keeps_views_in_one_file_of_this_start(dropped):
    viewer = dropped
    folder = viewer.options.pictures
    folder.mkdir()
    (folder / "views-0001.ours.json").write_text("mine")
    press(viewer, glfw.KEY_K)
    press(viewer, glfw.KEY_N)
    run_frames(viewer, 40)
    press(viewer, glfw.KEY_K)
    viewer.handle_event(Drag("left", 50, 4))
    run_frames(viewer, 60)
    press(viewer, glfw.KEY_K)
    assert str((folder / "views-0002.ours.json").absolute()) in viewer.state.messages.note
    kept = read_camera_list(folder / "views-0002.ours.json").views
    assert_same(kept[:2], cameras().views[:2])
    left, right, low, high = kept[2].tangents
    assert left == pytest.approx(-right) and low == pytest.approx(-high)
    np.testing.assert_allclose(
        kept[2].world_from_eye.matrix(), viewer.viewpoint.view().world_from_eye.matrix(), atol=1e-9
    )
    viewer.viewpoint.kept.form = "colmap-bin"
    press(viewer, glfw.KEY_K)
    assert len(read_camera_list(folder / "views-0002").views) == 4
    viewer.viewpoint.kept.form = "nerfstudio"  # which cannot hold pictures of several sizes
    press(viewer, glfw.KEY_K)
    assert "camera path cannot" in viewer.state.problem and len(viewer.viewpoint.kept.views) == 4
    assert (folder / "views-0001.ours.json").read_text() == "mine"


def test_a_scene_and_its_cameras_dropped_together(viewer, tmp_path):
    scene, path = tmp_path / "stuhl äöü.shift", tmp_path / "c.json"
    scene.write_bytes(b"scene")
    write_cameras(cameras(), path, "inria")
    viewer.handle_event(Drop((path, scene)))
    until_opened(viewer)
    assert viewer.state.scene.objects[0].name == "stuhl äöü"
    assert viewer.viewpoint.steps.text == "3 cameras"  # the new scene is seen whole first
    viewer.handle_event(Drop((scene,)))
    until_opened(viewer)
    assert viewer.viewpoint.steps.count == 0  # those were of the other


def test_a_floor_beside_a_scene_is_stood_on(viewer, tmp_path):
    scene = tmp_path / "room.shift"
    scene.write_bytes(b"scene")
    write_cameras(cameras(plain=True), tmp_path / "room_vr.json", "vr")
    (stood,) = read_camera_list(tmp_path / "room_vr.json").views
    viewer.handle_event(Drop((scene,)))
    until_opened(viewer)
    run_frames(viewer, 30)
    assert viewer.viewpoint.camera.flying
    np.testing.assert_allclose(
        viewer.viewpoint.view().world_from_eye.matrix(), stood.world_from_eye.matrix(), atol=1e-6
    )


def test_recent_files_are_kept_and_offered(viewer, tmp_path, monkeypatch):
    widgets = Widgets(monkeypatch)
    viewer.files.recent = RecentFiles.read(tmp_path / "settings")
    scene, gone = tmp_path / "one.shift", tmp_path / "gone.shift"
    for path in (gone, scene):
        path.write_bytes(b"scene")
        viewer.handle_event(Drop((path,)))
        until_opened(viewer)
    assert viewer.files.recent.paths == (scene, gone)
    before = viewer.state.scene
    gone.unlink()
    run_frames(viewer, 2)
    click(viewer, *widgets.middle("Recent"))
    assert viewer.window.popup_open  # the list is open
    click(viewer, *widgets.middle("gone.shift"))  # which is not there any more
    assert not viewer.files.busy and viewer.window.popup_open
    click(viewer, *widgets.middle("one.shift"))
    until_opened(viewer)
    assert viewer.state.scene.objects[0].name == "one" and not viewer.state.problem
    assert viewer.state.scene is not before
    assert not viewer.window.popup_open
    told = json.loads((tmp_path / "settings/recent.json").read_text())
    assert told["recent"] == [str(scene), str(gone)]


def test_a_list_that_cannot_be_kept_is_said_once(viewer, tmp_path):
    blocked = tmp_path / "a file"
    blocked.write_bytes(b"")
    viewer.files.recent = RecentFiles.read(blocked)
    viewer.files.remember(Path("a"))
    assert "cannot be kept" in viewer.state.problem and viewer.files.recent is None


def test_the_status_line_is_there_with_the_overlay(viewer):
    left, top, right, low = viewer.window.covered[2]
    width, height = viewer.window.logical_size
    assert (left, right, low) == (0, width, height) and 20 <= low - top <= 40
    viewer.window.begin_frame()
    viewer.draw_splats()
    viewer.draw_overlay()
    viewer.window.end_frame()
    line = viewer.window.picture()[int(top) : int(low)].astype(int)
    assert (line.max(axis=2) > 120).sum() > 40  # letters
