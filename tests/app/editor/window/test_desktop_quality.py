"""The window under Xvfb: what a setting costs, the budget dial, regions by mouse and keys."""

import time
from types import SimpleNamespace

import glfw
import numpy as np
import pytest

import shapeshift.app.editor.window.viewer as viewer_module
from shapeshift.app.charts.comparison import REST_S
from shapeshift.app.editor.window.window import Drag, KeyDown, Press, Release
from shapeshift.renderer.settings import DEBUG_VIEWS, RenderSettings
from tests.support.desktop.desktop_stand import run_frames, until_opened


def press(viewer, key: int, shift: bool = False) -> None:
    viewer.handle_event(KeyDown(key, shift))


def middle(viewer) -> tuple[float, float]:
    left, top, right, bottom = viewer.viewpoint.free
    return (left + right) / 2, (top + bottom) / 2


def hold(monkeypatch, *keys: int) -> None:
    monkeypatch.setattr(glfw, "get_key", lambda _, key: int(key in keys))


@pytest.fixture
def clock(monkeypatch):
    """The viewer's own, which goes on by hand alone: a slow machine rests no longer."""
    now = SimpleNamespace(s=time.perf_counter())
    monkeypatch.setattr(viewer_module, "time", SimpleNamespace(perf_counter=lambda: now.s))
    return now


# Likeness


def test_a_setting_is_compared_with_exact_once_it_rests(viewer, clock):
    viewer.state.settings = RenderSettings(min_pixels=2.0)
    run_frames(viewer, 2)
    drawn = viewer.renderer.draws
    clock.s += 0.9 * REST_S
    run_frames(viewer, 1)
    assert viewer.readings.error_db is None
    clock.s += 0.2 * REST_S
    run_frames(viewer, 1)
    assert viewer.readings.error_db == pytest.approx(-10 * np.log10(0.02**2 / 2), abs=0.01)
    assert viewer.renderer.draws == drawn + 3  # exact, as set, and the picture again
    clock.s += 1.1 * REST_S
    run_frames(viewer, 2)
    assert viewer.renderer.draws == drawn + 3
    viewer.state.settings = RenderSettings(min_pixels=1.0)
    run_frames(viewer, 1)
    assert viewer.readings.error_is_old


def test_exact_costs_no_comparison(viewer, clock):
    drawn = viewer.renderer.draws
    clock.s += 1.1 * REST_S
    run_frames(viewer, 3)
    assert viewer.renderer.draws == drawn and not viewer.busy()


def test_the_loop_wakes_for_the_comparison_without_any_input(viewer):
    viewer.state.settings = RenderSettings(min_pixels=2.0)
    run_frames(viewer, 5)
    until = time.perf_counter() + 30
    while viewer.readings.error_db is None and time.perf_counter() < until:
        viewer.window.wait(0.05)
        if viewer.idle_work_due(time.perf_counter()):
            viewer.frame(0.0)
    assert viewer.readings.error_db is not None


# Budget


def test_the_dial_measures_between_frames_and_chooses(viewer):
    viewer.dial.floor_db, viewer.dial.wanted = 30.0, True
    run_frames(viewer, 1)
    assert viewer.dial.measuring and viewer.busy()
    for _ in range(500):
        viewer.handle_event(Drag("left", 1, 0))  # the hand is not held up
        run_frames(viewer, 1)
        if not viewer.dial.measuring:
            break
    assert viewer.dial.choice is not None and not viewer.dial.measuring
    assert viewer.state.settings == viewer.dial.applied(viewer.state.settings)
    run_frames(viewer, 1)
    assert viewer.renderer.settings.min_pixels == viewer.state.settings.min_pixels


def test_opening_another_scene_forgets_what_was_measured(viewer, tmp_path):
    from shapeshift.app.editor.window.window import Drop

    scene = tmp_path / "one.shift"
    scene.write_bytes(b"scene")

    viewer.dial.wanted = True
    run_frames(viewer, 1)
    viewer.handle_event(Drop((scene,)))
    until_opened(viewer)
    assert not viewer.dial.rows and not viewer.dial.measuring


def test_fewer_pixels_while_moving_and_all_at_rest(viewer):
    viewer.dial.dynamic, viewer.dial.target_ms = True, 0.01  # no frame is as fast
    for _ in range(40):
        viewer.handle_event(Drag("left", 3, 0))
        run_frames(viewer, 1)
    assert viewer.renderer.settings.render_scale == 0.5
    run_frames(viewer, 80)
    assert viewer.renderer.settings.render_scale == 1.0 == viewer.state.settings.render_scale


# Debug views


def test_g_goes_through_the_debug_views_and_back(viewer):
    seen = []
    for _ in DEBUG_VIEWS:
        press(viewer, glfw.KEY_G)
        run_frames(viewer, 1)
        seen.append(viewer.renderer.settings.debug)
    assert tuple(seen) == (*DEBUG_VIEWS[1:], "")
    press(viewer, glfw.KEY_G, shift=True)
    assert viewer.state.settings.debug == DEBUG_VIEWS[-1]


# Regions


def test_a_click_places_a_region_on_the_surface_and_a_drag_moves_it_on(viewer):
    state = viewer.state
    state.add_region("sphere")
    before = viewer.viewpoint.view().eye_from_world()
    x, y = middle(viewer)
    viewer.handle_event(Press("left", x, y))
    first = state.regions.current.centre
    assert np.linalg.norm(first) == pytest.approx(1, abs=0.1)  # on the ball
    viewer.handle_event(Drag("left", 30, 0, x + 30, y))
    assert np.linalg.norm(state.regions.current.centre - first) > 0.05
    viewer.handle_event(Release("left"))
    run_frames(viewer, 3)
    np.testing.assert_array_equal(viewer.viewpoint.view().eye_from_world(), before)
    viewer.handle_event(Press("left", x, y))
    viewer.handle_event(Drag("left", 30, 0, x + 30, y))  # now it is the camera again
    assert viewer.viewpoint.camera.moving


def test_regions_reach_the_renderer_and_change_what_is_drawn(viewer):
    state, drawn = viewer.state, viewer.renderer.draws
    state.add_region("box")
    run_frames(viewer, 2)
    assert viewer.renderer.draws == drawn + 1  # once: the scene is the same object after that
    assert [
        type(s).__name__ for s in state.shown(viewer.viewpoint.view()).objects[0].selectors
    ] == ["Box"]
    state.regions.edit(0, enabled=False)
    run_frames(viewer, 2)
    assert viewer.renderer.draws == drawn + 2
    assert state.shown(viewer.viewpoint.view()).objects[0].selectors == ()


def test_the_lens_follows_the_camera(viewer):
    press(viewer, glfw.KEY_L)
    (lens,) = viewer.state.shown(viewer.viewpoint.view()).objects[0].selectors
    viewer.handle_event(Drag("left", 80, 0))
    run_frames(viewer, 60)
    (moved,) = viewer.state.shown(viewer.viewpoint.view()).objects[0].selectors
    np.testing.assert_array_equal(moved.position, viewer.viewpoint.view().world_from_eye.position)
    assert moved != lens and not viewer.busy()
    press(viewer, glfw.KEY_L)
    assert viewer.state.shown(viewer.viewpoint.view()).objects[0].selectors == ()


def test_holding_b_paints_what_is_in_front_and_shift_erases(viewer, monkeypatch):
    x, y = middle(viewer)
    before = viewer.viewpoint.view().eye_from_world()
    viewer.state.regions.brush = 80.0
    hold(monkeypatch, glfw.KEY_B)
    viewer.handle_event(Press("left", x, y))
    viewer.handle_event(Drag("left", 20, 0, x + 20, y))
    region = viewer.state.regions.current
    assert region.kind == "painted" and region.painted.sum() > 10
    model = viewer.state.scene.objects[0].model
    eye = viewer.viewpoint.view().world_from_eye.position
    facing = np.einsum("ac,ac->a", model.means[region.painted], eye - model.means[region.painted])
    assert (facing > 0).all()  # none on the far side of the ball
    hold(monkeypatch, glfw.KEY_B, glfw.KEY_LEFT_SHIFT)
    viewer.handle_event(Press("left", x, y))
    assert viewer.state.regions.current.painted.sum() < region.painted.sum()
    monkeypatch.undo()
    run_frames(viewer, 3)
    np.testing.assert_array_equal(viewer.viewpoint.view().eye_from_world(), before)


def test_escape_leaves_the_region_and_hiding_keeps_it(viewer):
    viewer.state.add_region("half-space")
    press(viewer, glfw.KEY_ESCAPE)
    assert viewer.state.regions.current is None and not viewer.state.regions.placing
    press(viewer, glfw.KEY_H)
    run_frames(viewer, 2)
    assert len(viewer.state.shown(viewer.viewpoint.view()).objects[0].selectors) == 1
