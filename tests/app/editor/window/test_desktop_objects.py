"""Objects in the real window under Xvfb: chosen, moved, copied, undone, added by scripted hands."""

import time
from pathlib import Path

import glfw
import numpy as np
import pytest

from shapeshift.app.editor.state.arrange import place, steer
from shapeshift.app.editor.state.files.opened import OpenedFiles, Source
from shapeshift.app.editor.window.window import Drop
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.scene.document import edits
from shapeshift.scene.pose import Pose
from tests.support.desktop.desktop_stand import ball, run_frames, until_opened
from tests.support.desktop.objects_stand import (
    CTRL,
    NAMES,
    TOUCH,
    click,
    drag,
    key,
    names,
    obj,
    place_of,
    until_added,
    viewer_is_over,
)


@pytest.fixture
def viewer(touch_viewer):
    return touch_viewer


@pytest.fixture
def plain(splats_viewer):
    return splats_viewer


def test_a_scene_file_is_open_with_its_world(viewer):
    assert names(viewer) == NAMES
    assert set(viewer.state.world.objects) == set(NAMES) and viewer.state.world.paused
    assert viewer.window.title.startswith("touch.scene.json")


def test_a_click_chooses_what_is_under_it_and_a_drag_turns_the_camera(viewer):
    click(viewer, (0.0, 0.061, -0.12))
    assert viewer.state.chosen == "ball"
    before = viewer.viewpoint.view().eye_from_world()
    click(viewer, (-0.22, 0.06, 0.05))
    assert viewer.state.chosen == "cube"
    np.testing.assert_array_equal(viewer.viewpoint.view().eye_from_world(), before)
    drag(viewer, place_of(viewer, (0.0, 0.061, -0.12)), (700, 500))
    run_frames(viewer, 60)
    assert (
        viewer.state.chosen == "cube"
        and np.abs(viewer.viewpoint.view().eye_from_world() - before).max()
    )
    key(viewer, glfw.KEY_ESCAPE)
    assert viewer.state.chosen == ""


def test_handles_move_the_chosen_thing_along_one_axis_as_one_edit(viewer):
    state, start = viewer.state, np.array([0.0, 0.061, -0.12])
    click(viewer, start)
    key(viewer, glfw.KEY_M)
    assert viewer.state.handles == "move"
    camera = viewer.viewpoint.view().eye_from_world()
    tip = place_of(viewer, (0.08, 0.061, -0.12))
    middle = place_of(viewer, start)
    held = tip if viewer_is_over(viewer, tip) else None
    assert held, "no handle is where the x axis goes"
    drag(viewer, tip, np.array(tip) + 2 * (np.array(tip) - middle))
    moved = obj(viewer, "ball").world_from_object
    assert moved.position[0] > 0.05 and moved.position[1:] == pytest.approx(start[1:], abs=1e-6)
    np.testing.assert_array_equal(moved.wxyz, (1, 0, 0, 0))
    np.testing.assert_array_equal(viewer.viewpoint.view().eye_from_world(), camera)
    item = state.edited.file.items[1]
    assert item.position == pytest.approx(moved.position, abs=1e-6) and item.wxyz == (1, 0, 0, 0)
    assert tuple(moved.position) == item.position
    there = state.world.physics.pose(state.world.objects["ball"].body).position
    assert there == pytest.approx(moved.position, abs=1e-6)
    assert len(state.edited.history.steps) == 2 and viewer.objects.unsaved
    key(viewer, glfw.KEY_Z, CTRL)
    assert tuple(obj(viewer, "ball").world_from_object.position) == tuple(start)
    assert not viewer.objects.unsaved
    key(viewer, glfw.KEY_Y, CTRL)
    assert obj(viewer, "ball").world_from_object.position == pytest.approx(moved.position, abs=1e-9)
    key(viewer, glfw.KEY_M)
    key(viewer, glfw.KEY_M)
    assert viewer.state.handles == ""


def test_handles_turn_it_in_its_place(viewer):
    state = viewer.state
    click(viewer, (-0.22, 0.06, 0.05))
    viewer.state.handles = "turn"
    run_frames(viewer, 2)
    x, y = place_of(viewer, (-0.22, 0.051, 0.05))
    low = next(y + r for r in range(20, 200, 2) if viewer_is_over(viewer, (x, y + r)))
    drag(viewer, (x, low), (x + 60, low))
    pose = obj(viewer, "cube").world_from_object
    assert abs(pose.wxyz[0]) < 0.999 and np.linalg.norm(pose.wxyz) == pytest.approx(1)
    assert pose.position == pytest.approx((-0.22, 0.051, 0.05), abs=0.01)  # about its middle
    assert state.edited.file.items[0].wxyz == pytest.approx(pose.wxyz, abs=1e-8)
    viewer.state.handles = ""


def test_copy_delete_hide_and_rename_with_undo(viewer):
    objects = viewer.objects
    click(viewer, (0.0, 0.061, -0.12))
    key(viewer, glfw.KEY_D, CTRL)
    assert names(viewer) == [*NAMES[:3], "ball 2", *NAMES[3:]] and viewer.state.chosen == "ball 2"
    copy = obj(viewer, "ball 2")
    assert copy.model is obj(viewer, "ball").model
    assert copy.world_from_object.position[0] > 0.05  # beside it, not in it
    assert "ball 2" in viewer.state.world.objects
    assert objects.edits.edit(edits.rename, "ball 2", "globe", what="rename")
    key(viewer, glfw.KEY_DELETE)
    assert names(viewer) == [*NAMES[:2], "ball", "ring", "plate"] or viewer.state.chosen == ""
    assert not objects.edits.edit(edits.rename, "ball", "cube", what="rename")
    assert "taken" in viewer.state.problem
    key(viewer, glfw.KEY_ESCAPE)
    while viewer.state.edited.history.undoes:
        key(viewer, glfw.KEY_Z, CTRL)
    assert names(viewer) == NAMES and list(viewer.state.world.objects) == NAMES
    key(viewer, glfw.KEY_Z, CTRL)
    assert "Nothing" in viewer.state.messages.note


def test_objects_are_added_by_dropping_while_the_box_is_open(viewer, tmp_path):
    objects = viewer.objects
    objects.adding.ask()
    run_frames(viewer, 3)
    b = ball(50)
    write_ply(PlainSplats(b.means, b.scales, b.wxyz, b.opacity, b.sh), tmp_path / "ball.ply")
    viewer.handle_event(Drop((tmp_path / "ball.ply",)))
    until_added(viewer)
    assert names(viewer) == [*NAMES, "ball 2"] and viewer.state.chosen == "ball 2"
    assert not objects.adding.asking and "ball 2" in viewer.state.world.objects
    key(viewer, glfw.KEY_Z, CTRL)
    assert names(viewer) == NAMES
    for path, words in ((TOUCH, "scene file"), (tmp_path / "none.ply", "none.ply")):
        objects.adding.begin((path,))
        until_added(viewer)
        assert words in viewer.state.problem and names(viewer) == NAMES
        viewer.state.problem = ""


def test_what_the_device_cannot_hold_is_not_added(viewer, monkeypatch):
    def refuse(scene):
        if len(scene.objects) > len(NAMES):
            raise BadFile("more splats than the device holds.")

    monkeypatch.setattr(viewer.renderer, "update", refuse)
    viewer.objects.adding.add_opened(OpenedFiles((Source(Path("/x/more.ply"), ball(50)),)))
    assert names(viewer) == NAMES and "device" in viewer.state.problem
    assert viewer.state.edited.history.undoes == ""


def test_a_scene_file_is_dropped_on_the_window(plain):
    plain.handle_event(Drop((TOUCH,)))
    until_opened(plain)
    assert names(plain) == NAMES and plain.state.edited.path == TOUCH
    wrong = Drop((TOUCH, TOUCH.with_name("other.scene.json")))
    plain.handle_event(wrong)
    until_opened(plain)
    assert "two scene files" in plain.state.problem
    plain.state.problem = ""


def test_what_moves_while_the_world_runs_is_no_edit_until_it_is_kept(viewer):
    objects, state = viewer.objects, viewer.state
    state.world.paused = False
    index = names(viewer).index("ball")
    place(state, index, Pose(np.array([0.0, 0.5, -0.12]), np.array([1.0, 0, 0, 0])))
    steer(state, index, 0.25)
    for _ in range(40):
        run_frames(viewer, 1, seconds=0.02)
    fallen = obj(viewer, "ball")
    assert 0.0 < fallen.world_from_object.position[1] < 0.45 and fallen.x == 0.25
    assert not state.edited.changed and not objects.unsaved
    state.world.paused = True
    run_frames(viewer, 2)
    state.chosen = "ball"
    objects.edits.duplicate()
    copy = obj(viewer, "ball 2")
    assert copy.world_from_object.position[1:] == pytest.approx(
        fallen.world_from_object.position[1:], abs=1e-5
    )
    assert copy.x == 0.25  # a copy of what is seen, not of where it started
    key(viewer, glfw.KEY_Z, CTRL)
    objects.edits.keep_standing()
    item = edits.find(state.edited.file, "ball")
    assert item.x == 0.25
    assert item.position == pytest.approx(fallen.world_from_object.position, abs=1e-5)
    key(viewer, glfw.KEY_Z, CTRL)
    assert tuple(obj(viewer, "ball").world_from_object.position) == (0, 0.061, -0.12)


def test_a_body_is_given_taken_and_weighed(viewer):
    objects, world = viewer.objects, viewer.state.world
    item = edits.find(viewer.state.edited.file, "ball")
    assert objects.edits.change(item, "body", collider=None)
    assert world.objects["ball"].body is None
    key(viewer, glfw.KEY_Z, CTRL)
    assert world.objects["ball"].body is not None
    item = edits.find(viewer.state.edited.file, "ball")
    assert objects.edits.change(item, "mass", mass_kg=2.0)
    assert world.physics.mass(world.objects["ball"].body) == pytest.approx(2.0)
    assert objects.edits.change(item, "body", static=True) and not world.objects["ball"].moves


def test_a_collider_that_cannot_be_made_is_a_sentence(viewer):
    objects, state = viewer.objects, viewer.state
    item = edits.find(state.edited.file, "ball")
    assert objects.edits.change(item, "body", collider="touch/none.obj")
    end = time.monotonic() + 20
    while state.bodies.busy and time.monotonic() < end:
        run_frames(viewer, 1)
        time.sleep(0.005)
    run_frames(viewer, 2)
    assert "ball" in state.problem and "touched" in state.problem
    assert state.world.objects["ball"].body is None
    state.problem = ""


def test_an_empty_scene_is_shown_and_undone(plain):
    plain.state.chosen = "ball"
    key(plain, glfw.KEY_DELETE)
    run_frames(plain, 3)
    assert names(plain) == []
    key(plain, glfw.KEY_F)
    key(plain, glfw.KEY_SPACE)
    key(plain, glfw.KEY_Z, CTRL)
    assert names(plain) == ["ball"]


def test_a_long_list_and_every_part_of_the_panel_is_drawn(viewer):
    for _ in range(9):
        viewer.state.chosen = "ball"
        viewer.objects.edits.duplicate()
    run_frames(viewer, 3)
    assert len(names(viewer)) == 14 and len(viewer.state.sliders) == 1
    viewer.state.chosen = "background"
    run_frames(viewer, 2)
    viewer.state.move(1, obj(viewer, "plate").world_from_object)
    run_frames(viewer, 2)
    viewer.objects.edits.keep_standing()
    assert viewer.state.edited.file.items[0].position == (0.28, 0.005, 0.1)
