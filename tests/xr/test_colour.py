"""Known colours in the images of a real runtime: encoded where it takes them so, else as light."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.support.xr.show_colour import PATCHES

PROGRAM = Path(__file__).resolve().parents[1] / "support" / "xr" / "show_colour.py"
WHITE = 255


def light(display: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1 of 0..1."""
    return np.where(display <= 0.04045, display / 12.92, ((display + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize(
    ("name", "linear", "within"),
    [
        ("SRGB8_ALPHA8", False, 1e-6),  # the very bytes
        ("RGBA16F", True, 1e-3),
        ("RGBA16", True, 1e-4),
        ("RGBA8", True, 0.5 / WHITE + 1e-6),
    ],
)
def test_a_known_colour_arrives_in_both_eyes(stand, name, linear, within):
    told = stand.tell(PROGRAM, name, "3")
    assert (told["format"], told["linear"]) == (name, linear)
    assert told["states"][-3:] == ["STOPPING", "IDLE", "EXITING"] and told["shown"] >= 3
    display = np.array(PATCHES) / WHITE
    wanted = light(display) if linear else display
    left, right = map(np.array, told["eyes"])
    np.testing.assert_allclose(left, wanted, atol=within)
    np.testing.assert_allclose(right, wanted[::-1], atol=within)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SRGB8_ALPHA8", "RGBA16F"])
def test_the_runtimes_own_compositor_shows_the_same_colour(stand, name):
    """Whatever the format, its window has the very bytes: the whole way to the display is right."""
    if shutil.which("xvfb-run") is None:
        pytest.skip("no xvfb-run: apt install xvfb")
    environment = {**stand.environment, "XRT_COMPOSITOR_FORCE_XCB": "1"}
    del environment["XRT_COMPOSITOR_NULL"]
    # A display that starts anew when its last program goes refuses the next one now and then.
    screen = ["xvfb-run", "-a", "-s", "-screen 0 1400x1000x24 -noreset"]
    done = subprocess.run(
        [*screen, sys.executable, PROGRAM.with_name("look_at_window.py"), name],
        env=environment, capture_output=True, text=True, timeout=90, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    assert set(PATCHES) <= {tuple(each) for each in json.loads(done.stdout)}, done.stdout
