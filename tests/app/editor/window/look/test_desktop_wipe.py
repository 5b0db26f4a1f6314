"""The wipe in the real window: left of the line exactly A's picture, right of it exactly B's."""

from dataclasses import replace
from pathlib import Path

import glfw
import numpy as np
import pytest

from shapeshift.app.commands.compared import SceneSide
from shapeshift.app.document import Document
from shapeshift.app.editor.desktop import KEYS, Options, Viewer, Wipe
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.window.window import Drag, KeyDown, Press, Release
from shapeshift.renderer.renderer import Renderer
from tests.support.desktop.desktop_stand import ball, run_frames


@pytest.fixture(params=["tiles", "quads"])
def stand(window, tmp_path, request):
    """(viewer, wipe, B's model): a green ball against a larger, redder one."""
    if request.param == "tiles":
        pytest.importorskip("pyopencl")
    a = ball(300)
    b = replace(a, means=a.means * np.float32(1.2), sh=a.sh[:, :, ::-1].copy())
    state = EditorState(lambda path: a)
    state.open([Path("a.ply")])
    options = Options(pictures=tmp_path, panel=False, drawing=request.param)
    with Renderer(window.ctx, request.param) as one, Renderer(window.ctx, request.param) as other:
        viewer = Viewer(window, one, state, options)
        side = SceneSide("b", Document.of(b, 0.0), stated=False)
        wipe = Wipe(window, (one, other), state, side, viewer.free())
        wipe.attach(viewer.hooks)
        run_frames(viewer, 5)
        yield viewer, wipe, b
        wipe.release()


def screen(viewer) -> np.ndarray:
    viewer.window.begin_frame()
    viewer.draw_splats()
    viewer.window.end_frame()
    return viewer.window.picture().copy()


def alone(viewer, model) -> np.ndarray:
    """What the viewer shows of one model without a wipe."""
    over, viewer.hooks.over = viewer.hooks.over, []
    scene = viewer.state.scene
    viewer.state.scene = replace(scene, objects=(replace(scene.objects[0], model=model),))
    picture = screen(viewer)
    viewer.state.scene, viewer.hooks.over = scene, over
    return picture


@pytest.mark.parametrize("part", [0.0, 0.001, 0.31, 0.5, 0.999, 1.0])
def test_each_side_of_the_line_is_exactly_its_own_picture(stand, part):
    viewer, wipe, b = stand
    wipe.part = part
    of_a = alone(viewer, viewer.state.scene.objects[0].model)
    of_b = alone(viewer, b)
    assert (of_a != of_b).any(axis=2).mean() > 0.02
    picture, cut = screen(viewer), round(part * viewer.window.size[0])
    np.testing.assert_array_equal(picture[:, :cut], of_a[:, :cut])
    np.testing.assert_array_equal(picture[:, cut:], of_b[:, cut:])


def test_the_line_follows_mouse_and_keys_and_the_camera_stays(stand):
    viewer, wipe, _ = stand
    width = viewer.window.logical_size[0]
    before = viewer.viewpoint.view()
    viewer.handle_event(Press("left", wipe.part * width + 4, 100))
    viewer.handle_event(Drag("left", -90, 0, 0.25 * width, 100))
    assert wipe.part == 0.25
    viewer.handle_event(Drag("left", 9e9, 0, 9e9, 100))
    assert wipe.part == 1.0
    viewer.handle_event(Release("left"))
    viewer.handle_event(KeyDown(glfw.KEY_COMMA, False))
    assert wipe.part == pytest.approx(0.98)
    assert str(viewer.viewpoint.view()) == str(before) and not viewer.viewpoint.camera.moving
    viewer.handle_event(Press("left", 10, 100))  # far from the line: the camera's
    viewer.handle_event(Drag("left", 30, 0, 40, 100))
    assert viewer.viewpoint.camera.moving and wipe.part == pytest.approx(0.98)


def test_it_can_be_switched_off(stand):
    viewer, wipe, _ = stand
    viewer.handle_event(KeyDown(glfw.KEY_C, False))
    wipe.part = 0.5
    of_a = alone(viewer, viewer.state.scene.objects[0].model)
    np.testing.assert_array_equal(screen(viewer), of_a)


def test_at_rest_the_likeness_is_told_once(stand, monkeypatch):

    viewer, wipe, _ = stand
    from shapeshift.app.charts import comparison

    monkeypatch.setattr(comparison, "REST_S", 0.0)
    viewer.state.set_x(0, 0.5)
    run_frames(viewer, 4)
    assert wipe.status().startswith("A to B ") and wipe.status().endswith(" dB")
    assert not viewer.polling  # the loop may sleep
    viewer.state.set_x(0, 0.75)
    # What B is drawn of; on the screen only pixels of it are left.
    assert wipe._scene_at(viewer.state.scene).objects[0].x == 0.75  # no x was given: A's


def test_zeros_that_lie_elsewhere_are_respected(stand):
    viewer, wipe, b = stand
    far = Document.of(replace(b, origin=(100.0, 0.0, 0.0)))
    # Pixels cannot tell an offset of 100 m from nothing drawn, so the number itself is asked for.
    wipe._side = replace(wipe._side, subject=far)
    offset = wipe._offset(viewer.state.scene)
    np.testing.assert_array_equal(offset, [-100.0, 0.0, 0.0])


def test_a_scene_file_is_drawn_where_it_says_beside_itself_at_another_x(window, tmp_path):
    """Its zero is the world's, whatever was taken off a model of it; its own name stands there."""
    far = replace(ball(50), origin=(100.0, 0.0, 0.0))
    state = EditorState(lambda path: far)
    state.open([Path("a.ply")])
    state.edited.path = tmp_path / "a.scene.json"
    options = Options(pictures=tmp_path, panel=False, drawing="quads")
    with Renderer(window.ctx, "quads") as one, Renderer(window.ctx, "quads") as other:
        viewer = Viewer(window, one, state, options)
        side = SceneSide("b", Document.of(ball(50), 0.0))
        wipe = Wipe(window, (one, other), state, side, viewer.free())
        wipe.attach(viewer.hooks)
        run_frames(viewer, 2)
        assert not wipe._offset(state.scene).any()
        wipe.release()


def test_the_sheet_lists_its_keys(stand):
    viewer, _, _ = stand
    assert tuple(viewer.hooks.keys["Comparing"]) == KEYS and {k for k, _ in KEYS} == {", .", "C"}
