"""Touching in the real window: mouse and keys act on the world, the picture shows what happens."""

from pathlib import Path

import glfw
import numpy as np
import pytest

from shapeshift.app.editor.desktop import Options, Viewer
from shapeshift.app.editor.panels.sections.touch_panel import pad_object, pad_of, side_names
from shapeshift.app.editor.state.bodies import made_of
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.edited_file import EditedFile
from shapeshift.app.editor.state.files.opened import Source
from shapeshift.app.editor.window.touch import HAND, MouseTouch
from shapeshift.app.editor.window.window import DoubleClick, Drag, KeyDown, Press, Release, Wheel
from shapeshift.scene.colliders.collider import Collider, box_around
from shapeshift.scene.document.edits import History
from shapeshift.scene.document.scene_file import FirstView, SceneFile, SceneItem, scene_of
from shapeshift.scene.world.reactions import Reaction, State, TwoAxes
from shapeshift.scene.world.world import World
from tests.support.desktop.desktop_stand import PlainRenderer, ball, run_frames

pytest.importorskip("rapier3d")
HALF = 0.1
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
BOX = Collider((HALF * CORNERS,), box_around(HALF * CORNERS))
STATES = (State("cold", 0.0), State("warm", 0.5), State("hot", 1.0))
ITEMS = (
    SceneItem(
        name="cube", model="a", position=(0.0, 0.1, 0.0), collider="hulls", states=STATES,
        reactions=(
            Reaction(on="ray", to="hot", seconds=0.2), Reaction(on="grab", to="warm", seconds=0.0)
        ),
    ),
    SceneItem(
        name="post", model="a", position=(0.6, 0.1, 0.0), collider="hulls", static=True,
        two_axes=TwoAxes(),
    ),
)  # fmt: skip
FILE = SceneFile(
    folder=Path(), items=ITEMS, floor_y=0.0, view=FirstView((0.0, 0.4, 2.0), (0.0, 0.2, 0.0))
)


@pytest.fixture
def viewer(window, tmp_path):
    """A cube that can be carried and a post that cannot, on a floor, things moving."""
    model = ball(200)
    models = {item.name: model for item in ITEMS}
    source = Source(Path("a"), model)
    state = EditorState(lambda path: model)
    edited = EditedFile(History.of(FILE), saved=FILE, sources={("a", "", "", False, None): source})
    state.open_sources([source, source], scene_of(FILE, models), None, edited)
    state.bodies._of = {item.name: (made_of(item), BOX) for item in ITEMS}  # nothing is cut up
    with state.bodies:
        options = Options(pictures=tmp_path, play=True)
        viewer = Viewer(window, PlainRenderer(window.ctx), state, options)
        run_frames(viewer, 3)
        yield viewer


def press_key(viewer, key: int, shift: bool = False) -> None:
    viewer.handle_event(KeyDown(key, shift))


def on_screen(viewer, point: np.ndarray) -> tuple[float, float]:
    """Logical pixels of a point of the world."""
    view = viewer.viewpoint.view()
    clip = view.clip_from_eye() @ view.eye_from_world() @ np.append(point, 1.0)
    (x, y), (width, height) = clip[:2] / clip[3], viewer.window.logical_size
    return float((x + 1) / 2 * width), float((1 - y) / 2 * height)


def place(viewer, name: str = "cube") -> np.ndarray:
    return viewer.state.world.objects[name].pose.position


def hold(viewer, name: str = "cube") -> tuple[float, float]:
    at = on_screen(viewer, place(viewer, name))
    viewer.handle_event(Press("left", *at))
    return at


def test_a_drag_carries_what_lies_under_the_mouse(viewer):
    before = viewer.viewpoint.view()
    at = hold(viewer)
    assert viewer.state.world.held(HAND) == "cube" and viewer.state.chosen == "cube"
    for _ in range(30):
        viewer.handle_event(Drag("left", 2.0, -4.0))
        run_frames(viewer, 1)
    run_frames(viewer, 10, seconds=0.05)
    x, y = on_screen(viewer, place(viewer))
    assert x - at[0] == pytest.approx(60, abs=6) and y - at[1] == pytest.approx(-120, abs=8)
    drawn = viewer.state.scene.objects[0].world_from_object.position
    np.testing.assert_allclose(drawn, place(viewer), atol=0.02)
    np.testing.assert_array_equal(viewer.viewpoint.view().eye_from_world(), before.eye_from_world())
    viewer.handle_event(Release("left"))
    assert viewer.state.world.held(HAND) is None
    run_frames(viewer, 25, seconds=0.08)
    assert place(viewer)[1] == pytest.approx(HALF, abs=0.005)  # it fell back to the floor


def test_a_flick_throws(viewer):
    hold(viewer)
    for _ in range(12):
        viewer.handle_event(Drag("left", 12.0, -6.0))
        run_frames(viewer, 1, seconds=1 / 60)
    viewer.handle_event(Release("left"))
    speed = viewer.state.world.physics.velocity(viewer.state.world.objects["cube"].body)[0]
    assert speed[0] > 0.5 and speed[1] > 0.2


def test_the_wheel_pushes_and_shift_turns(viewer, monkeypatch):
    hold(viewer)
    distance = np.linalg.norm(place(viewer) - viewer.viewpoint.camera.position)
    zoom = viewer.viewpoint.camera.distance
    viewer.handle_event(Drag("left", 0.0, -60.0))
    viewer.handle_event(Wheel(4))
    run_frames(viewer, 12, seconds=0.08)
    assert viewer.viewpoint.camera.distance == zoom
    assert np.linalg.norm(place(viewer) - viewer.viewpoint.camera.position) > distance + 0.3
    monkeypatch.setattr(viewer.window, "held", lambda key: key == glfw.KEY_LEFT_SHIFT)
    where = place(viewer).copy()
    viewer.handle_event(Drag("left", 100.0, 0.0))
    run_frames(viewer, 12, seconds=0.08)
    np.testing.assert_allclose(place(viewer), where, atol=0.02)
    w, _, y, _ = viewer.state.world.objects["cube"].pose.wxyz
    assert 2 * np.arctan2(y, w) == pytest.approx(0.8, abs=0.05)  # 100 pixels of 0.008
    monkeypatch.undo()


@pytest.mark.parametrize("how", ["elsewhere", "static", "paused", "right button"])
def test_what_is_not_for_the_hand_turns_the_camera(viewer, how):
    if how == "paused":
        press_key(viewer, glfw.KEY_T)
    at = {"static": on_screen(viewer, place(viewer, "post")), "elsewhere": (450.0, 20.0)}
    button = "right" if how == "right button" else "left"
    viewer.handle_event(Press(button, *at.get(how, on_screen(viewer, place(viewer)))))
    before = viewer.viewpoint.view().eye_from_world()
    viewer.handle_event(Drag(button, 40.0, 0.0))
    run_frames(viewer, 5)
    viewer.handle_event(Release(button))
    assert viewer.state.world.held(HAND) is None
    assert np.abs(viewer.viewpoint.view().eye_from_world() - before).max() > 0.01


@pytest.mark.parametrize(
    "event", [KeyDown(glfw.KEY_ESCAPE, False), Press("right", 5, 5), DoubleClick(450, 300),
              KeyDown(glfw.KEY_T, False), KeyDown(glfw.KEY_R, False)],
    ids=["escape", "another button", "double click", "pause", "put back"],
)  # fmt: skip
def test_it_lets_go(viewer, event):
    hold(viewer)
    run_frames(viewer, 2)
    viewer.handle_event(event)
    assert viewer.state.world.held(HAND) is None
    run_frames(viewer, 2)
    viewer.handle_event(Drag("left", 10.0, 0.0))
    viewer.handle_event(Release("left"))
    run_frames(viewer, 2)


def test_a_second_button_ends_what_the_first_one_held(viewer, monkeypatch):
    window = viewer.window
    window.on_cursor(None, *on_screen(viewer, place(viewer)))
    window.on_button(None, glfw.MOUSE_BUTTON_LEFT, glfw.PRESS, 0)
    run_frames(viewer, 2)
    assert viewer.state.world.held(HAND) == "cube"
    window.on_button(None, glfw.MOUSE_BUTTON_RIGHT, glfw.PRESS, 0)
    window.on_button(None, glfw.MOUSE_BUTTON_LEFT, glfw.RELEASE, 0)
    window.on_button(None, glfw.MOUSE_BUTTON_RIGHT, glfw.RELEASE, 0)
    run_frames(viewer, 2)
    assert viewer.state.world.held(HAND) is None
    events = []
    monkeypatch.setattr(viewer, "handle_event", events.append)
    window.on_cursor(None, 300.0, 200.0)
    run_frames(viewer, 1)
    assert not any(isinstance(event, Drag) for event in events), "no button counts as pressed"


def test_it_lets_go_of_what_is_gone(viewer):
    hold(viewer)
    viewer.state.world.remove("cube")
    run_frames(viewer, 2)
    assert viewer.state.world.held(HAND) is None
    viewer.handle_event(Release("left"))


def test_keys_play_step_and_put_back(viewer):
    world = viewer.state.world
    run_frames(viewer, 5)
    going = world.steps
    assert going > 3
    press_key(viewer, glfw.KEY_T)
    run_frames(viewer, 5)
    assert world.paused and world.steps == going
    press_key(viewer, glfw.KEY_T, shift=True)
    assert world.steps == going + 1 and world.paused
    press_key(viewer, glfw.KEY_T)
    hold(viewer)
    viewer.handle_event(Drag("left", 80.0, -80.0))
    run_frames(viewer, 10)
    assert world.objects["cube"].reaction_state.x == 0.5
    press_key(viewer, glfw.KEY_R)
    np.testing.assert_allclose(place(viewer), [0, 0.1, 0], atol=1e-6)
    obj = viewer.state.scene.objects[0]
    assert obj.x == 0.0
    np.testing.assert_allclose(obj.world_from_object.position, [0, 0.1, 0], atol=1e-6)


@pytest.mark.parametrize("paused", [False, True])
def test_a_ray_at_the_mouse_is_answered(viewer, paused):
    world = viewer.state.world
    world.paused = paused
    viewer.window.on_cursor(None, *on_screen(viewer, place(viewer)))
    press_key(viewer, glfw.KEY_X)
    assert len(viewer.touch.flashes) == 1
    run_frames(viewer, 2)
    if paused:
        assert world.objects["cube"].reaction_state.state == "hot"
        world.paused = False
    run_frames(viewer, 15)
    assert viewer.state.scene.objects[0].x == 1.0
    assert list(viewer.touch.reactions) == ["cube: hit by a ray, now hot"]
    assert [label.text for label in viewer.touch.labels] == ["hot"]
    run_frames(viewer, 20, seconds=0.1)
    assert not viewer.touch.fading
    viewer.window.on_cursor(None, 450.0, 5.0)  # the sky
    press_key(viewer, glfw.KEY_X)
    assert not viewer.touch.flashes


def picture(viewer) -> np.ndarray:
    viewer.window.begin_frame()
    viewer.draw_splats()
    viewer.draw_overlay()
    viewer.window.end_frame()
    return viewer.window.picture().astype(int)


def test_colliders_are_seen_where_they_are(viewer):
    plain = picture(viewer)
    press_key(viewer, glfw.KEY_J)
    wires = picture(viewer)
    changed = np.abs(wires - plain).max(axis=2) > 20
    corners = np.array([on_screen(viewer, HALF * c + [0, 0.1, 0]) for c in CORNERS])
    low, high = corners.min(axis=0) - 2, corners.max(axis=0) + 2
    (left, top), (right, bottom) = low.astype(int), high.astype(int)
    assert changed[top:bottom, left:right].any(axis=0).mean() > 0.9
    green = wires[top:bottom, left:right][changed[top:bottom, left:right]]
    assert (green[:, 1] > green[:, 2]).mean() > 0.9  # it moves
    beside = changed[:, 280:left]
    assert not beside.any()
    press_key(viewer, glfw.KEY_J)
    assert np.array_equal(picture(viewer), plain)


def test_at_rest_the_loop_sleeps_though_things_may_move(viewer):
    for _ in range(400):
        viewer.state.world.step()
    run_frames(viewer, 3)
    assert viewer.state.world.resting and not viewer.busy() and not viewer.polling
    drawn = viewer.renderer.draws
    run_frames(viewer, 5)
    assert viewer.renderer.draws == drawn
    hold(viewer)
    run_frames(viewer, 1)
    assert viewer.busy()


def test_without_a_world_nothing_is_taken(viewer):
    viewer.state.bodies.world = None
    parts = (viewer.touch, viewer.state, viewer.window, viewer.viewpoint, viewer.hands)
    for event in (Press("left", 450, 300), KeyDown(glfw.KEY_J, False)):
        assert not MouseTouch(*parts).handle_event(event)
    assert MouseTouch(*parts).handle_event(KeyDown(glfw.KEY_T, False))
    assert viewer.state.messages.note  # it says why nothing moves, or that it is kept
    viewer.touch.wanted = False
    run_frames(viewer, 2)
    assert viewer.touch.status() == ""


def new_world(viewer) -> World:
    models = {item.name: ball(20) for item in ITEMS}
    viewer.state.bodies.world = World(FILE, models, dict.fromkeys(models, BOX))
    return viewer.state.bodies.world


def test_another_scene_waits_unless_it_is_to_play_and_another_floor_does_not(viewer):
    assert not viewer.state.world.paused
    viewer.touch.play = False
    world = new_world(viewer)  # of another floor
    run_frames(viewer, 3)
    assert not world.paused and world.steps > 0
    viewer.touch.forget()
    world = new_world(viewer)
    run_frames(viewer, 3)
    assert world.paused and world.steps == 0
    assert "T lets them move" in viewer.touch.status()


def test_a_pad_is_of_the_chosen_object_and_moves_its_x(viewer):
    state, touch = viewer.state, viewer.touch
    assert pad_object(touch) == "post"
    state.chosen = "cube"  # which has none
    assert pad_object(touch) == "post"
    touch.control("post", TwoAxes().x(-0.5, 0.8))
    run_frames(viewer, 2)
    assert state.scene.objects[1].x == pytest.approx(0.3)
    balance, power = touch.pads["post"]
    assert TwoAxes().x(balance, power) == pytest.approx(0.3)
    assert side_names(touch.world.objects["cube"], TwoAxes()) == ("cold", "hot")
    assert side_names(touch.world.objects["post"], TwoAxes(0.0, 0.2, 0.7)) == ("photo", "")


# The pad, without a window


@pytest.mark.parametrize("axes", [TwoAxes(), TwoAxes(0.2, 0.5, 0.9), TwoAxes(1.0, 0.0, 0.0),
                                  TwoAxes(0.0, 0.0, 1.0)])  # fmt: skip
def test_a_pad_shows_what_gives_x(axes):
    rng = np.random.default_rng(0)
    for balance, power in [(0, 0), (1, 1), (-1, 1), *rng.uniform((-1, 0), (1, 1), (50, 2))]:
        x = axes.x(balance, power)
        assert pad_of(axes, x, (balance, power)) == (balance, power)
        for last in [(0.0, 1.0), (0.3, 0.0), (-1.0, 0.2)]:
            found = pad_of(axes, x, last)
            assert axes.x(*found) == pytest.approx(x, abs=1e-4)
    outside = pad_of(TwoAxes(0.2, 0.5, 0.9), 1.0, (0.0, 0.5))
    assert outside == (1.0, 1.0)
