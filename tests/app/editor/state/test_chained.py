"""What was cut out of a scene goes along with its slider until somebody says otherwise."""

from dataclasses import replace
from pathlib import Path

import pytest

from shapeshift.app.editor.state import arrange
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.opened import OpenedFiles, Source
from shapeshift.runtime_models.model import Stop
from shapeshift.scene.document.scene_file import SceneFile, SceneItem
from tests.support.desktop.opened_states import model, state_of


@pytest.fixture
def chained() -> EditorState:
    """A scene, two things that were cut out of it, and one with stops of its own."""
    other = replace(model("cold"), stops=(Stop("cold", 0.0), Stop("warm", 1.0)))
    rows = [("background", model("RGB")), ("mug", model("RGB")), ("nut", model("RGB"))]
    rows.append(("lamp", other))
    items = [SceneItem(name=name, model=f"/{name}.ply") for name, _ in rows]
    file = SceneFile(folder=Path("/"), background=items[0], items=tuple(items[1:]))
    sources = tuple(Source(Path(f"/{n}.ply"), m) for n, m in rows)
    return state_of(OpenedFiles(sources, file, Path("/a.scene.json")))


def xs(state: EditorState) -> list[float]:
    return [obj.slider_x for obj in state.scene.objects]


def test_one_slider_moves_what_was_cut_out_until_somebody_says_otherwise(chained):
    state = chained
    assert state.movable == [0, 1, 2, 3] and state.tracks == state.sliders == [0, 3]
    arrange.steer_by_hand(state, 0, 0.25)
    assert xs(state) == [0.25, 0.25, 0.25, 0.0]
    assert [item.x for item in state.edited.file.all_items] == xs(state)  # it starts there, too
    state.chosen = "mug"  # its keys are the scene's
    arrange.step_x(state, 1)
    assert xs(state) == [0.26, 0.26, 0.26, 0.0]
    arrange.go_to_stop(state, 0, 1)
    state.advance(0.1)
    assert 0.26 < xs(state)[0] < 1 and len(set(xs(state)[:3])) == 1
    state.finish_shifts()
    assert xs(state) == [1.0, 1.0, 1.0, 0.0]
    arrange.all_go_to_stop(state, 0)
    state.finish_shifts()
    assert xs(state) == [0.0] * 4

    arrange.unchain(state, 1)
    assert state.tracks == [0, 1, 3]
    arrange.steer_by_hand(state, 1, 1.0)
    arrange.steer_by_hand(state, 0, 0.5)
    assert xs(state) == [0.5, 1.0, 0.5, 0.0]
    assert xs(state_of_file(state)) == xs(state)  # and so it opens again, apart
    arrange.rejoin(state, 1)
    assert xs(state) == [0.5, 0.5, 0.5, 0.0] and state.tracks == [0, 3]


def state_of_file(state: EditorState) -> EditorState:
    """The same file opened anew."""
    again = state_of(OpenedFiles(state.sources, state.edited.file, state.edited.path))
    assert again.tracks == [0, 1, 3]
    return again


def test_one_play_moves_them_all_and_the_second_picture_has_them(chained):
    state = chained
    state.toggle_play(1)  # of a thing that follows: the scene's
    assert [sweep.playing for sweep in state.sweeps] == [True, False, False, False]
    state.advance(2.0)
    assert 0 < xs(state)[0] == xs(state)[1] == xs(state)[2] and xs(state)[3] == 0
    state.toggle_play(0)
    assert not state.playing
    state.split.on, state.split.name, state.split.x = True, "background", 1.0
    right = state.split.right(state.scene, state.chain)
    assert [obj.x for obj in right.objects] == [1.0, 1.0, 1.0, 0.0]
    state.toggle_play()
    assert [sweep.playing for sweep in state.sweeps] == [True, False, False, True]
