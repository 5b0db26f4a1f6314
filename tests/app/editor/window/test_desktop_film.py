"""The sections Film and Gallery in the real window, by a real mouse and real keys."""

import time
from types import SimpleNamespace

import numpy as np
import pytest

from shapeshift.app.editor.panels import panel
from shapeshift.app.editor.window.window import Drop
from shapeshift.app.film.window.timeline import CAMERA, STOP
from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.stop_weights import StopWeights
from shapeshift.scene.film.film_path import read_film_file
from tests.support.desktop.desktop_stand import run_frames
from tests.support.desktop.widgets import Widgets


@pytest.fixture
def only(monkeypatch):
    """Takes a tool, and folds all its sections but one."""

    def fold_all_but(viewer, tool: str, name: str) -> None:
        viewer.shell.choose_tool(tool)
        monkeypatch.setattr(panel, "section", lambda other, *_: other == name)

    return fold_all_but


@pytest.fixture
def film(viewer, hands, only, monkeypatch):
    """(viewer, hands, widgets) with the section Film open, its strip as a function of seconds."""
    only(viewer, "Film", "Film")
    widgets = Widgets(monkeypatch)
    run_frames(viewer, 3)
    return viewer, hands, widgets


def at(viewer, widgets, seconds: float, row: int) -> tuple[float, float]:
    """Where a time lies on the strip, logical pixels; row 0: cameras, 1: stops."""
    left, top, right, low = widgets.boxes["timeline"]
    pad = 8 * viewer.window.ui_scale
    share = seconds / viewer.state.timeline.keys.seconds
    return left + pad + (right - left - 2 * pad) * share, top + (low - top) * (0.25 + 0.5 * row)


def test_the_timeline_lies_over_the_whole_lower_edge(film):
    """From the left edge of the window to the right one, above the status line; its cross and any
    other tool put it away, and the keys stay.
    """
    viewer, hands, widgets = film
    width, _ = viewer.window.logical_size
    strip, free = viewer.layout.strip, viewer.layout.free
    assert strip[0] == 0 and strip[2] == width and strip[3] == viewer.layout.status[1]
    assert strip in viewer.window.covered and viewer.layout.bar[3] <= strip[1]
    left, _, right, _ = widgets.boxes["timeline"]
    assert right - left > 0.85 * width
    hands.click(*widgets.middle("Key view"))
    hands.click(*widgets.middle("\u00d7"))
    assert viewer.layout.strip is None and viewer.layout.free[3] > free[3]
    assert len(viewer.state.timeline.keys.cameras) == 1
    hands.click(*widgets.middle("Film"))
    assert viewer.layout.strip == strip
    viewer.state.overlay = False
    run_frames(viewer, 1)
    assert viewer.layout.strip is None


def test_keys_are_set_dragged_deleted_and_brought_back(film):
    viewer, hands, widgets = film
    timeline = viewer.state.timeline
    hands.click(*widgets.middle("Key view"))
    hands.click(*widgets.middle("Key stop"))
    hands.click(*at(viewer, widgets, 6.0, 0))  # the playhead: nothing else is there
    assert timeline.at_s == pytest.approx(6.0, abs=0.05)
    viewer.state.set_x(0, 1.0)
    hands.click(*widgets.middle("Key stop"))
    assert [key.word for key in timeline.keys.stops] == ["photo", "thermal"]
    assert timeline.keys.times(CAMERA) == [0.0]
    hands.drag(at(viewer, widgets, 6.0, 1), at(viewer, widgets, 8.0, 1))
    assert timeline.keys.times(STOP) == pytest.approx([0.0, 8.0], abs=0.06)
    hands.click(*widgets.middle("Delete key"))
    assert timeline.keys.times(STOP) == [0.0]
    hands.key("z", "Control_L")
    assert timeline.keys.times(STOP) == pytest.approx([0.0, 8.0], abs=0.06)
    hands.key("z", "Control_L")
    assert timeline.keys.times(STOP) == pytest.approx([0.0, 6.0], abs=0.06)


def test_the_playhead_shows_the_film_and_the_mouse_leaves_it(film):
    viewer, hands, widgets = film
    hands.click(*widgets.middle("Around"))
    assert len(viewer.state.timeline.keys.cameras) == 9
    before = viewer.viewpoint.view().world_from_eye.position
    hands.drag(at(viewer, widgets, 2.0, 1), at(viewer, widgets, 5.0, 1))
    there = viewer.viewpoint.view().world_from_eye.position
    assert viewer.viewpoint.flown is not None and np.linalg.norm(there - before) > 1
    plan = viewer.films.preview.plan
    wanted = plan.view(viewer.state.timeline.frame(plan)).world_from_eye.position
    np.testing.assert_allclose(there, wanted)
    hands.drag((600, 300), (660, 300))
    assert viewer.viewpoint.flown is None
    moved = viewer.viewpoint.view().world_from_eye.position
    assert 0 < np.linalg.norm(moved - there) < np.linalg.norm(there)


def test_a_preview_plays_until_it_is_paused(film):
    viewer, hands, widgets = film
    hands.click(*widgets.middle("Around"))
    hands.click(*widgets.middle("Preview"))
    timeline = viewer.state.timeline
    assert timeline.playing and viewer.busy()
    began = timeline.at_s
    run_frames(viewer, 10, seconds=0.1)
    assert timeline.at_s == pytest.approx(began + 1.0)
    hands.click(*widgets.middle("Pause"))
    assert not timeline.playing
    run_frames(viewer, 3, seconds=0.1)
    rested = timeline.at_s
    run_frames(viewer, 3, seconds=0.1)
    assert timeline.at_s == rested


def test_a_path_is_saved_and_dropped_again(film, tmp_path):
    viewer, hands, widgets = film
    hands.click(*widgets.middle("Around"))
    hands.click(*widgets.middle("Key stop"))
    hands.click(*widgets.middle("Save path"))
    (path,) = (tmp_path / "films").iterdir()
    assert str(path) in viewer.state.messages.note
    saved = read_film_file(path)
    assert len(saved.keys) == 9 and saved.style == "photo@0s"
    hands.click(*widgets.middle("Clear"))
    assert not viewer.state.timeline.keys.cameras
    viewer.handle_event(Drop((path,)))
    run_frames(viewer, 2)
    assert len(viewer.state.timeline.keys.cameras) == 9
    path.write_text('{"shapeshift_film": 1, "cameras": []}')
    viewer.handle_event(Drop((path,)))
    assert "no camera" in viewer.state.problem
    assert len(viewer.state.timeline.keys.cameras) == 9


def test_a_scene_of_no_file_says_so_when_it_is_filmed(film):
    """The stand's ball lies nowhere: what the command would say is said in the window."""
    viewer, hands, widgets = film
    hands.click(*widgets.middle("Around"))
    viewer.films.rendering.ending = ".webp"
    run_frames(viewer, 2)
    hands.click(*widgets.middle("Render"))
    end = time.monotonic() + 60
    while viewer.films.rendering.running and time.monotonic() < end:
        run_frames(viewer, 1)
        time.sleep(0.01)
    assert "ball.shift" in viewer.state.problem


def test_a_video_that_wants_an_extra_offers_it(film, monkeypatch):
    """Without PyAV the first choice works; .mp4 has a button in place of Render."""
    viewer, hands, widgets = film
    rendering = viewer.films.rendering
    rendering.ending, rendering.pyav.missing = ".webp", True
    began: list[list[str]] = []
    child = SimpleNamespace(
        progress=("installing film", 0.0), code=None, cancelled=False, problem=lambda: "no network."
    )
    monkeypatch.setattr(
        "shapeshift.app.film.window.rendering.ProgramChild",
        lambda words: began.append(words) or child,
    )
    hands.click(*widgets.middle("Around"))
    assert "Render" in widgets.boxes and "Install (104 MB)" not in widgets.boxes
    rendering.ending = ".mp4"
    widgets.boxes.clear()
    run_frames(viewer, 2)
    assert "Render" not in widgets.boxes
    for code, left in ((2, True), (0, False)):  # the button comes again where it failed
        child.code = None
        hands.click(*widgets.middle("Install (104 MB)"))
        assert began.pop() == ["extras", "film"] and rendering.pyav.running
        child.code, child.problem = code, lambda code=code: "no network." * bool(code)
        widgets.boxes.clear()
        run_frames(viewer, 2)
        assert rendering.pyav.missing is left and not rendering.pyav.running
        assert ("no network." in viewer.state.problem) is left or not left
    assert "Render" in widgets.boxes and "Installed" in viewer.state.messages.note


def test_two_stops_are_picked_by_clicks_and_slid_between(viewer, hands, only, monkeypatch):
    only(viewer, "Style", "Gallery")
    widgets = Widgets(monkeypatch)
    end = time.monotonic() + 30
    run_frames(viewer, 2)
    while len(viewer.films.gallery.thumbnails.pictures) < 2:
        assert time.monotonic() < end
        run_frames(viewer, 1)
        time.sleep(0.01)
    hands.click(*widgets.middle("thermal"))
    assert viewer.state.scene.objects[0].x == 1.0
    hands.click(*widgets.middle("photo"))
    assert viewer.films.gallery.picked == ("thermal", "photo")
    assert viewer.state.scene.objects[0].x == 0.0
    _, top, right, low = widgets.boxes["Slide"]
    hands.click(right, top - (low - top) * 0.8)  # the middle of the slider above the button
    x = viewer.state.scene.objects[0].x
    weights = viewer.state.scene.objects[0].model.blend.weights(x)
    assert isinstance(x, StopWeights | float) and 0 < weights[1] < 1
    hands.click(*widgets.middle("Slide"))
    assert viewer.films.gallery.sliding
    run_frames(viewer, 10, seconds=0.1)
    assert viewer.state.scene.objects[0].x != x
    hands.click(*widgets.middle("Stop"))
    assert not viewer.films.gallery.sliding


def test_styles_have_a_row_of_their_own(viewer, only, monkeypatch):
    """A style between two photographed stops parts neither of them in the gallery."""
    only(viewer, "Style", "Gallery")
    named = {"RGB": "rgb", "Melt": "style", "Thermal": "thermal", "Opened": "layer"}
    stops = tuple(Stop(name, x / 3, kind) for x, (name, kind) in enumerate(named.items()))
    monkeypatch.setattr(type(viewer.films.gallery), "stops", stops)
    widgets = Widgets(monkeypatch)
    run_frames(viewer, 3)
    photographed = [widgets.boxes[name] for name in ("RGB", "Thermal", "Opened")]
    lefts = [left for left, *_ in photographed]
    assert len({top for _, top, _, _ in photographed}) == 1 and lefts == sorted(lefts)
    left, top, _, _ = widgets.boxes["Melt"]
    assert top > photographed[0][3] and left == lefts[0]
