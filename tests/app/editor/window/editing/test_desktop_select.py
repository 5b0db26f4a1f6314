"""Choosing splats in the real window: lasso, sphere, colour, histogram, floaters in three clicks.

The scene is two balls, a green one and a small red one, with floaters planted in the air.
"""

import time
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app.editor.state.files.exporting import PACKAGE
from shapeshift.app.editor.state.files.opened import OpenedFiles, Source
from shapeshift.app.editor.state.parts.parts_lit import BINS, SIZE
from shapeshift.app.editor.state.parts.selecting import COLOR, LASSO, SPHERE, THING
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import write_package
from tests.support.desktop.desktop_stand import ball, run_frames
from tests.support.desktop.objects_stand import place_of, viewer_of
from tests.support.desktop.real_hands import RealHands
from tests.support.desktop.widgets import Widgets
from tests.support.splat_scenes import random_model

GREEN, RED, JUNK = slice(0, 2000), slice(2000, 2300), slice(2300, 2320)


def scene_of_balls():
    """2,000 green splats, 300 red and smaller ones, 20 floaters: 17 small and 3 huge and faint."""
    rng = np.random.default_rng(5)
    green = ball(2000)
    red = ball(300).means * 0.3 + np.array([2.0, 0, 0])
    junk = rng.uniform((-1.0, 1.6, -1.0), (2.5, 2.6, 1.0), (20, 3))
    means = np.concatenate([green.means, red, junk]).astype(np.float32)
    count = len(means)
    scales = np.repeat([[0.04] * 3, [0.02] * 3, [0.03] * 3], [2000, 300, 20], axis=0)
    opacity = np.repeat([0.95, 0.95, 0.5], [2000, 300, 20])
    scales[-3:], opacity[-3:] = 0.5, 0.05
    sh = np.tile(np.array([[-1.0, 1.5, -1.0]]), (count, 1))
    sh[RED] = 1.5, -1.0, -1.0
    return replace(
        green, means=means, scales=scales.astype(np.float32), opacity=opacity.astype(np.float32),
        sh=sh[:, None].astype(np.float32), layer=np.zeros(count, np.int32),
        wxyz=np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1)),
    )  # fmt: skip


@pytest.fixture(scope="module")
def viewer(window, tmp_path_factory):
    """One for all tests: each leaves it with nothing chosen and nothing changed."""
    folder = tmp_path_factory.mktemp("balls")
    viewer = viewer_of(
        window, OpenedFiles((Source(folder / "balls.ply", scene_of_balls()),)), folder
    )
    viewer.state.bodies.follow = lambda edited: None
    viewer.parts.toggle()
    yield viewer
    viewer.parts.finder.close()


@pytest.fixture
def hands(viewer, display):
    tool = viewer.parts
    tool.clear()
    tool.selecting.drag = THING
    with RealHands(viewer, display) as hands:
        yield hands
        hands.button(False)
        for name in ("Shift_L", "Alt_L"):
            hands.hold_key(name, False)
        hands.move(880, 2)


def settle(viewer) -> None:
    """Frames until what was asked for has been worked out."""
    end = time.monotonic() + 60
    run_frames(viewer, 2)
    while viewer.polling and time.monotonic() < end:
        run_frames(viewer, 1)
        time.sleep(0.005)
    assert not viewer.polling
    run_frames(viewer, 2)


def share(tool, rows: slice) -> float:
    return float(tool.chosen[rows].mean()) if tool.count else 0.0


def test_a_lasso_takes_all_that_shows_inside(viewer, hands):
    tool = viewer.parts
    for _ in range(2):
        hands.key("u")
    assert tool.selecting.drag == LASSO and "lasso" in viewer.state.messages.note
    x, y = place_of(viewer, (2.0, 0.0, 0.0))
    edge = place_of(viewer, (2.4, 0.0, 0.0))[0] - x
    turn = np.linspace(0, 2 * np.pi, 13)[:-1]
    way = np.c_[x + edge * np.cos(turn), y + edge * np.sin(turn)]
    hands.move(*way[0])
    hands.button(True)
    for place in way[1:]:
        hands.move(*place)
    hands.button(False)
    assert share(tool, RED) > 0.98 and share(tool, GREEN) < 0.02
    hands.hold_key("Alt_L", True)
    hands.move(x, y - edge)
    hands.button(True)
    for place in ((x + edge, y - edge), (x + edge, y + edge), (x, y + edge)):  # its right half
        hands.move(*place)
    hands.button(False)
    assert 0.4 < share(tool, RED) < 0.6
    hands.hold_key("Alt_L", False)
    hands.key("z", "Control_L")
    assert share(tool, RED) > 0.98


def test_a_sphere_grows_from_a_surface(viewer, hands):
    tool = viewer.parts
    tool.selecting.drag = SPHERE
    x, y = place_of(viewer, (0.0, 0.0, 1.0))  # the front of the green ball
    radius = place_of(viewer, (0.5, 0.0, 1.0))[0] - x
    hands.drag((x, y), (x + radius, y))
    places = viewer.state.scene.objects[0].model.means
    away = np.linalg.norm(places - [0, 0, 1.0], axis=1)
    assert tool.chosen[away < 0.4].all() and not tool.chosen[away > 0.6].any()
    before = tool.chosen
    hands.drag((880, 20), (860, 40))  # on nothing
    assert tool.chosen is before and "surface" in viewer.state.messages.note


def test_a_click_takes_a_colour_everywhere(viewer, hands):
    tool = viewer.parts
    tool.selecting.drag = COLOR
    hands.click(*place_of(viewer, (2.0, 0.0, 0.3)))
    settle(viewer)
    assert share(tool, RED) == 1 and share(tool, GREEN) == 0
    hands.hold_key("Shift_L", True)
    hands.click(*place_of(viewer, (0.0, 0.0, 1.0)))
    settle(viewer)
    hands.hold_key("Shift_L", False)
    assert share(tool, RED) == 1 and share(tool, GREEN) == 1


def test_a_drag_over_the_histogram_chooses(viewer, hands, monkeypatch):
    tool, widgets = viewer.parts, Widgets(monkeypatch)
    tool.selecting.measuring.quantity = SIZE
    settle(viewer)
    left, top, right, low = widgets.boxes["##histogram"]
    histogram = tool.selecting.measuring.histogram(viewer.state.scene.objects[0])
    assert histogram.counts.sum() == 2320
    edge = np.searchsorted(histogram.edges, 0.025)  # the red ones are smaller
    end = left + (edge - 0.5) / BINS * (right - left)
    hands.drag((left + 1, (top + low) / 2), (end, (top + low) / 2))
    assert share(tool, RED) == 1 and share(tool, GREEN) == 0 and share(tool, JUNK) == 0
    hands.hold_key("Shift_L", True)
    hands.drag((right - 2, top + 9), (right - 12, top + 9))  # the huge ones, from the other side
    hands.hold_key("Shift_L", False)
    assert share(tool, RED) == 1 and tool.chosen[-3:].all() and tool.count == 303


def test_floaters_go_in_three_clicks(viewer, hands, monkeypatch):
    """The tool, Floaters, Delete; Ctrl+Z brings them back."""
    tool, state, widgets = viewer.parts, viewer.state, Widgets(monkeypatch)
    tool.toggle()
    hands.key("o")
    hands.click(*widgets.middle("Floaters"))
    settle(viewer)
    assert share(tool, JUNK) > 0.9 and share(tool, GREEN) == share(tool, RED) == 0
    assert "look like floaters" in state.messages.note
    gone = tool.count
    hands.click(*widgets.middle("Delete"))
    assert state.scene.objects[0].model.splat_count == 2320 - gone
    hands.key("z", "Control_L")
    assert state.scene.objects[0].model.splat_count == 2320 and not viewer.objects.unsaved


def test_a_model_with_anchors_left_out_is_a_package_again(window, display, tmp_path):
    """It keeps its slider: networks, stops and the anchors that are left."""
    path, model = tmp_path / "model.shift", random_model(60, per_anchor=4)
    write_package(model, path, "float32")
    model = read_package(path)
    viewer = viewer_of(window, OpenedFiles((Source(path, model),)), tmp_path)
    viewer.state.bodies.follow = lambda edited: None
    tool = viewer.parts
    tool.toggle()
    gone = np.arange(60) % 3 == 0
    tool.choose(viewer.state.scene.objects[0], gone, "replace")
    with RealHands(viewer, display) as hands:
        hands.key("Delete")
        hands.key("Escape")
    exporting = viewer.exporting
    exporting.ending = PACKAGE
    exporting.start()
    while exporting.running:
        run_frames(viewer, 1)
    (written,) = (tmp_path / "exports").iterdir()
    again = read_package(written)
    assert written.name == "model.shift" and str(written) in viewer.state.messages.note
    np.testing.assert_array_equal(again.anchors, model.anchors[~gone])
    np.testing.assert_array_equal(again.features, model.features[~gone])
    assert [stop.x for stop in again.stops] == [stop.x for stop in model.stops]
