"""The timeline and the gallery without a window: keys, undo, files, what a preview shows."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app.editor.state.arrange import redo, undo
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.film.window.films import Preview
from shapeshift.app.film.window.gallery import SIZE, Gallery, thinned
from shapeshift.app.film.window.rendering import ProgramChild, Rendering
from shapeshift.app.film.window.timeline import CAMERA, STOP, Timeline
from shapeshift.runtime_models.stop_weights import StopWeights
from shapeshift.scene.cameras.camera_list import CameraList
from shapeshift.scene.cameras.framing import orbit_path
from shapeshift.scene.film.film_path import read_film_file, write_film_file
from tests.support.desktop.desktop_stand import ball
from tests.support.three_stops import three_stop_model, three_stop_package

PIXELS = (320, 180)


@pytest.fixture
def state():
    state = EditorState(lambda path: three_stop_model())
    state.open([Path("three.shift")])
    return state


@pytest.fixture
def viewpoint(state, tmp_path):
    return Viewpoint(state, lambda: PIXELS, lambda: np.array([0.0, 0, *PIXELS]), tmp_path)


@pytest.fixture
def preview(state, viewpoint):
    return Preview(state, viewpoint)


def key_stops(state, preview, *keys):
    for at_s, x in keys:
        state.timeline.at_s = at_s
        state.set_x(0, x)
        preview.key_stop()


def test_keys_stand_in_the_order_of_their_times(state, preview, viewpoint):
    timeline = state.timeline
    for at_s in (4.0, 1.0, 9.0):
        timeline.at_s = at_s
        preview.key_camera()
        assert timeline.chosen == (
            CAMERA,
            sorted([4.0, 1.0, 9.0][: [4, 1, 9].index(at_s) + 1]).index(at_s),
        )
    assert timeline.keys.times(CAMERA) == [1.0, 4.0, 9.0]
    timeline.at_s = 4.02  # as good as there: it is replaced
    preview.key_camera()
    assert timeline.keys.times(CAMERA) == [1.0, 4.02, 9.0]


def test_a_key_of_what_is_shown_says_its_stop_or_its_number(state, preview):
    blend = StopWeights((("RGB", 0.25), ("Opened", 0.75)))
    key_stops(state, preview, (0.0, 0.0), (3.0, 0.75), (6.0, blend))
    words = [key.word for key in state.timeline.keys.stops]
    assert words == ["RGB", "0.75", "RGB:0.25,Opened:0.75"]
    plan = preview.plan
    assert plan is not None and not state.timeline.problem
    assert plan.controls(len(plan.times) - 1) == (blend,)


@pytest.mark.parametrize(("to", "lands"), [(5.0, 5.0), (0.0, 1.05), (99.0, 7.95), (8.0, 7.95)])
def test_a_dragged_key_stays_between_its_neighbours(state, preview, to, lands):
    key_stops(state, preview, (1.0, 0.0), (4.0, 0.5), (8.0, 1.0))
    state.timeline.move(STOP, 1, to)
    assert state.timeline.keys.times(STOP) == pytest.approx([1.0, lands, 8.0])


def test_edits_of_the_film_are_undone_with_all_others(state, preview):
    """One step a key, one a whole drag; where the slider stands is not touched."""
    key_stops(state, preview, (0.0, 0.0))
    state.record_regions()
    key_stops(state, preview, (5.0, 1.0))
    state.record_regions()
    for at_s in (6.0, 6.5, 7.0):
        state.timeline.move(STOP, 1, at_s)
        state.record_regions()
    state.rest()
    times = lambda: state.timeline.keys.times(STOP)  # noqa: E731
    assert times() == [0.0, 7.0]
    assert undo(state) == "move a key of the stop" and times() == [0.0, 5.0]
    assert undo(state) == "key of a stop" and times() == [0.0]
    assert undo(state) == "key of a stop" and times() == []
    assert undo(state) == ""
    for _ in range(3):
        redo(state)
    assert times() == [0.0, 7.0] and state.scene.objects[0].x == 1.0


def test_a_longer_film_keeps_the_parts_at_which_its_keys_are(state, preview):
    key_stops(state, preview, (0.0, 0.0), (5.0, 1.0))
    preview.key_camera()
    state.timeline.set_clock(20.0, 24.0, (640, 360))
    keys = state.timeline.keys
    assert keys.times(STOP) == [0.0, 10.0] and keys.times(CAMERA) == [10.0]
    assert (keys.seconds, keys.fps, keys.size) == (20.0, 24.0, (640, 360))
    assert state.timeline.at_s == 10.0


def test_around_is_a_way_that_ends_where_it_began(state, preview):
    state.timeline.fill(state.document, None)
    keys = state.timeline.keys
    assert len(keys.cameras) == 9 and keys.times(CAMERA)[-1] == pytest.approx(10.0)
    first, last = keys.cameras[0].view, keys.cameras[-1].view
    np.testing.assert_allclose(
        first.world_from_eye.position, last.world_from_eye.position, atol=1e-9
    )
    plan = preview.plan
    middle = plan.view(len(plan.times) // 2).world_from_eye.position
    assert np.linalg.norm(middle - first.world_from_eye.position) > 1


def test_past_cameras_is_the_tour_of_the_command(state, preview):
    views = tuple(orbit_path(20, np.zeros(3), 1.0, PIXELS)[:12])
    state.timeline.fill(state.document, CameraList(views, ("",) * 12, "test"))
    assert len(state.timeline.keys.cameras) == 9
    eyes = [key.view.world_from_eye.position for key in state.timeline.keys.cameras]
    np.testing.assert_allclose(eyes[0], views[0].world_from_eye.position, atol=1e-6)
    np.testing.assert_allclose(eyes[-1], views[-1].world_from_eye.position, atol=1e-6)


def test_the_file_is_the_same_for_window_and_command(state, preview, tmp_path):
    """Written, read and taken over it is the same film, to the bit that JSON keeps: all."""
    state.timeline.fill(state.document, None)
    key_stops(state, preview, (0.0, 0.0), (6.0, 1.0))
    state.timeline.set_clock(8.0, 25.0, (640, 360))
    before = state.timeline.keys
    path = tmp_path / "a.film.json"
    write_film_file(before.path((5.0, 0.0, 0.0)), path)
    other = Timeline()
    other.take_over(read_film_file(path), (5.0, 0.0, 0.0))
    after = other.keys
    assert after.style == before.style and after.seconds == 8.0 and after.fps == 25.0
    for one, two in zip(before.cameras, after.cameras, strict=True):
        assert one.at_s == two.at_s
        a, b = one.view.world_from_eye, two.view.world_from_eye
        np.testing.assert_allclose(a.matrix(), b.matrix(), atol=1e-12)


def test_keys_without_times_get_those_of_the_film(state, preview):
    state.timeline.fill(state.document, None)
    film = state.timeline.keys.path((0, 0, 0))
    untimed = replace(film, keys=tuple(replace(k, at_s=None) for k in film.keys))
    other = Timeline()
    other.take_over(untimed, (0, 0, 0))
    times = other.keys.times(CAMERA)
    assert times[0] == 0 and times[-1] == pytest.approx(10.0) and (np.diff(times) > 0.5).all()


def test_a_preview_shows_the_frames_of_the_film(state, preview, viewpoint):
    """Picture by picture what the plan says, until a hand moves the camera."""
    state.timeline.fill(state.document, None)
    key_stops(state, preview, (0.0, 0.0), (10.0, 1.0))
    state.timeline.at_s = 0.0
    preview.toggle()
    for _ in range(4):
        state.advance(0.5)
        assert preview.each_frame()
    plan = preview.plan
    number = state.timeline.frame(plan)
    assert state.timeline.at_s == pytest.approx(2.0)
    assert state.scene.objects[0].x == plan.controls(number)[0]
    pose = viewpoint.view().world_from_eye.matrix()
    np.testing.assert_allclose(pose, plan.view(number).world_from_eye.matrix(), atol=1e-12)
    viewpoint.leave_camera()
    assert not preview.each_frame() and not state.timeline.playing
    np.testing.assert_allclose(viewpoint.view().world_from_eye.matrix(), pose, atol=1e-6)


def test_a_stop_that_went_away_is_a_sentence(state, preview):
    key_stops(state, preview, (0.0, 0.0), (5.0, 0.5))
    model = three_stop_model()
    state.replace_model(0, replace(model, stops=(model.stops[0], model.stops[2])))
    assert preview.plan is None and "Thermal" in state.timeline.problem


def test_another_scene_has_another_film(state, preview):
    key_stops(state, preview, (0.0, 0.0))
    state.open([Path("three.shift")])
    assert not state.timeline.keys.stops and state.timeline.plan(state.document) is None


# ---- the gallery


@pytest.fixture
def gallery(state):
    gallery = Gallery(state)
    gallery.seen = True
    yield gallery
    gallery.thumbnails.close()


def test_two_are_picked_and_the_third_takes_the_place_of_the_first(gallery, state):
    for name, picked, x in (
        ("RGB", ("RGB",), 0.0),
        ("Opened", ("RGB", "Opened"), 1.0),
        ("Thermal", ("Opened", "Thermal"), 0.5),
        ("Opened", ("Thermal",), 0.5),
        ("Thermal", (), 0.5),
    ):
        gallery.pick(name)
        assert gallery.picked == picked and state.scene.objects[0].x == x


@pytest.mark.parametrize("part", [0.0, 0.3, 1.0])
def test_the_way_between_two_is_straight(gallery, state, part):
    gallery.pick("RGB")
    gallery.pick("Opened")
    gallery.slide(part)
    weights = state.scene.objects[0].model.blend.weights(state.scene.objects[0].x)
    np.testing.assert_allclose(weights, [1 - part, 0, part], atol=1e-12)


def test_a_slide_goes_there_and_back_until_a_hand_takes_over(gallery, state):
    """Its function is the film's: beta is a smoothstep of the part of the way."""
    gallery.pick("RGB")
    gallery.pick("Opened")
    gallery.toggle_sliding()
    assert gallery.sliding and state.playing
    model, seen = state.scene.objects[0].model, []
    for _ in range(100):
        state.advance(0.1)
        weights = model.blend.weights(state.scene.objects[0].x)
        assert weights[1] == 0
        seen.append(weights[2])
    assert seen[9] == pytest.approx(0.25**2 * 2.5) and max(seen) == 1.0
    assert seen[45] == 1.0 and seen[69] == pytest.approx(0.5) and seen[95] == 0.0
    state.set_x(0, 0.25)
    state.advance(0.1)
    assert not gallery.sliding and state.scene.objects[0].x == 0.25


def test_every_stop_has_a_picture(gallery, state):
    end = time.monotonic() + 30
    while gallery.each_frame() and time.monotonic() < end:
        time.sleep(0.01)
    pictures = gallery.thumbnails.pictures
    assert list(pictures) == [0.0, 0.5, 1.0]
    for picture in pictures.values():
        assert picture.shape == (SIZE[1], SIZE[0], 3) and picture.std() > 3
    assert not np.array_equal(pictures[0.0], pictures[1.0])


def test_nobody_draws_what_nobody_looks_at(state):
    gallery = Gallery(state)
    assert not gallery.each_frame() and not gallery.thumbnails.pictures


def test_a_large_scene_is_thinned_for_its_pictures():
    assert thinned(ball(100)).splat_count == 100
    assert thinned(ball(300_001)).splat_count == 150_001


# ---- the command beside the window


def wait_for(rendering, seconds: float = 90.0) -> None:
    end = time.monotonic() + seconds
    while rendering.poll() and rendering.running:
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.fixture
def opened(tmp_path):
    """A scene that lies on the disk, and what renders its film."""
    from shapeshift.runtime_models.read_scene import read_model

    path = three_stop_package(tmp_path / "three.shift")
    state = EditorState(read_model)
    state.open([path])
    rendering = Rendering(state, tmp_path / "films")
    rendering.ending = ".webp"
    state.timeline.set_clock(1.0, 6.0, (64, 48))
    return state, rendering


def test_a_film_of_the_window_is_that_of_the_command(opened, tmp_path):
    from PIL import Image

    from shapeshift.app import cli

    state, rendering = opened
    state.timeline.fill(state.document, None)
    rendering.start()
    wait_for(rendering)
    assert not state.problem
    made = tmp_path / "films" / "three-001.webp"
    assert "6 frames" in state.messages.note and str(made) in state.messages.note
    path = tmp_path / "films" / "three-001.film.json"
    words = ["film", tmp_path / "three.shift", "--cameras", path, "--out", tmp_path / "a.webp"]
    assert cli.main(list(map(str, words))) == 0
    assert made.read_bytes() == (tmp_path / "a.webp").read_bytes()
    with Image.open(made) as image:
        assert image.n_frames == 6 and image.size == (64, 48)


def test_what_is_not_saved_is_not_filmed(opened):
    state, rendering = opened
    state.timeline.fill(state.document, None)
    state.add_region("sphere")
    state.record_regions()
    rendering.start()
    assert not rendering.running and "save it first" in state.problem


def test_a_cancelled_film_leaves_its_frames(opened, tmp_path):
    state, rendering = opened
    state.timeline.set_clock(30.0, 60.0, (640, 480))
    state.timeline.fill(state.document, None)
    rendering.start()
    end = time.monotonic() + 60
    frames = tmp_path / "films" / "three-001.frames"
    while not list(frames.glob("0*.png")) and time.monotonic() < end:
        assert rendering.poll()
        time.sleep(0.02)
    rendering.cancel()
    wait_for(rendering)
    assert (
        list(frames.glob("0*.png")) and not state.problem and "frames are in" in state.messages.note
    )
    assert not (tmp_path / "films" / "three-001.webp").exists()


def test_a_child_that_is_refused_says_why(tmp_path):
    child = ProgramChild(["film", str(tmp_path / "gone.shift"), "--out", str(tmp_path / "a")])
    end = time.monotonic() + 60
    while child.code is None and time.monotonic() < end:
        time.sleep(0.02)
    assert child.code == 2
    assert "gone.shift" in child.problem() and not child.problem().startswith("shapeshift")
