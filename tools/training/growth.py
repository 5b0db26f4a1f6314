"""What anchors have and how they grow: decibels against seconds, splats and bytes.

    python3 tools/training/growth.py CAPTURE [CAPTURE ...] --seconds 120 --out docs/bench/growth.csv

CAPTURE is a folder of posed photos, or `balls` or `workshop`, which are made on the spot.  A way is
a row of WAYS below: the settings of training that it changes.  Every way of a capture has the same
photos, first places, seed, cap and budget, and is looked at at the same shares of the run, never
while a growing step is fresh.  seconds are those of training alone; psnr_db is the mean over all
held-out photos of a modality, `mean` that of the modalities; splats are those at least 1/255
opaque, the mean over the stops.  Ways take turns within a seed, so that what else the machine does
spreads over all of them.
"""

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from ways import Turn, Way, asked, measure_ways, parser_of, settings_of, without  # noqa: E402

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.rasterizer.project import LEAST_ALPHA  # noqa: E402
from shapeshift.runtime_models.package.write_package import package_files, zip_files  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402

WAYS: dict[str, Way] = {
    "default": {},
    "no growth": {"grow": False},
    "no frames": without("frame"),
    "no base colours": without("color"),
    "features alone": {"anchor_attributes": ""},
}
LOOKS = (0.25, 0.5, 0.75, 1.0)  # shares of the run
COLUMNS = (
    "capture", "way", "seed", "steps", "seconds", "anchors", "splats", "package_bytes", "modality",
    "psnr_db",
)  # fmt: skip


def main() -> None:
    parser = parser_of(__doc__, WAYS)
    parser.add_argument("--max-mb", type=float)
    parser.add_argument("--grow-every", type=int, default=100, help="steps")
    options = asked(parser)
    settings = replace(settings_of(options), max_mb=options.max_mb, grow_every=options.grow_every)
    measure_ways(options, COLUMNS, settings, WAYS, rows_of)


def rows_of(turn: Turn) -> list[dict]:
    trainer = Trainer(open_device(), turn.capture, turn.settings, loaded=turn.photos)
    return [turn.about | row for row in measured(trainer)]


def measured(trainer: Trainer) -> list[dict]:
    """The rows of a run, looks by looks; what looking takes does not count as training."""
    rows, looking, left = [], 0.0, list(LOOKS)
    for now in trainer.steps():
        if left and now.fraction >= left[0] and (trainer.settled or now.fraction >= 1):
            start = time.perf_counter()
            left = [share for share in left if share > now.fraction]
            rows += look(trainer, trainer.elapsed - looking)
            looking += time.perf_counter() - start
    return rows


def look(trainer: Trainer, seconds: float) -> list[dict]:
    psnr = trainer.held_out_psnr(most=len(trainer.held_out))
    shared = {
        "steps": trainer.iteration,
        "seconds": f"{seconds:.1f}",
        "anchors": trainer.anchors_count,
        "splats": alive(trainer),
        "package_bytes": len(zip_files(package_files(trainer.model(), "float16"))),
    }
    psnr["mean"] = float(np.mean(list(psnr.values())))
    return [shared | {"modality": name, "psnr_db": f"{db:.2f}"} for name, db in psnr.items()]


def alive(trainer: Trainer) -> int:
    """Splats that can be seen, the mean over the stops."""
    counts = []
    for stop in trainer.stops:
        splats = trainer.step.decode(trainer.control(stop.name), np.zeros(3))
        counts.append((trainer.device.download(splats.opacity) >= LEAST_ALPHA).sum())
    return int(np.mean(counts))


if __name__ == "__main__":
    main()
