"""The tool "Parts" in the real window: real mouse and keys on the demo, whose truth we know.

The renderer is one that draws nothing, except where a picture is what is asked.
"""

import threading
import time

import numpy as np
import pytest

from shapeshift.app.editor.state.files.opened import OpenedFiles
from shapeshift.app.editor.state.parts.selecting import ALL
from shapeshift.app.paths import DEMO
from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.document.scene_file import BACKGROUND
from tests.support.desktop.desktop_stand import PlainRenderer, run_frames
from tests.support.desktop.objects_stand import names, place_of
from tests.support.desktop.real_hands import RealHands
from tests.support.desktop.scene_stand import hands_on, read, viewer_on
from tests.support.desktop.widgets import Widgets
from tools.synthetic.labels import LABELS, labels_of_places


@pytest.fixture(scope="module")
def demo() -> OpenedFiles:
    return read(DEMO)


@pytest.fixture(scope="module")
def truth(demo) -> np.ndarray:
    """(A,) label of each anchor of the demo, by the ray tracer's solids."""
    return labels_of_places(demo.sources[0].model.anchors.astype(np.float64))[0]


@pytest.fixture
def viewer(window, demo, tmp_path):
    viewer = viewer_on(window, PlainRenderer(window.ctx), demo, tmp_path / "pictures")
    yield viewer
    viewer.parts.finder.close()


@pytest.fixture
def hands(viewer, display):
    with hands_on(viewer, display, (2, 2)) as hands:
        yield hands


def settle(viewer) -> None:
    """Frames until what the mouse points at has been found."""
    end = time.monotonic() + 60
    run_frames(viewer, 2)
    while viewer.parts.finder.busy and time.monotonic() < end:
        run_frames(viewer, 1)
        time.sleep(0.005)
    assert not viewer.parts.finder.busy
    run_frames(viewer, 2)


def middle(viewer, truth, name: str) -> tuple[float, float]:
    """Where a thing of the demo is seen, logical pixels."""
    places = viewer.state.edited.source(viewer.state.edited.file.all_items[0]).model.anchors
    mine = places[truth == LABELS[name]]
    return place_of(viewer, np.median(mine, axis=0))


def iou(rows: np.ndarray, truth: np.ndarray, *things: str) -> float:
    mine = np.isin(truth, [LABELS[name] for name in things])
    return float((rows & mine).sum() / (rows | mine).sum())


def test_a_thing_lights_up_is_chosen_and_becomes_an_object(viewer, hands, truth):
    tool, state = viewer.parts, viewer.state
    hands.key("o")
    assert tool.on
    hands.move(*middle(viewer, truth, "mug"))
    settle(viewer)
    assert tool.found is not None and iou(tool.found.rows(), truth, "mug") > 0.8
    lit, tint = state.shown_scene.lit
    assert lit == "workshop" and np.array_equal(tint.strength > 0, tool.found.rows())
    assert tool.count == 0  # it is lit up, not chosen
    hands.button(True)
    hands.button(False)
    settle(viewer)
    assert tool.name == "workshop" and iou(tool.chosen, truth, "mug") > 0.8
    hands.key("Return")
    assert names(viewer) == [BACKGROUND, "object"] and state.chosen == "object"
    assert len(state.edited.history.steps) == 2 and viewer.objects.unsaved
    hands.key("z", "Control_L")
    assert names(viewer) == ["workshop"] and not viewer.objects.unsaved
    hands.key("y", "Control_L")
    assert names(viewer) == [BACKGROUND, "object"]
    hands.key("Escape")
    assert not tool.on and state.shown_scene.lit is None


def test_shift_adds_alt_removes_and_ctrl_z_goes_back(viewer, hands, truth):
    tool = viewer.parts
    hands.key("o")
    hands.click(*middle(viewer, truth, "mug"))
    settle(viewer)
    one = tool.count
    hands.hold_key("Shift_L", True)
    hands.click(*middle(viewer, truth, "cabinet"))
    settle(viewer)
    hands.hold_key("Shift_L", False)
    assert iou(tool.chosen, truth, "mug", "cabinet") > 0.8 and tool.count > one
    hands.hold_key("Alt_L", True)
    hands.click(*middle(viewer, truth, "mug"))
    settle(viewer)
    hands.hold_key("Alt_L", False)
    assert iou(tool.chosen, truth, "cabinet") > 0.8
    assert not tool.chosen[truth == LABELS["mug"]].mean() > 0.2
    hands.key("z", "Control_L")
    assert iou(tool.chosen, truth, "mug", "cabinet") > 0.8
    hands.key("z", "Control_L")
    assert tool.count == one
    hands.key("Escape")
    assert tool.on and tool.count == 0
    assert not viewer.objects.unsaved  # choosing is no edit


def test_a_box_takes_the_thing_in_it_or_all(viewer, hands, truth):
    tool = viewer.parts
    hands.key("o")
    places = viewer.state.scene.objects[0].model.anchors[truth == LABELS["can"]]
    seen = np.array([place_of(viewer, place) for place in places])
    low, high = np.percentile(seen, 2, axis=0) - 6, np.percentile(seen, 98, axis=0) + 6
    hands.drag(tuple(low), tuple(high))
    settle(viewer)
    assert iou(tool.chosen, truth, "can") > 0.8
    tool.selecting.drag = ALL
    hands.drag(tuple(high), tuple(low))  # from any corner
    assert tool.chosen[truth == LABELS["can"]].mean() > 0.9
    assert iou(tool.chosen, truth, "can") < 0.9  # and what lies behind it


def test_the_wheel_takes_more_or_less(viewer, hands, truth):
    tool = viewer.parts
    hands.key("o")
    hands.move(*middle(viewer, truth, "mug"))
    settle(viewer)
    before = tool.found.rows(tool.factor).sum()
    view = viewer.viewpoint.view().eye_from_world()
    hands.hold_key("Control_L", True)
    viewer.window.on_scroll(None, 0, 3)
    run_frames(viewer, 2)
    assert tool.found.rows(tool.factor).sum() > 1.5 * before
    viewer.window.on_scroll(None, 0, -8)
    run_frames(viewer, 2)
    assert tool.found.rows(tool.factor).sum() < before
    hands.hold_key("Control_L", False)
    np.testing.assert_array_equal(viewer.viewpoint.view().eye_from_world(), view)


def test_the_brush_adds_and_removes(viewer, hands, truth):
    tool = viewer.parts
    hands.key("o")
    x, y = middle(viewer, truth, "cabinet")
    hands.hold_key("b", True)
    hands.drag((x - 20, y), (x + 20, y))
    painted = tool.count
    assert painted > 20 and tool.chosen[truth == LABELS["cabinet"]].sum() > 0.9 * painted
    hands.hold_key("Shift_L", True)
    hands.drag((x - 20, y), (x, y))
    hands.hold_key("Shift_L", False)
    hands.hold_key("b", False)
    assert 0 < tool.count < painted
    hands.key("z", "Control_L")  # a whole stroke
    assert tool.count == painted


def test_junk_is_deleted_hidden_and_cropped(viewer, hands, truth, monkeypatch):
    tool, state = viewer.parts, viewer.state
    widgets = Widgets(monkeypatch)
    count = len(truth)
    hands.key("o")
    hands.click(*middle(viewer, truth, "mug"))
    settle(viewer)
    gone = tool.count
    hands.key("Delete")
    assert names(viewer) == ["workshop"]
    assert len(state.scene.objects[0].model.anchors) == count - gone
    hands.key("z", "Control_L")
    assert len(state.scene.objects[0].model.anchors) == count
    hands.click(*middle(viewer, truth, "mug"))
    settle(viewer)
    hands.click(*widgets.middle("Hide"))
    assert names(viewer) == [BACKGROUND, "hidden"] and not state.scene.objects[1].visible
    hands.key("z", "Control_L")
    hands.click(*widgets.middle("Crop\u2026"))
    assert tool.crop is not None
    tool.move_crop_side(0, 1, 0.3)
    run_frames(viewer, 2)
    outside = int(tool.outside().sum())
    _, tint = state.shown_scene.lit
    assert np.count_nonzero(tint.strength) == outside > 0
    hands.move(600, 300)
    hands.key("Return")
    kept = state.scene.objects[0].model.anchors
    assert len(kept) == count - outside and kept[:, 0].max() <= 0.3
    hands.key("z", "Control_L")
    assert len(state.scene.objects[0].model.anchors) == count and not viewer.objects.unsaved


def test_the_window_never_waits_for_a_walk(viewer, hands, truth, monkeypatch):
    """Frames go on while something is found."""
    tool = viewer.parts
    hands.key("o")
    hands.move(*middle(viewer, truth, "mug"))
    settle(viewer)
    find, go, found = tool.finder.find, threading.Event(), threading.Event()

    def slow(query):
        assert go.wait(60)
        found.set()
        return find(query)

    monkeypatch.setattr(tool.finder, "find", slow)
    x, y = middle(viewer, truth, "cabinet")
    viewer.window.on_cursor(None, x, y)
    try:
        run_frames(viewer, 10)
        assert tool.finder.busy and not found.is_set()
    finally:
        go.set()
    settle(viewer)
    assert iou(tool.found.rows(), truth, "cabinet") > 0.5


def test_what_is_made_is_saved_and_opened_again(window, demo, display, truth, tmp_path):
    """The picture before and after, drawn."""
    with Renderer(window.ctx) as renderer:
        viewer = viewer_on(window, renderer, demo, tmp_path / "pictures")
        before = window_picture(viewer)
        with RealHands(viewer, display) as hands:
            hands.key("o")
            hands.move(*middle(viewer, truth, "mug"))
            settle(viewer)
            lit = window_picture(viewer)
            hands.click(*middle(viewer, truth, "mug"))
            settle(viewer)
            hands.key("Return")
            hands.key("Escape")
            hands.key("s", "Control_L")
            assert viewer.objects.saving.asking
            hands.key("Return")
            hands.move(2, 2)
        assert not viewer.objects.unsaved, viewer.state.problem
        made = viewer.renderer.resolved().copy()
        viewer.parts.finder.close()
        path = viewer.state.edited.path
        assert path.parent != DEMO.parent
        assert {file.suffix for file in path.parent.iterdir()} == {".shift", ".json"}
        changed = np.abs(lit.astype(int) - before).max(axis=2) > 40
        assert 200 < changed.sum() < 6000  # the mug, and not the rest
        again = viewer_on(window, renderer, read(path), tmp_path / "pictures")
        again.viewpoint.camera = viewer.viewpoint.camera
        again.state.chosen = viewer.state.chosen
        run_frames(again, 3)
        assert names(again) == [BACKGROUND, "object"]
        np.testing.assert_allclose(again.renderer.resolved(), made, atol=1 / 255)


def window_picture(viewer) -> np.ndarray:
    """(H, W, 3) uint8: the scene as it is on the screen."""
    run_frames(viewer, 3)
    return (viewer.renderer.resolved() * 255).clip(0, 255).astype(np.uint8)


def test_four_views_by_key_and_in_the_panel(viewer, hands, truth, monkeypatch):
    state, widgets = viewer.state, Widgets(monkeypatch)
    run_frames(viewer, 2)
    assert "##four views" not in widgets.explained
    hands.key("o")
    hands.click(*middle(viewer, truth, "mug"))
    settle(viewer)
    hands.key("Return")
    hands.key("Escape")
    seen = []
    for _ in range(4):
        hands.key("i")
        shown = state.shown(viewer.viewpoint.view())
        visible = [obj.name for obj in shown.objects if obj.visible]
        seen.append((state.shown_scene.show, visible, shown.objects[1].tint is not None))
    assert seen == [
        ("overlay", [BACKGROUND, "object"], True),
        ("background", [BACKGROUND], False),
        ("isolated", ["object"], False),
        ("full", [BACKGROUND, "object"], False),
    ]
    hands.key("i", "Shift_L")
    assert state.shown_scene.show == "isolated"
    assert any(label.startswith("combo ##four views") for label in widgets.explained)
