"""Fixtures of the tests of the window: an X display in memory, a window on it, a viewer in that."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from desktop_stand import PlainRenderer, read_stub, run_frames

from shapeshift.app.editor.desktop import Options, Viewer
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.window.window import Window


@pytest.fixture(scope="module")
def display():
    """The name of an X display without a screen, 1280x720."""
    if not shutil.which("Xvfb"):
        pytest.skip("Xvfb is not installed (apt install xvfb)")
    read_end, write_end = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write_end), "-screen", "0", "1280x720x24", "-nolisten", "tcp"],
        pass_fds=[write_end],
        stderr=subprocess.DEVNULL,
    )
    os.close(write_end)
    with os.fdopen(read_end) as pipe:
        number = pipe.readline().strip()
    if not number:
        pytest.skip("Xvfb did not start")
    yield f":{number}"
    server.terminate()
    server.wait()


@pytest.fixture(scope="module")
def window(display):
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
