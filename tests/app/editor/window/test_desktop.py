"""The real window under Xvfb: what is drawn when, keys and mouse, files dropped and saved."""

import time
from pathlib import Path

import glfw
import numpy as np
import pytest
from PIL import Image

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.window import hands
from shapeshift.app.editor.window.window import DoubleClick, Drag, Drop, KeyDown, Press, Wheel
from shapeshift.renderer.settings import RenderSettings
from tests.support.desktop.desktop_stand import read_stub, run_frames, until_opened


def press(viewer, key: int, shift: bool = False) -> None:
    viewer.handle_event(KeyDown(key, shift))


def bright(picture: np.ndarray, box: tuple) -> float:
    """How many pixels of a box (left, top, right, bottom) differ from the box's first pixel."""
    left, top, right, bottom = box
    part = picture[top:bottom, left:right].astype(int)
    return float((np.abs(part - part[0, 0]).max(axis=2) > 24).mean())


def screenshot(viewer) -> np.ndarray:
    viewer.window.begin_frame()
    viewer.draw_splats()
    viewer.draw_overlay()
    viewer.window.end_frame()
    return viewer.window.picture().copy()


# What is drawn, and when


def test_at_rest_nothing_is_drawn_and_the_loop_sleeps(viewer):
    drawn = viewer.renderer.draws
    run_frames(viewer, 5)
    assert viewer.renderer.draws == drawn  # the overlay alone: the splats are only shown again
    assert not viewer.busy()
    start, cpu = time.perf_counter(), time.process_time()
    while viewer.window.wait(0.2):
        viewer.frame(0.0)
        start, cpu = time.perf_counter(), time.process_time()
    assert time.perf_counter() - start >= 0.19
    assert time.process_time() - cpu < 0.15  # of the wait alone, on a slow machine, too


@pytest.mark.parametrize(
    "event",
    [Drag("left", 30, 4), Drag("right", 30, 4), Wheel(1), KeyDown(glfw.KEY_2, False)],
    ids=lambda e: type(e).__name__,
)
def test_a_change_draws_until_it_has_come_to_rest(viewer, event):
    drawn = viewer.renderer.draws
    viewer.handle_event(event)
    run_frames(viewer, 60)
    assert drawn < viewer.renderer.draws < drawn + 60
    assert not viewer.busy()


def test_the_background_needs_no_new_splats(viewer):
    drawn = viewer.renderer.draws
    viewer.state.settings = RenderSettings(background=(1.0, 0.0, 0.0))
    run_frames(viewer, 1)
    assert viewer.renderer.draws == drawn
    assert viewer.renderer.settings.background == (1.0, 0.0, 0.0)


def test_thresholds_do(viewer):
    drawn = viewer.renderer.draws
    viewer.state.settings = RenderSettings(max_pixels=10.0)
    run_frames(viewer, 1)
    assert viewer.renderer.draws == drawn + 1


# Keys


def test_number_keys_go_to_stops_and_stop_playing(viewer):
    press(viewer, glfw.KEY_SPACE)
    assert viewer.state.playing
    press(viewer, glfw.KEY_2)
    assert not viewer.state.sweeps[0].playing
    run_frames(viewer, 2, seconds=0.5)
    assert viewer.state.scene.objects[0].x == 1.0 and not viewer.state.playing
    press(viewer, glfw.KEY_1)
    run_frames(viewer, 1, seconds=0.3)
    assert 0 < viewer.state.scene.objects[0].x < 1
    run_frames(viewer, 1, seconds=0.4)
    assert viewer.state.scene.objects[0].x == 0.0
    press(viewer, glfw.KEY_9)  # there is no ninth stop
    assert viewer.state.scene.objects[0].x == 0.0


def test_play_is_of_time_and_keeps_its_place(viewer):
    press(viewer, glfw.KEY_SPACE)
    run_frames(viewer, 2, seconds=1.0)
    place = viewer.state.scene.objects[0].x
    assert 0 < place < 1
    press(viewer, glfw.KEY_SPACE)
    run_frames(viewer, 5, seconds=1.0)
    assert viewer.state.scene.objects[0].x == place
    press(viewer, glfw.KEY_SPACE)
    run_frames(viewer, 1, seconds=0.0)
    assert viewer.state.scene.objects[0].x == pytest.approx(place)
    many, few = viewer.state.sweeps[0], EditorState(read_stub)
    few.open([Path("ball.shift")])
    few.toggle_play()
    few.advance(2.0)
    assert few.scene.objects[0].x == pytest.approx(place)
    assert many.playing


def test_fly_frame_reset_and_hide(viewer):
    first = viewer.viewpoint.view().eye_from_world()
    press(viewer, glfw.KEY_V)
    assert viewer.viewpoint.camera.flying
    viewer.handle_event(Drag("left", 200, 10))
    run_frames(viewer, 60)
    assert np.abs(viewer.viewpoint.view().eye_from_world() - first).max() > 0.1
    press(viewer, glfw.KEY_F, shift=True)
    press(viewer, glfw.KEY_V)
    run_frames(viewer, 60)
    np.testing.assert_allclose(viewer.viewpoint.view().eye_from_world(), first, atol=1e-6)
    viewer.state.say("")  # what the keys said
    with_overlay = screenshot(viewer)
    press(viewer, glfw.KEY_H)
    run_frames(viewer, 60)
    without = screenshot(viewer)
    assert (
        len(np.unique(without.reshape(-1, 3), axis=0))
        == 1
        < len(np.unique(with_overlay.reshape(-1, 3), axis=0))
    )
    left, right, down, up = viewer.viewpoint.view().tangents
    assert left == pytest.approx(-right) and down == pytest.approx(-up)  # the whole window again


def test_double_click_centres_the_near_side_under_the_cursor(viewer):
    width, _ = viewer.window.logical_size
    left, top, right, bottom = viewer.viewpoint.free
    viewer.handle_event(DoubleClick((left + right) / 2 + 40, (top + bottom) / 2 - 30))
    run_frames(viewer, 60)
    point = viewer.viewpoint.camera.target
    assert np.linalg.norm(point) == pytest.approx(1, abs=0.1)  # on the ball
    assert point[0] > 0.05 and point[1] > 0.05
    viewer.handle_event(DoubleClick(width - 1, 1))  # the empty corner: nothing happens
    assert not viewer.busy()


# Mouse and keyboard as glfw reports them


def glfw_click(window, x, y, button=glfw.MOUSE_BUTTON_LEFT):
    window.on_cursor(None, x, y)
    window.on_button(None, button, glfw.PRESS, 0)


def glfw_release(window, button=glfw.MOUSE_BUTTON_LEFT):
    window.on_button(None, button, glfw.RELEASE, 0)


def test_a_drag_in_the_scene_turns_the_camera_and_one_on_the_panel_does_not(viewer):
    before = viewer.viewpoint.view().eye_from_world()
    glfw_click(viewer.window, 60, 40)  # on the panel
    viewer.window.on_cursor(None, 120, 90)
    glfw_release(viewer.window)
    run_frames(viewer, 30)
    np.testing.assert_array_equal(viewer.viewpoint.view().eye_from_world(), before)
    glfw_click(viewer.window, 600, 200)
    viewer.window.on_cursor(None, 660, 200)
    glfw_release(viewer.window)
    viewer.window.on_cursor(None, 800, 300)  # no button is down any more
    run_frames(viewer, 60)
    centre = viewer.state.centre
    eyes = [np.linalg.inv(before)[:3, 3], viewer.viewpoint.view().world_from_eye.position]
    one, other = (eye - centre for eye in eyes)
    assert np.linalg.norm(one) == pytest.approx(np.linalg.norm(other))
    angle = np.arctan2(one[0], one[2]) - np.arctan2(other[0], other[2])
    assert angle == pytest.approx(60 * hands.TURN)


def test_the_slider_follows_the_mouse_and_snaps(viewer):
    left, top, right, bottom = viewer.window.covered[1]
    start, end = left + 64, right - 74  # roughly the track
    y = (top + bottom) / 2 + 8
    middle, before = (start + end) / 2, viewer.viewpoint.view().eye_from_world()
    glfw_click(viewer.window, middle, y)
    run_frames(viewer, 4)
    x = viewer.state.scene.objects[0].x
    assert 0.4 < x < 0.6
    viewer.window.on_cursor(None, end - 4, y)
    run_frames(viewer, 4)
    assert viewer.state.scene.objects[0].x == 1.0  # caught by the stop
    glfw_release(viewer.window)
    run_frames(viewer, 4)
    assert viewer.state.scene.objects[0].x == 1.0
    np.testing.assert_array_equal(viewer.viewpoint.view().eye_from_world(), before)


def test_alt_lets_the_slider_stand_beside_a_stop(viewer, monkeypatch):
    left, top, right, bottom = viewer.window.covered[1]
    y = (top + bottom) / 2 + 8
    monkeypatch.setattr(glfw, "get_key", lambda _, key: int(key == glfw.KEY_LEFT_ALT))
    glfw_click(viewer.window, right - 120, y)
    found = []
    for x in np.arange(right - 100, right - 70, 1.5):
        viewer.window.on_cursor(None, x, y)
        run_frames(viewer, 3)
        found.append(viewer.state.scene.objects[0].x)
    glfw_release(viewer.window)
    monkeypatch.undo()
    run_frames(viewer, 3)
    assert any(0.981 < x < 0.9999 for x in found)
    assert (np.diff(found) >= 0).all() and left < x


@pytest.mark.parametrize(
    ("seconds_between", "moved", "double"), [(0.1, 0, True), (0.1, 50, False), (0.6, 0, False)]
)
def test_two_quick_clicks_on_one_place_are_a_double_click(
    viewer, monkeypatch, seconds_between, moved, double
):
    now = [1000.0]
    monkeypatch.setattr(glfw, "get_time", lambda: now[0])
    for x in (600, 600 + moved):
        glfw_click(viewer.window, x, 200)
        glfw_release(viewer.window)
        now[0] += seconds_between
    events = []
    monkeypatch.setattr(viewer, "handle_event", events.append)
    run_frames(viewer, 1)
    assert sum(isinstance(event, DoubleClick) for event in events) == double


def test_a_click_on_a_panel_between_two_quick_ones_makes_them_two_clicks(viewer, monkeypatch):
    monkeypatch.setattr(glfw, "get_time", lambda: 1000.0)
    left, top, right, bottom = next(iter(viewer.window.covered))
    for x, y in ((600, 200), ((left + right) / 2, (top + bottom) / 2), (600, 200)):
        glfw_click(viewer.window, x, y)
        glfw_release(viewer.window)
    events = []
    monkeypatch.setattr(viewer, "handle_event", events.append)
    run_frames(viewer, 1)
    assert sum(isinstance(event, Press) for event in events) == 2
    assert not any(isinstance(event, DoubleClick) for event in events)


# Files and pictures


def test_a_dropped_bad_file_is_told_and_the_old_scene_stays(viewer):
    before, camera = viewer.state.scene, viewer.viewpoint.camera
    viewer.handle_event(Drop((Path("bad.shift"),)))
    assert "bad.shift" in viewer.state.messages.note  # seen while it loads
    until_opened(viewer)
    assert viewer.state.scene is before and viewer.viewpoint.camera is camera
    assert "300 bytes found" in viewer.state.problem
    told = screenshot(viewer)
    left, top, right, low = map(int, viewer.window.covered[-1])
    assert (
        viewer.viewpoint.free[0] < left
        and right < viewer.viewpoint.free[2]
        and low < viewer.viewpoint.free[3] / 2
    )
    assert bright(told, (left + 8, top, right, low)) > 0.02
    assert told[top:low, left:right].max() > 200  # readable, not dimmed
    viewer.handle_event(Wheel(1))  # a sentence is no box: the scene goes on
    run_frames(viewer, 3)
    assert viewer.state.problem
    press(viewer, glfw.KEY_ESCAPE)
    assert viewer.state.problem == ""


def test_a_dropped_good_file_is_shown(viewer, tmp_path):
    paths = (tmp_path / "one.shift", tmp_path / "two.shift")
    for path in paths:
        path.write_bytes(b"scene")
    viewer.handle_event(Drop(paths))
    until_opened(viewer)
    assert [obj.name for obj in viewer.state.scene.objects] == ["one", "two"]
    assert not viewer.state.problem and not viewer.state.messages.note


def test_pictures_are_numbered_and_never_overwritten(viewer):
    folder = viewer.options.pictures
    folder.mkdir()
    (folder / "shapeshift-0001.png").write_bytes(b"mine")
    for _ in range(2):
        press(viewer, glfw.KEY_F12)
        run_frames(viewer, 1)
    assert (folder / "shapeshift-0001.png").read_bytes() == b"mine"
    assert sorted(p.name for p in folder.iterdir()) == [f"shapeshift-000{n}.png" for n in (1, 2, 3)]
    with Image.open(folder / "shapeshift-0002.png") as picture:
        assert picture.size == viewer.window.size and picture.mode == "RGB"
    assert "shapeshift-0003.png" in viewer.state.messages.note
    one, two = ((folder / f"shapeshift-000{n}.png").read_bytes() for n in (2, 3))
    assert one == two  # the note about the first is not in the second


def test_the_scale_bar_comes_with_the_thermal_stop(viewer):
    left, top, right, bottom = map(int, viewer.layout.legend)
    box = (left, top, right, bottom)
    press(viewer, glfw.KEY_1)
    run_frames(viewer, 30)
    assert bright(screenshot(viewer), box) == 0
    press(viewer, glfw.KEY_2)
    run_frames(viewer, 30)
    picture = screenshot(viewer)
    assert bright(picture, box) > 0.15
    column = picture[top + 40 : bottom - 20, left + 20].astype(int).sum(axis=1)
    assert column[0] > column[-1] and column.max() > 500  # hot is on top


def test_choosing_a_palette_changes_the_stops_and_goes_back(viewer):
    state = viewer.state
    filed = state.scene.objects[0].model
    state.choose_palette("gray")
    assert state.scene.objects[0].model.stops[1].palette == "gray"
    assert state.scene.objects[0].model.stops[0].palette == ""
    state.choose_palette("")
    assert state.scene.objects[0].model is filed
