"""What `train --calibrate` finds of planted offsets of the demo's thermal cameras, a row each.

    python tools/training/rig.py [--capture FOLDER] [--steps 2000] [--planted 0 1] \
        --out docs/bench/rig.csv

Without a capture the demo's is made first.  The shape is trained once: its photos are not touched.
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import cast

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from shapeshift.app.measure import processor  # noqa: E402
from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.training.calibration.calibrate import PYRAMID, STEPS, search, shape_for  # noqa: E402
from shapeshift.training.calibration.extrinsics import (  # noqa: E402
    moved_by,
    offset_capture,
    offset_of_matrix,
)
from shapeshift.training.settings import TrainSettings  # noqa: E402
from shapeshift.training.synthetic.workshop import make_workshop  # noqa: E402

MODALITY = "Thermal"
PLANTED = (  # degrees about x, y, z of the camera, and millimetres along them
    (0, 0, 0, 0, 0, 0),
    (0, 2, 0, 30, 0, 0),
    (-2, 0, 0, 0, 24, 18),
    (1.2, 0, -1.6, -18, -24, 0),
)
COLUMNS = (
    *(f"planted_{n}" for n in ("turn_x_deg", "turn_y_deg", "turn_z_deg", "x_mm", "y_mm", "z_mm")),
    "found_turn_deg", "found_shift_mm", "left_turn_deg", "left_x_mm", "left_y_mm", "left_z_mm",
    "left_shift_mm", "gain_db", "processor_s",
)  # fmt: skip


def show(row: tuple) -> str:
    text = ",".join(f"{v:.3f}" if isinstance(v, float) else str(v) for v in row)
    print(text, flush=True)  # noqa: T201
    return text


def quiet(what: str, done: float) -> None:
    pass


def row_of(device, capture, settings: TrainSettings, shape: tuple, six: tuple) -> str:
    """What is found of one planted offset, and how far that is off."""
    start, (turn, shift) = time.process_time(), np.split(np.array(six, float), 2)
    true = moved_by(np.concatenate([np.deg2rad(turn), shift / 1e3]))
    wrong = offset_capture(capture, MODALITY, np.linalg.inv(true))
    found = search(device, wrong, settings, MODALITY, shape, PYRAMID, quiet)
    left = offset_of_matrix(np.linalg.inv(true) @ found.offset)
    return show((
        *six, found.turn_deg, 1e3 * found.shift_m, left.turn_deg, *(1e3 * left.offset[:3, 3]),
        1e3 * left.shift_m, found.gain_db, time.process_time() - start,
    ))  # fmt: skip


def command_of(asked: argparse.Namespace) -> str:
    which = " ".join(map(str, asked.planted))
    return f"# python3 tools/training/rig.py --steps {asked.steps} --planted {which}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--capture", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument(
        "--planted", type=int, nargs="+", choices=range(len(PLANTED)), default=range(len(PLANTED))
    )
    asked = parser.parse_args()
    device, settings, start = open_device("cpu"), TrainSettings(), time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        made = make_workshop(Path(folder)) if asked.capture is None else None
        capture = made or read_capture(cast(Path, asked.capture))
        start = time.process_time()
        shape = shape_for(device, capture, settings, MODALITY, asked.steps, quiet)
        took = time.process_time() - start
        rows = [
            show((command_of(asked),)),
            show((f"# {processor()}, {os.cpu_count()} cores; {device.platform}: {device.name}",)),
            show((f"# {len(shape[3])} splats of the shape, trained in {took:.0f} processor s",)),
            show(COLUMNS),
        ]
        rows += [row_of(device, capture, settings, shape, PLANTED[i]) for i in asked.planted]
    if asked.out is not None:
        asked.out.write_text("\n".join(rows) + "\n")


if __name__ == "__main__":
    main()
