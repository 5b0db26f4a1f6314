"""The desktop beside a headset: its viewer takes over where the runtime is lost or absent."""

import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import ImageGrab

from tests.support.xr.xr_stand import PATIENCE_S, Program

HELD_S = 3.0  # a viewer that lives so long has opened


@pytest.fixture
def display() -> Iterator[str]:
    """The name of an X display without a screen, in which nothing else is."""
    if not shutil.which("Xvfb"):
        pytest.skip("Xvfb is not installed (apt install xvfb)")
    read_end, write_end = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write_end), "-screen", "0", "1280x720x24", "-nolisten", "tcp",
         "-noreset"],
        pass_fds=[write_end], stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    os.close(write_end)
    with os.fdopen(read_end) as told:
        name = f":{told.readline().strip()}"
    yield name
    server.kill()
    server.wait()


def screen(display: str) -> np.ndarray:
    """(H, W, 3) 0..1."""
    return np.asarray(ImageGrab.grab(xdisplay=display).convert("RGB")) / 255


def opens_a_window_instead(program: Program, display: str) -> None:
    """Said in two lines, and done: it lives on and draws."""
    until = time.monotonic() + PATIENCE_S
    while "Opening the scene in a window instead." not in program.told():
        assert program.process.poll() is None, program.told()[-800:]
        assert time.monotonic() < until, program.told()[-800:]
        time.sleep(0.1)
    said = [line for line in program.told().splitlines() if line.startswith("shapeshift vr: ")]
    assert len(said) == 1, said
    while not np.ptp(screen(display)) > 0.5:
        assert program.process.poll() is None, program.told()[-800:]
        assert time.monotonic() < until, "the window stays empty"
        time.sleep(0.2)
    time.sleep(HELD_S)
    assert program.process.poll() is None, program.told()[-800:]
    assert "Traceback" not in program.told()


@pytest.mark.slow
def test_a_lost_runtime_leaves_the_scene_in_a_window(served, start, display):
    program = start(served, "--quality", "best", reports=False, DISPLAY=display)
    with program.headset(served.port) as remote:
        remote.send()
        program.until(lambda line: line["focused"], "focused")
        served.kill_runtime()
        opens_a_window_instead(program, display)


@pytest.mark.slow
def test_without_a_runtime_the_scene_opens_in_a_window(stand, start, display, tmp_path: Path):
    absent = tmp_path / "absent.json"
    program = start(stand, reports=False, DISPLAY=display, XR_RUNTIME_JSON=str(absent))
    opens_a_window_instead(program, display)
    assert str(absent) in program.told()
