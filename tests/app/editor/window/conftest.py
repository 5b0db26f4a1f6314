"""Fixtures of the tests of the window: one on a display in memory, and viewers in it."""

import os
from pathlib import Path

import pytest

from shapeshift.app.editor.desktop import Options, Viewer
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.opened import OpenedFiles, Source, read_files
from shapeshift.app.editor.state.touch_state import TouchState
from shapeshift.app.editor.window.window import Window
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.scene.cameras.camera_list import CameraReading
from tests.support.desktop.desktop_stand import PlainRenderer, ball, read_stub, run_frames
from tests.support.desktop.objects_stand import TOUCH, release, viewer_of


@pytest.fixture(scope="module")
def window(display, request):
    # Only these files come before all that opens EGL; see tests/conftest.py.
    assert request.path.name.startswith("test_desktop"), "a window in this file ends the process"
    before = os.environ.get("DISPLAY")
    os.environ["DISPLAY"] = display
    with Window("test", (900, 640)) as window:
        yield window
    os.environ.pop("DISPLAY")
    if before is not None:
        os.environ["DISPLAY"] = before


@pytest.fixture
def viewer(window, tmp_path):
    state = EditorState(read_stub)
    state.open([Path("ball.shift")])
    options = Options(pictures=tmp_path / "pictures")
    viewer = Viewer(window, PlainRenderer(window.ctx), state, options)
    run_frames(viewer, 4)
    return viewer


@pytest.fixture(scope="module")
def touch_found() -> OpenedFiles:
    return read_files([TOUCH], None, CameraReading(), lambda *_: None)


@pytest.fixture
def touch_viewer(window, touch_found, tmp_path, monkeypatch):
    """The touch scene, its world there, things holding still as in a scene of one's own."""
    monkeypatch.setattr(TouchState, "opens_playing", False)
    viewer = viewer_of(window, touch_found, tmp_path)
    yield viewer
    release(viewer)


@pytest.fixture
def playing_viewer(window, touch_found, tmp_path, monkeypatch):
    """The touch scene as the program opens what it has brought along."""
    monkeypatch.setattr("shapeshift.app.paths.ASSETS", TOUCH.parent)
    viewer = viewer_of(window, touch_found, tmp_path)
    yield viewer
    release(viewer)


@pytest.fixture
def splats_viewer(window, tmp_path):
    """A file of splats that was opened without a scene file."""
    b = ball(50)
    path = tmp_path / "models" / "ball.ply"
    path.parent.mkdir()
    write_ply(PlainSplats(b.means, b.scales, b.wxyz, b.opacity, b.sh), path)
    viewer = viewer_of(window, OpenedFiles((Source(path, b),)), tmp_path)
    yield viewer
    release(viewer)


@pytest.fixture
def hands(viewer, display):
    """Real input through the display; at the end the pointer rests on the picture."""
    from tests.support.desktop.real_hands import RealHands  # python-xlib, where there is X

    with RealHands(viewer, display) as hands:
        yield hands
        hands.button(False)
        hands.move(600, 200)
