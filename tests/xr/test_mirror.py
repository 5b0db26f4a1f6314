"""The window on the desk: a session on a window's own context, and what it shows."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app.headset.mirror import SIZE

PROGRAM = Path(__file__).resolve().parents[1] / "support" / "xr" / "look_at_mirror.py"


@pytest.mark.slow
def test_the_window_shows_the_left_eye(stand, tmp_path):
    if shutil.which("xvfb-run") is None:
        pytest.skip("no xvfb-run: apt install xvfb")
    folder = tmp_path / "out"
    folder.mkdir()
    screen = ["xvfb-run", "-a", "-s", f"-screen 0 {SIZE[0]}x{SIZE[1]}x24 -noreset"]
    done = subprocess.run(
        [*screen, sys.executable, PROGRAM, folder],
        env=stand.environment, capture_output=True, text=True, timeout=120,
        stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    report = json.loads((folder / "report.json").read_text())
    assert report["ended"] == "frames" and report["states"][-1] == "EXITING"
    eyes = {side: Image.open(folder / f"{side}-00060.png") for side in ("left", "right")}
    window = Image.open(folder / "screen.png").resize(eyes["left"].size, Image.Resampling.BOX)
    away = {side: difference(window, eye) for side, eye in eyes.items()}
    assert away["left"] < 2.0 < away["right"], away


def difference(a: Image.Image, b: Image.Image) -> float:
    """Mean of what two pictures differ by, of 255."""
    return float(np.abs(np.asarray(a, np.float32) - np.asarray(b, np.float32)).mean())
