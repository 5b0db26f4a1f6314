"""The tool "Parts" without a window: answers of its thread, and what is lit."""

import threading
import time

import numpy as np
import pytest

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.open_scene import opened_scene
from shapeshift.app.editor.state.files.opened import OpenedFiles, Source
from shapeshift.app.editor.state.parts.finder import Finder, Query, in_box
from shapeshift.app.editor.state.parts.parts_tool import ADD, REMOVE, REPLACE, PartsTool
from shapeshift.app.editor.state.parts.selecting import ALL
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.pose import View
from shapeshift.scene.scene import IDENTITY, Scene, SceneObject
from tests.support.desktop.desktop_stand import ball
from tests.support.splat_scenes import front_view

VIEW: View = front_view((90, 60), distance=3.0)


@pytest.fixture
def tool(tmp_path):
    state = EditorState(lambda path: None)
    scene, edited = opened_scene(OpenedFiles((Source(tmp_path / "ball.ply", ball(300)),)))
    state.open_sources(edited.sources.values(), scene, None, edited)
    state.bodies.follow = lambda edited: None
    tool = PartsTool(state, lambda: None)
    tool.toggle()
    with tool.finder:
        yield tool


def wait(tool: PartsTool) -> None:
    end = time.monotonic() + 30
    while tool.poll() and time.monotonic() < end:
        time.sleep(0.002)


def test_the_newest_question_is_answered_and_no_other():
    asked, gate = [], threading.Event()

    class Slow(Finder):
        def find(self, query):
            asked.append(query)
            gate.wait(10)

    scene = Scene((SceneObject("a", ball(10)),))
    queries = [Query(scene, VIEW, (n, n, n, n)) for n in range(5)]
    with Slow() as finder:
        finder.ask(queries[0])
        while not asked:
            time.sleep(0.001)
        for query in queries[1:]:
            finder.ask(query)
        gate.set()
        end, answers = time.monotonic() + 10, []
        while len(answers) < 1 or finder.busy:
            answer = finder.take_answer()
            answers += [answer[0]] if answer else []
            assert time.monotonic() < end
    assert asked == [queries[0], queries[4]] and answers[-1] is queries[4]


def test_a_fault_of_the_search_is_a_sentence(tool, monkeypatch):
    def fail(query):
        raise BadFile("it is too large")

    monkeypatch.setattr(tool.finder, "find", fail)
    tool.click(VIEW, (45, 30), REPLACE)
    wait(tool)
    assert tool.state.problem == "it is too large." and tool.count == 0
    monkeypatch.undo()
    tool.click(VIEW, (45, 30), REPLACE)  # the thread lives on
    wait(tool)
    assert tool.count > 0


def test_more_than_memory_has_is_refused_before_it_is_tried(tool, monkeypatch):
    monkeypatch.setattr("shapeshift.app.editor.state.parts.finder.MOST_ANCHORS", 299)
    tool.click(VIEW, (45, 30), REPLACE)
    wait(tool)
    assert "300 splats, more than the 299" in tool.state.problem


def test_a_click_beside_everything_chooses_nothing(tool):
    tool.click(VIEW, (45, 30), REPLACE)
    wait(tool)
    chosen = tool.chosen.copy()
    tool.click(VIEW, (1, 1), ADD)
    wait(tool)
    np.testing.assert_array_equal(tool.chosen, chosen)
    tool.click(VIEW, (1, 1), REPLACE)
    wait(tool)
    assert tool.count == 0 and tool.step_back()
    np.testing.assert_array_equal(tool.chosen, chosen)


def test_a_box_of_all_and_its_parts(tool):
    tool.selecting.drag = ALL
    tool.box(VIEW, (200, 200, -200, -200), REPLACE)
    assert tool.count == 300
    tool.box(VIEW, (-200, -200, 45, 200), REMOVE)
    half = tool.count
    assert 100 < half < 200
    tool.box(VIEW, (-200, -200, 45, 200), ADD)
    assert tool.count == 300
    tool.invert()
    assert tool.count == 0 and tool.state.edited.history.undoes == ""


def test_what_is_lit_is_drawn_and_goes_with_the_tool(tool):
    state = tool.state
    assert state.shown(VIEW).objects[0].tint is not None  # of nothing: the way of colours stays
    tool.click(VIEW, (45, 30), REPLACE)
    wait(tool)
    tint = state.shown(VIEW).objects[0].tint
    np.testing.assert_array_equal(tint.strength > 0.6, tool.chosen)
    before = state.shown(VIEW)
    tool.light()
    assert state.shown(VIEW) is before  # nothing is drawn anew
    tool.toggle()
    assert state.shown(VIEW) is state.scene


def test_nothing_chosen_is_a_word_and_no_edit(tool):
    for act in (tool.make, tool.hide, tool.delete):
        act()
        assert "Nothing is chosen" in tool.state.messages.note
    assert tool.state.edited.history.undoes == ""


@pytest.mark.parametrize(
    ("in_eye", "inside"),
    [((0, 0, -3), True), ((0, 0, 3), False), ((9, 0, -3), False), ((0, 0, 0), False)],
)
def test_what_shows_in_a_box(in_eye, inside):
    """In the middle of the picture, behind the eye, beside it, in the eye itself."""
    obj = SceneObject("a", ball(10), IDENTITY)
    places = (VIEW.world_from_eye.matrix() @ [*in_eye, 1.0])[None, :3]
    assert bool(in_box(VIEW, places, obj, (30, 20, 60, 40))[0]) is inside
