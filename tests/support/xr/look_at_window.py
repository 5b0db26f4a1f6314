"""Runs show_colour.py under a display and looks at the window of Monado's own compositor.

look_at_window.py FORMAT       one line of JSON: colours that fill a part of it, most first
"""

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from PIL import ImageGrab
from show_colour import PATCHES  # beside it: both are programs

LEAST = 2000  # pixels of one colour that are no edge
PATIENCE_S = 40.0


def main(pixels: str) -> None:
    program = Path(__file__).with_name("show_colour.py")
    shown = subprocess.Popen(
        [sys.executable, program, pixels, "100000"],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        until, found = time.monotonic() + PATIENCE_S, []
        while not set(PATCHES) <= set(found) and time.monotonic() < until:
            assert shown.poll() is None, "the program ended"
            time.sleep(0.5)
            found = colours(np.asarray(ImageGrab.grab().convert("RGB")))
    finally:
        shown.kill()
        shown.wait()
    print(json.dumps(found))


def colours(picture: np.ndarray) -> list[tuple[int, ...]]:
    """Those of many pixels, most first."""
    each, counts = np.unique(picture.reshape(-1, 3), axis=0, return_counts=True)
    order = np.argsort(-counts)
    return [tuple(map(int, each[i])) for i in order if counts[i] > LEAST]


if __name__ == "__main__":
    main(sys.argv[1])
