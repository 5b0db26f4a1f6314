"""Two stops beside a line: each side draws what it shows, both from one sort where they can."""

from pathlib import Path

import glfw
import numpy as np
import pytest

from shapeshift.app.editor.desktop import Options, Viewer
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.window.two_pictures import splitting
from shapeshift.app.editor.window.window import KeyDown
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import BadFile
from tests.support.desktop.desktop_stand import ball, run_frames
from tests.support.renderer.heat_scenes import model

MODELS = {
    "colours alone": lambda: model(60, "offset", "scale", "rotation", "opacity"),
    "shape, too": lambda: model(60),
    "layers": lambda: ball(300),
}


@pytest.fixture(params=["tiles", "quads"])
def make(window, request):
    if request.param == "tiles":
        pytest.importorskip("pyopencl")
    return lambda: Renderer(window.ctx, request.param)


@pytest.fixture
def stand(window, tmp_path, make):
    """Makes a viewer that shows a model at its first stop and at 0.5."""
    with make() as renderer:

        def viewer_of(shown) -> Viewer:
            state = EditorState(lambda path: shown)
            state.open([Path("a.ply")])
            viewer = Viewer(window, renderer, state, Options(pictures=tmp_path, panel=False))
            state.overlay = False
            return viewer

        yield viewer_of, make


def screen(viewer) -> np.ndarray:
    viewer.window.begin_frame()
    viewer.draw_splats()
    viewer.window.end_frame()
    return viewer.window.picture().astype(int)


@pytest.mark.parametrize("shown", MODELS.values(), ids=MODELS)
def test_each_side_is_the_picture_of_its_x(stand, shown):
    viewer_of, make = stand
    viewer = viewer_of(shown())
    state = viewer.state
    with splitting(viewer.window, state, viewer.hooks, viewer.free, make):
        state.split.toggle(state.scene.objects[0])
        state.split.x = 0.5
        run_frames(viewer, 3)
        found, stats = screen(viewer), viewer.readings.stats
        state.split.on = False
        pictures = []
        for x in (0.0, 0.5):
            state.set_x(0, x)
            pictures.append(screen(viewer))
    cut = viewer.window.size[0] // 2
    left, right = pictures
    assert (left != right).any(axis=2).mean() > 0.01
    # Coordinates begin at the line: in floats a pixel may round to the next of 256 steps, and
    # where alpha ends at 1/255 a splat may be blended on one side alone.
    away = [np.abs(found[:, : cut - 1] - left[:, : cut - 1]),
            np.abs(found[:, cut + 1 :] - right[:, cut + 1 :])]  # fmt: skip
    assert max(part.max() for part in away) <= 2
    assert max((part > 0).mean() for part in away) < 1e-3
    together = shown is MODELS["colours alone"]
    assert stats.color_sets == (2 if together else 1) and stats.sorts == 1


def test_a_line_at_the_edge_and_one_that_moves(stand):
    viewer_of, make = stand
    viewer = viewer_of(MODELS["colours alone"]())
    state = viewer.state
    with splitting(viewer.window, state, viewer.hooks, viewer.free, make):
        whole = screen(viewer)
        state.split.toggle(state.scene.objects[0])
        run_frames(viewer, 2)
        for presses, key in ((60, glfw.KEY_PERIOD), (120, glfw.KEY_COMMA)):
            for _ in range(presses):
                viewer.handle_event(KeyDown(key, False))
            run_frames(viewer, 1)
            picture = screen(viewer)
            assert (picture == whole).all() == (key == glfw.KEY_PERIOD)


def test_no_room_for_the_other_side_is_said_and_the_first_stays(stand, monkeypatch):
    viewer_of, make = stand
    viewer = viewer_of(ball(100))
    state = viewer.state
    whole = screen(viewer)

    def full() -> Renderer:
        other = make()
        monkeypatch.setattr(other, "update", refuse)
        return other

    def refuse(scene) -> None:
        raise BadFile("it needs 9 GB.")

    with splitting(viewer.window, state, viewer.hooks, viewer.free, full):
        state.split.toggle(state.scene.objects[0])
        run_frames(viewer, 2)
        assert not state.split.on and "no room for a second picture: it needs" in state.problem
        np.testing.assert_array_equal(screen(viewer), whole)
