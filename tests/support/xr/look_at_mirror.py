"""Runs `launch.py vr` under a display and takes pictures of the screen while it is there.

look_at_mirror.py FOLDER        screen.png; eye pictures and the report beside it
"""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from PIL import ImageGrab

ROOT = Path(__file__).resolve().parents[3]
PATIENCE_S = 50.0


def main(folder: Path) -> int:
    shown = subprocess.Popen(
        [sys.executable, ROOT / "launch.py", "vr", "--quality", "best", "--frames", "60",
         "--pictures", folder, "--every", "60", "--report", folder / "report.json"],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    until = time.monotonic() + PATIENCE_S
    while shown.poll() is None and time.monotonic() < until:
        screen = ImageGrab.grab().convert("RGB")
        if np.asarray(screen).any():  # a window that was drawn into
            screen.save(folder / "screen.png")
        time.sleep(0.1)
    return shown.wait(PATIENCE_S)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
