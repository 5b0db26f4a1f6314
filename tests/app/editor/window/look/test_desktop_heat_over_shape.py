"""Heat over shape in the real window: the picture, keys, the list in the panel."""

from pathlib import Path

import numpy as np
import pytest

from shapeshift.app.editor.desktop import Options, Viewer
from shapeshift.app.editor.panels import panel
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.window.two_pictures import splitting
from shapeshift.renderer.colors.heat_over_shape import heat_over_shape
from shapeshift.renderer.renderer import Renderer
from tests.support.desktop.desktop_stand import ball, run_frames
from tests.support.desktop.real_hands import RealHands
from tests.support.desktop.widgets import Widgets


@pytest.fixture
def viewer(window, tmp_path, request):
    drawing = getattr(request, "param", "tiles")
    if drawing == "tiles":
        pytest.importorskip("pyopencl")
    state = EditorState(lambda path: ball(300))
    state.open([Path("a.ply")])
    options = Options(pictures=tmp_path, drawing=drawing)

    def make() -> Renderer:
        return Renderer(window.ctx, drawing)

    with make() as renderer:
        viewer = Viewer(window, renderer, state, options)
        with splitting(window, state, viewer.hooks, viewer.free, make):
            run_frames(viewer, 5)
            yield viewer


def screen(viewer) -> np.ndarray:
    """(H, W, 3) 0..1: the picture under the overlay."""
    viewer.window.begin_frame()
    viewer.draw_splats()
    viewer.window.end_frame()
    return viewer.window.picture().astype(np.float32) / 255


def alone(viewer, x: float) -> np.ndarray:
    """The picture at one x, in the same place of the window."""
    before, over = viewer.state.scene.objects[0].x, viewer.hooks.over
    viewer.hooks.over = []
    viewer.state.set_x(0, x)
    picture = screen(viewer)
    viewer.state.set_x(0, before)
    viewer.hooks.over = over
    return picture


AT_PHOTO, AT_HEAT = "slider at the photo", "slider at the heat"


@pytest.mark.parametrize(
    ("viewer", "x"), [("tiles", 0.0), ("quads", 1.0)], ids=[AT_PHOTO, AT_HEAT], indirect=["viewer"]
)
def test_the_picture_is_the_photo_s_shape_under_the_heat(viewer, display, x):
    state = viewer.state
    state.overlay = False  # a second legend would move the picture over
    state.set_x(0, x)
    with RealHands(viewer, display) as hands:
        hands.key("c", "Shift_L")
    run_frames(viewer, 2)
    heat, photo = alone(viewer, 1.0), alone(viewer, 0.0)
    assert state.split.on and state.split.over and state.split.x == 1 - x
    found = screen(viewer)
    # Pictures of 8 bits, mixed and rounded again; the blur of the photo evens its rounding out.
    assert np.abs(found - heat_over_shape(heat, photo)).max() <= 1.6 / 255
    assert np.abs(found - heat).max() > 0.05 and np.abs(found - photo).max() > 0.05
    state.split.detail = 0.0
    assert np.abs(screen(viewer) - heat).max() <= 0.51 / 255


def test_keys_and_the_list_go_from_one_way_to_the_other(viewer, display, monkeypatch):
    state, split = viewer.state, viewer.state.split
    monkeypatch.setattr(panel, "section", lambda name, *_, **__: name == "Look")
    widgets = Widgets(monkeypatch)
    with RealHands(viewer, display) as hands:
        hands.key("c")
        assert split.on and not split.over
        hands.key("c", "Shift_L")
        assert split.on and split.over
        run_frames(viewer, 2)
        left, top, right, low = widgets.boxes["##detail"]
        hands.click(left + 0.8 * (right - left), (top + low) / 2)
        assert split.detail == pytest.approx(2.4, abs=0.2)
        hands.key("c", "Shift_L")
        assert not split.on
        hands.key("c")
        hands.key("c")
        assert not split.on
    assert state.scene.objects[0].x == 0.0
