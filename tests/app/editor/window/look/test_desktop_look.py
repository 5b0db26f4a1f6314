"""Appearance, sky, lens, named views and a gamepad in the real window, by real events."""

import math

import numpy as np
import pytest

from shapeshift.app.editor.panels import panel
from shapeshift.app.editor.panels.sections import camera_panel, plain_sections
from shapeshift.app.editor.state.files.opened import OpenedFiles, Source
from shapeshift.app.editor.window.devices.input_devices import REST, PadState
from shapeshift.scene.appearance import NEUTRAL, Sky
from shapeshift.scene.document.read_scene_file import read_scene_file
from tests.support.desktop.desktop_stand import ball, run_frames
from tests.support.desktop.objects_stand import release, viewer_of
from tests.support.desktop.real_hands import RealHands
from tests.support.desktop.widgets import Widgets


@pytest.fixture
def viewer(window, tmp_path):
    """A ball of radius 1 that was opened without a scene file."""
    model = ball(2000)
    viewer = viewer_of(window, OpenedFiles((Source(tmp_path / "ball.ply", model),)), tmp_path)
    yield viewer
    release(viewer)


@pytest.fixture
def widgets(viewer, monkeypatch, request):
    """With one section alone, so that nothing has to be scrolled to."""
    wanted = "Look" if "look" in request.node.name or "chosen" in request.node.name else "Views"
    monkeypatch.setattr(panel, "section", lambda name, *_, **__: name == wanted)
    for module in (plain_sections, camera_panel):
        monkeypatch.setattr(module, "subsection", lambda *_: True)
    found = Widgets(monkeypatch)
    run_frames(viewer, 3)
    return found


@pytest.fixture
def hands(viewer, display):
    with RealHands(viewer, display) as hands:
        hands.move(610, 210)
        hands.move(600, 200)
        yield hands
        hands.button(False)


def slide(hands, widgets, name: str, part: float) -> None:
    """Presses a slider at a part of its width and lets go."""
    left, top, right, low = widgets.boxes[f"##{name}"]
    hands.click(left + part * (right - left), (top + low) / 2)


def test_a_look_is_given_undone_and_saved(viewer, hands, widgets, tmp_path):
    state = viewer.state
    obj = state.scene.objects[0]
    slide(hands, widgets, "exposure", 0.75)  # of -4 to 4
    assert state.edited.file.appearance.exposure == pytest.approx(2.0, abs=0.2)
    assert state.scene.objects[0].appearance.exposure == state.edited.file.appearance.exposure
    assert state.scene.objects[0].model is obj.model and viewer.objects.unsaved
    hands.drag(*[((b[0] + b[2]) / 2 + d, (b[1] + b[3]) / 2)
                 for b in [widgets.boxes["##opacity"]] for d in (60, -20)])  # fmt: skip
    opacity = state.edited.file.appearance.opacity
    assert 0.2 < opacity < 0.8
    hands.key("z", "Control_L")  # a drag is one step
    assert state.edited.file.appearance.opacity == 1.0
    hands.key("z", "Control_L")
    assert state.edited.file.appearance == NEUTRAL == state.scene.objects[0].appearance
    hands.key("y", "Control_L")
    hands.click(*widgets.middle("sky"))
    sky = state.edited.file.sky
    assert isinstance(sky, Sky) and state.settings.background == sky
    viewer.objects.saving.ask_name()
    assert viewer.objects.saving.named(str(tmp_path / "kept.scene.json"))
    kept = read_scene_file(tmp_path / "kept.scene.json")
    assert kept.sky == sky and kept.appearance == state.edited.file.appearance != NEUTRAL
    hands.key("z", "Control_L")
    assert state.edited.file.sky is None and not isinstance(state.settings.background, Sky)
    assert [s.what for s in state.edited.history.steps[1:]] == ["exposure of the scene", "sky"]


def test_of_a_chosen_object_alone(viewer, hands, widgets):
    state = viewer.state
    state.chosen = state.scene.objects[0].name
    run_frames(viewer, 2)
    slide(hands, widgets, "gamma", 0.8)
    item = state.edited.file.items[0]
    assert item.appearance.gamma > 1.5 and state.edited.file.appearance == NEUTRAL
    assert state.scene.objects[0].appearance == item.appearance
    hands.click(*widgets.middle("As it was"))
    assert state.scene.objects[0].appearance == NEUTRAL


def test_the_lens(viewer, hands, widgets):
    camera, before = viewer.viewpoint.camera, viewer.viewpoint.view()
    slide(hands, widgets, "fov", 0.9)
    low, high = viewer.viewpoint.plain_view().tangents[2:]
    assert math.degrees(math.atan(high) - math.atan(low)) == pytest.approx(109, abs=4)
    np.testing.assert_array_equal(
        viewer.viewpoint.view().world_from_eye.position, before.world_from_eye.position
    )
    slide(hands, widgets, "near", 0.8)
    assert viewer.viewpoint.view().near == camera.near_m > 0.1
    slide(hands, widgets, "near", 0.0)
    assert camera.near_m == 0.0 and viewer.viewpoint.view().near == before.near
    slide(hands, widgets, "speed", 0.5)
    assert camera.speed == pytest.approx(1.0, rel=0.3)
    hands.key("KP_5")
    assert viewer.viewpoint.parallel and viewer.viewpoint.view().tangents[3] < 1e-2
    hands.click(*widgets.middle("orthographic"))
    assert not viewer.viewpoint.parallel


def test_what_is_in_the_middle_keeps_its_size_when_rays_become_parallel(viewer, hands):
    viewer.viewpoint.free = viewer.viewpoint.free_wanted()
    target, axes = viewer.viewpoint.camera.target, viewer.viewpoint.view().world_from_eye.matrix()
    aside = target + 0.3 * axes[:3, 0]
    places = []
    for _ in range(2):
        camera, fx, fy, cx, cy = viewer.viewpoint.view().pinhole()
        at = camera[:3, :3] @ aside + camera[:3, 3]
        places.append((fx * at[0] / at[2] + cx, fy * at[1] / at[2] + cy))
        hands.key("KP_5")
    np.testing.assert_allclose(*places, atol=1e-3)
    # A click lands where the eye sees it, however far the eye is.
    hands.key("KP_5")
    per_pixel = viewer.window.logical_size[0] / viewer.window.size[0]
    hit = viewer.hands.point_at(*(np.array(places[0]) * per_pixel))
    viewer.viewpoint.toggle_orthographic()
    assert hit is not None and np.linalg.norm(hit.point) == pytest.approx(1.0, abs=0.1)


def test_a_drag_turns_about_what_was_pressed(viewer, hands, widgets):
    hands.click(*widgets.middle("turn about what is pressed"))
    assert viewer.viewpoint.camera.about_pointer
    left, top, right, low = viewer.layout.free
    place = (0.6 * left + 0.4 * right, 0.5 * (top + low))
    hit = viewer.hands.point_at(*place)
    assert hit is not None
    hands.drag(place, (place[0] + 60, place[1] + 20))
    run_frames(viewer, 80)
    view = viewer.viewpoint.view()
    camera, fx, fy, cx, cy = view.pinhole()
    at = camera[:3, :3] @ hit.point + camera[:3, 3]
    scale = viewer.window.size[0] / viewer.window.logical_size[0]
    seen = np.array([fx * at[0] / at[2] + cx, fy * at[1] / at[2] + cy]) / scale
    np.testing.assert_allclose(seen, place, atol=1.0)


def test_named_views_are_added_gone_to_and_taken_out(viewer, hands, widgets):
    state, viewpoint = viewer.state, viewer.viewpoint
    hands.click(*widgets.middle("+ View"))
    (first,) = state.edited.file.views
    before = viewpoint.view()
    hands.key("KP_7")  # straight from above, which a file states a little tilted
    run_frames(viewer, 80)
    above = viewpoint.view()
    hands.click(*widgets.middle("+ View"))
    assert [v.name for v in state.edited.file.views] == ["view 1", "view 2"]
    viewpoint.go_to(first.view)
    run_frames(viewer, 80)
    np.testing.assert_allclose(
        viewpoint.view().world_from_eye.matrix(), before.world_from_eye.matrix(), atol=1e-4
    )
    viewpoint.go_to(state.edited.file.views[1].view)
    run_frames(viewer, 80)
    np.testing.assert_allclose(
        viewpoint.view().world_from_eye.matrix(), above.world_from_eye.matrix(), atol=5e-3
    )
    hands.key("z", "Control_L")
    assert [v.name for v in state.edited.file.views] == ["view 1"]
    hands.click(*widgets.middle("star of now"))
    assert state.edited.file.view not in (None, first.view)
    hands.click(*widgets.middle("star view 1"))
    assert state.edited.file.view == first.view
    hands.key("z", "Control_L")
    assert state.edited.file.view != first.view
    hands.click(*widgets.middle("\u00d7"))
    assert state.edited.file.views == ()


def test_a_gamepad_moves_turns_and_presses(viewer, hands):
    state, pads, camera = viewer.state, viewer.devices.pads, viewer.viewpoint.camera
    now = [None]
    pads.read = lambda: now[0]
    assert not pads.poll() and not pads.connected
    now[0] = REST
    assert not pads.poll() and pads.connected
    eye, yaw = camera.position, camera.view((10, 10)).world_from_eye.matrix()[:3, 2]
    now[0] = PadState((0.0, -1.0, 0.0, 0.0, -1.0, -1.0))
    assert pads.poll() and viewer.busy()
    run_frames(viewer, 10)
    moved = camera.position - eye
    assert moved @ -yaw > 0.1 * np.linalg.norm(moved) > 0
    now[0] = PadState((0.0, 0.0, 1.0, 0.0, -1.0, -1.0))
    run_frames(viewer, 10)
    assert np.linalg.norm(camera.view((10, 10)).world_from_eye.matrix()[:3, 2] - yaw) > 0.1
    # A button that is down between two frames acts once, one that repeats goes on.
    now[0] = PadState(pressed=frozenset({"right bumper"}))
    pads.poll()
    now[0] = REST
    pads.poll()
    state.set_x(0, 0.0)
    run_frames(viewer, 60)
    assert state.scene.objects[0].slider_x == 1.0
    now[0] = PadState(pressed=frozenset({"left"}))
    run_frames(viewer, 11, seconds=0.04)
    now[0] = REST
    run_frames(viewer, 2)
    assert state.scene.objects[0].slider_x == pytest.approx(0.89, abs=0.015)
    assert not pads.input.moving
