"""Objects in the real window under Xvfb: chosen, moved, copied, undone, added and saved by hand."""

import json
import time
from pathlib import Path

import glfw
import numpy as np
import pytest
from desktop_stand import PlainRenderer, ball, run_frames, until_opened

from app.arrange import place, steer
from app.desktop import Options, Viewer
from app.files import opened_scene
from app.gizmo import MOVE, OFF, TURN
from app.opened import Found, Source, read_files
from app.outlines import pixels
from app.stage import Stage
from app.window import Drop
from runtime_models.model import BadFile
from runtime_models.plain_splats import PlainSplats
from runtime_models.write_ply import write_ply
from scene import edits
from scene.camera_list import CameraReading
from scene.pose import Pose
from scene.read_scene_file import read_scene_file

pytest_plugins = ["desktop_fixtures"]  # its fixtures: display, window
TOUCH = Path(__file__).resolve().parents[2] / "assets" / "touch.scene.json"
NAMES = ["background", "cube", "ball", "ring", "plate"]


@pytest.fixture(scope="module")
def found() -> Found:
    return read_files([TOUCH], None, CameraReading(), lambda *_: None)


def viewer_of(window, found: Found, folder: Path) -> Viewer:
    stage = Stage(lambda path: ball())
    scene, document = opened_scene(found)
    stage.take(found.sources, scene, None, document)
    viewer = Viewer(window, PlainRenderer(window.ctx), stage, Options(pictures=folder / "pictures"))
    viewer.files.read = lambda path, told: ball()
    viewer.set_title()
    run_frames(viewer, 4)
    end = time.monotonic() + 30
    while viewer.stage.bodies.busy and time.monotonic() < end:
        run_frames(viewer, 1)
        time.sleep(0.005)
    run_frames(viewer, 2)
    return viewer


@pytest.fixture
def viewer(window, found, tmp_path):
    viewer = viewer_of(window, found, tmp_path)
    yield viewer
    release(viewer)


@pytest.fixture
def plain(window, tmp_path):
    """A file of splats that was opened without a scene file."""
    b = ball(50)
    path = tmp_path / "models" / "ball.ply"
    path.parent.mkdir()
    write_ply(PlainSplats(b.means, b.scales, b.wxyz, b.opacity, b.sh), path)
    viewer = viewer_of(window, Found((Source(path, b),)), tmp_path)
    yield viewer
    release(viewer)


def names(viewer) -> list[str]:
    return [thing.name for thing in viewer.stage.scene.objects]


def thing(viewer, name: str):
    return viewer.stage.scene.objects[names(viewer).index(name)]


def place_of(viewer, point) -> tuple[float, float]:
    """Logical pixels of a point (3,) of the world."""
    view = viewer.view()
    in_eye = (view.eye_from_world() @ np.append(point, 1.0))[:3]
    return tuple(pixels(view, in_eye, viewer.window.logical_size))


def mouse(viewer, x: float, y: float) -> None:
    viewer.window._on_cursor(None, x, y)
    run_frames(viewer, 2)


def button(viewer, down: bool) -> None:
    viewer.window._on_button(None, 0, glfw.PRESS if down else glfw.RELEASE, 0)
    run_frames(viewer, 2)


def release(viewer) -> None:
    button(viewer, False)
    mouse(viewer, 1.0, 1.0)


def click(viewer, point) -> None:
    mouse(viewer, *place_of(viewer, point))
    button(viewer, True)
    button(viewer, False)


def drag(viewer, start, end, steps: int = 8) -> None:
    mouse(viewer, *start)
    button(viewer, True)
    for part in np.linspace(0, 1, steps + 1)[1:]:
        mouse(viewer, *(np.array(start) + part * (np.array(end) - start)))
    button(viewer, False)


def key(viewer, key: int, mods: int = 0) -> None:
    for action in (glfw.PRESS, glfw.RELEASE):
        viewer.window._on_key(None, key, 0, action, mods)
        run_frames(viewer, 2)


CTRL, SHIFT = glfw.MOD_CONTROL, glfw.MOD_SHIFT


def test_a_scene_file_is_open_with_its_world(viewer):
    assert names(viewer) == NAMES
    assert set(viewer.stage.world.things) == set(NAMES) and viewer.stage.world.paused
    assert viewer.window._window.title.startswith("touch.scene.json")


def test_a_click_chooses_what_is_under_it_and_a_drag_turns_the_camera(viewer):
    click(viewer, (0.0, 0.061, -0.12))
    assert viewer.stage.chosen == "ball"
    before = viewer.view().eye_from_world()
    click(viewer, (-0.22, 0.06, 0.05))
    assert viewer.stage.chosen == "cube"
    np.testing.assert_array_equal(viewer.view().eye_from_world(), before)
    drag(viewer, place_of(viewer, (0.0, 0.061, -0.12)), (700, 500))
    run_frames(viewer, 60)
    assert viewer.stage.chosen == "cube" and np.abs(viewer.view().eye_from_world() - before).max()
    key(viewer, glfw.KEY_ESCAPE)
    assert viewer.stage.chosen == ""


def test_handles_move_the_chosen_thing_along_one_axis_as_one_edit(viewer):
    stage, start = viewer.stage, np.array([0.0, 0.061, -0.12])
    click(viewer, start)
    key(viewer, glfw.KEY_M)
    assert viewer.objects.gizmo.mode == MOVE
    camera = viewer.view().eye_from_world()
    tip = place_of(viewer, (0.08, 0.061, -0.12))
    middle = place_of(viewer, start)
    held = tip if viewer_is_over(viewer, tip) else None
    assert held, "no handle is where the x axis goes"
    drag(viewer, tip, np.array(tip) + 2 * (np.array(tip) - middle))
    moved = thing(viewer, "ball").world_from_object
    assert moved.position[0] > 0.05 and moved.position[1:] == pytest.approx(start[1:], abs=1e-6)
    np.testing.assert_array_equal(moved.wxyz, (1, 0, 0, 0))
    np.testing.assert_array_equal(viewer.view().eye_from_world(), camera)
    item = stage.document.file.items[1]
    assert item.position == pytest.approx(moved.position, abs=1e-6) and item.wxyz == (1, 0, 0, 0)
    assert tuple(moved.position) == item.position
    there = stage.world.physics.pose(stage.world.things["ball"].body).position
    assert there == pytest.approx(moved.position, abs=1e-6)
    assert len(stage.document.history.steps) == 2 and viewer.objects.unsaved
    key(viewer, glfw.KEY_Z, CTRL)
    assert tuple(thing(viewer, "ball").world_from_object.position) == tuple(start)
    assert not viewer.objects.unsaved
    key(viewer, glfw.KEY_Y, CTRL)
    assert thing(viewer, "ball").world_from_object.position == pytest.approx(
        moved.position, abs=1e-9
    )
    key(viewer, glfw.KEY_M)
    key(viewer, glfw.KEY_M)
    assert viewer.objects.gizmo.mode == OFF


def viewer_is_over(viewer, place) -> bool:
    mouse(viewer, *place)
    return viewer.objects.gizmo._under_mouse


def test_handles_turn_it_in_its_place(viewer):
    stage = viewer.stage
    click(viewer, (-0.22, 0.06, 0.05))
    viewer.objects.gizmo.mode = TURN
    run_frames(viewer, 2)
    x, y = place_of(viewer, (-0.22, 0.051, 0.05))
    low = next(y + r for r in range(20, 200, 2) if viewer_is_over(viewer, (x, y + r)))
    drag(viewer, (x, low), (x + 60, low))
    pose = thing(viewer, "cube").world_from_object
    assert abs(pose.wxyz[0]) < 0.999 and np.linalg.norm(pose.wxyz) == pytest.approx(1)
    assert pose.position == pytest.approx((-0.22, 0.051, 0.05), abs=0.01)  # about its middle
    assert stage.document.file.items[0].wxyz == pytest.approx(pose.wxyz, abs=1e-8)
    viewer.objects.gizmo.mode = OFF


def test_copy_delete_hide_and_rename_with_undo(viewer):
    objects = viewer.objects
    click(viewer, (0.0, 0.061, -0.12))
    key(viewer, glfw.KEY_D, CTRL)
    assert names(viewer) == [*NAMES[:3], "ball 2", *NAMES[3:]] and viewer.stage.chosen == "ball 2"
    copy = thing(viewer, "ball 2")
    assert copy.model is thing(viewer, "ball").model
    assert copy.world_from_object.position[0] > 0.05  # beside it, not in it
    assert "ball 2" in viewer.stage.world.things
    assert objects.edit(edits.rename, "ball 2", "globe", what="rename")
    key(viewer, glfw.KEY_DELETE)
    assert names(viewer) == [*NAMES[:2], "ball", "ring", "plate"] or viewer.stage.chosen == ""
    assert not objects.edit(edits.rename, "ball", "cube", what="rename")
    assert "taken" in viewer.readings.note
    while viewer.stage.document.history.undoes:
        key(viewer, glfw.KEY_Z, CTRL)
    assert names(viewer) == NAMES and list(viewer.stage.world.things) == NAMES
    key(viewer, glfw.KEY_Z, CTRL)
    assert "Nothing" in viewer.readings.note


def test_ctrl_s_does_not_move_the_camera_and_asks_nothing_for_an_opened_file(viewer, tmp_path):
    before = TOUCH.read_bytes()
    viewer.stage.document.path = tmp_path / "own.scene.json"
    viewer.stage.document.stamp = ()
    view = viewer.view().eye_from_world()
    key(viewer, glfw.KEY_S, CTRL)
    run_frames(viewer, 30)
    np.testing.assert_array_equal(viewer.view().eye_from_world(), view)
    assert [item.name for item in read_scene_file(tmp_path / "own.scene.json").items] == NAMES[1:]
    assert TOUCH.read_bytes() == before


def test_what_somebody_else_has_written_meanwhile_is_asked_about(viewer, tmp_path):
    objects, document = viewer.objects, viewer.stage.document
    path = tmp_path / "a.scene.json"
    assert objects.saving.named(str(path))
    path.write_text("{}")  # by somebody else
    assert not objects.saving.save() and objects.saving.asking and path.read_text() == "{}"
    run_frames(viewer, 3)
    key(viewer, glfw.KEY_DELETE)  # the box is open: not for the scene
    key(viewer, glfw.KEY_ESCAPE)
    run_frames(viewer, 2)
    assert not objects.saving.asking and path.read_text() == "{}" and names(viewer) == NAMES
    objects.saving.save()
    assert objects.saving.named(str(path), replace=True) and not objects.saving.asking
    assert json.loads(path.read_text())["objects"] and document.path == path


def test_nothing_is_replaced_unasked(viewer, tmp_path):
    path = tmp_path / "taken.scene.json"
    path.write_text("mine")
    saving = viewer.objects.saving
    assert not saving.named(str(tmp_path / "taken")) and path.read_text() == "mine"
    saving.cancel_name()
    assert not saving.named("  ") and not saving.asking


def test_a_folder_that_cannot_be_written_is_a_sentence(viewer, tmp_path):
    (tmp_path / "file").write_text("")
    assert not viewer.objects.saving.named(str(tmp_path / "file" / "x"))
    assert "cannot be saved" in viewer.stage.problem and "\n" not in viewer.stage.problem


def test_splats_are_saved_as_a_scene_file_and_opened_again(plain, tmp_path):
    stage = plain.stage
    assert not plain.objects.unsaved and stage.world is None
    stage.add_region("sphere")
    stage.regions.edit(0, x=1.0)
    stage.toggle_lens()  # of the eye, not of the file
    key(plain, glfw.KEY_S, CTRL)
    assert plain.objects.saving.asking
    plain.objects.saving.cancel_name()
    run_frames(plain, 2)
    assert plain.objects.saving.named(str(tmp_path / "mine"))
    file = read_scene_file(tmp_path / "mine.scene.json")
    (item,) = file.items
    assert item.model == "models/ball.ply"  # it can be moved with the folder
    assert [type(selector).__name__ for selector in item.selectors] == ["Sphere"]
    run_frames(plain, 1)
    assert "mine.scene.json" in plain.window._window.title
    again = read_files([tmp_path / "mine.scene.json"], None, CameraReading(), lambda *_: None)
    np.testing.assert_allclose(again.sources[0].model.means, ball(50).means, atol=1e-6)


def test_objects_are_added_by_dropping_while_the_box_is_open(viewer, tmp_path):
    objects = viewer.objects
    objects.adding.ask()
    run_frames(viewer, 3)
    b = ball(50)
    write_ply(PlainSplats(b.means, b.scales, b.wxyz, b.opacity, b.sh), tmp_path / "ball.ply")
    viewer.take(Drop((tmp_path / "ball.ply",)))
    until_added(viewer)
    assert names(viewer) == [*NAMES, "ball 2"] and viewer.stage.chosen == "ball 2"
    assert not objects.adding.asking and "ball 2" in viewer.stage.world.things
    key(viewer, glfw.KEY_Z, CTRL)
    assert names(viewer) == NAMES
    for path, words in ((TOUCH, "scene file"), (tmp_path / "none.ply", "none.ply")):
        objects.adding.begin((path,))
        until_added(viewer)
        assert words in viewer.stage.problem and names(viewer) == NAMES
        viewer.stage.problem = ""


def until_added(viewer) -> None:
    end = time.monotonic() + 20
    while viewer.objects.adding._opener.busy and time.monotonic() < end:
        run_frames(viewer, 1)
        time.sleep(0.005)
    run_frames(viewer, 2)


def test_what_the_device_cannot_hold_is_not_added(viewer, monkeypatch):
    def refuse(scene):
        if len(scene.objects) > len(NAMES):
            raise BadFile("more splats than the device holds.")

    monkeypatch.setattr(viewer.renderer, "update", refuse)
    viewer.objects.adding.take(Found((Source(Path("/x/more.ply"), ball(50)),)))
    assert names(viewer) == NAMES and "device" in viewer.stage.problem
    assert viewer.stage.document.history.undoes == ""


def test_closing_and_opening_ask_before_something_is_lost(viewer, tmp_path):
    assert viewer._may_close()
    viewer.stage.chosen = "ball"
    viewer.objects.delete()
    run_frames(viewer, 1)
    assert viewer.window._window.title.startswith("* touch.scene.json")
    assert viewer.objects.status() == "not saved"
    assert not viewer._may_close() and not viewer.window.closing
    run_frames(viewer, 3)
    key(viewer, glfw.KEY_ESCAPE)
    run_frames(viewer, 2)
    assert not viewer.objects.saving.asking
    (tmp_path / "ball.shift").write_bytes(b"")
    viewer.open_soon((tmp_path / "ball.shift",))
    until_opened(viewer)
    assert viewer.objects.saving.asking and "cube" in names(viewer)
    viewer.objects.saving.answer("Discard")
    run_frames(viewer, 2)
    assert names(viewer) == ["ball"] and not viewer.objects.unsaved


def test_a_slider_alone_asks_nothing(viewer):
    steer(viewer.stage, 1, 0.5)
    run_frames(viewer, 1)
    assert viewer.objects.status() == "not saved" and viewer._may_close()


def test_a_scene_file_is_dropped_on_the_window(plain):
    plain.take(Drop((TOUCH,)))
    until_opened(plain)
    assert names(plain) == NAMES and plain.stage.document.path == TOUCH
    wrong = Drop((TOUCH, TOUCH.with_name("other.scene.json")))
    plain.take(wrong)
    until_opened(plain)
    assert "two scene files" in plain.stage.problem
    plain.stage.problem = ""


def test_the_floor_and_the_first_look_are_edits(viewer, tmp_path):
    objects, stage = viewer.objects, viewer.stage
    first = stage.world
    assert objects.edit(edits.ground, -0.2, what="floor")
    assert stage.document.file.floor_y == -0.2 and stage.world is not first
    assert stage.world.paused and list(stage.world.things) == NAMES
    viewer.camera.turn(0.3, -0.1)
    run_frames(viewer, 60)
    objects.look_from_here()
    eye = viewer.view().world_from_eye.position
    assert stage.document.file.view.eye == pytest.approx(eye, abs=1e-6)
    assert objects.saving.named(str(tmp_path / "a"))
    again = stage.first_view((900, 640))
    np.testing.assert_allclose(
        again.world_from_eye.matrix(), viewer.view().world_from_eye.matrix(), atol=1e-4
    )
    key(viewer, glfw.KEY_Z, CTRL)
    key(viewer, glfw.KEY_Z, CTRL)
    assert stage.document.file.floor_y == -0.7 and objects.unsaved


def test_what_moves_while_the_world_runs_is_no_edit_until_it_is_kept(viewer):
    objects, stage = viewer.objects, viewer.stage
    stage.world.paused = False
    index = names(viewer).index("ball")
    place(stage, index, Pose(np.array([0.0, 0.5, -0.12]), np.array([1.0, 0, 0, 0])))
    steer(stage, index, 0.25)
    for _ in range(40):
        run_frames(viewer, 1, seconds=0.02)
    fallen = thing(viewer, "ball")
    assert 0.0 < fallen.world_from_object.position[1] < 0.45 and fallen.x == 0.25
    assert not stage.document.edited and not objects.unsaved
    stage.world.paused = True
    run_frames(viewer, 2)
    objects.keep_standing()
    item = edits.find(stage.document.file, "ball")
    assert item.x == 0.25
    assert item.position == pytest.approx(fallen.world_from_object.position, abs=1e-5)
    key(viewer, glfw.KEY_Z, CTRL)
    assert tuple(thing(viewer, "ball").world_from_object.position) == (0, 0.061, -0.12)


def test_a_body_is_given_taken_and_weighed(viewer):
    objects, world = viewer.objects, viewer.stage.world
    item = edits.find(viewer.stage.document.file, "ball")
    assert objects.change(item, "body", collider=None)
    assert world.things["ball"].body is None
    key(viewer, glfw.KEY_Z, CTRL)
    assert world.things["ball"].body is not None
    item = edits.find(viewer.stage.document.file, "ball")
    assert objects.change(item, "mass", mass_kg=2.0)
    assert world.physics.mass(world.things["ball"].body) == pytest.approx(2.0)
    assert objects.change(item, "body", static=True) and not world.things["ball"].moves


def test_a_collider_that_cannot_be_made_is_a_sentence(viewer):
    objects, stage = viewer.objects, viewer.stage
    item = edits.find(stage.document.file, "ball")
    assert objects.change(item, "body", collider="touch/none.obj")
    end = time.monotonic() + 20
    while stage.bodies.busy and time.monotonic() < end:
        run_frames(viewer, 1)
        time.sleep(0.005)
    run_frames(viewer, 2)
    assert "ball" in stage.problem and "touched" in stage.problem
    assert stage.world.things["ball"].body is None
    stage.problem = ""


def test_an_empty_scene_is_shown_and_undone(plain):
    plain.stage.chosen = "ball"
    key(plain, glfw.KEY_DELETE)
    run_frames(plain, 3)
    assert names(plain) == []
    key(plain, glfw.KEY_F)
    key(plain, glfw.KEY_SPACE)
    key(plain, glfw.KEY_Z, CTRL)
    assert names(plain) == ["ball"]


def test_a_long_list_and_every_part_of_the_panel_is_drawn(viewer):
    for _ in range(9):
        viewer.stage.chosen = "ball"
        viewer.objects.duplicate()
    run_frames(viewer, 3)
    assert len(names(viewer)) == 14 and len(viewer.stage.sliders) == 1
    viewer.stage.chosen = "background"
    run_frames(viewer, 2)
    viewer.stage.move(1, thing(viewer, "plate").world_from_object)
    run_frames(viewer, 2)
    viewer.objects.keep_standing()
    assert viewer.stage.document.file.items[0].position == (0.28, 0.005, 0.1)
