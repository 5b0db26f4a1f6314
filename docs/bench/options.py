"""What settings of a training give that are candidates to leave: a row a way, seed and modality.

    python3 docs/bench/options.py CAPTURE ... --iterations 400 --out docs/bench/options.csv

A way is a row of WAYS below: the settings that it changes.  Every way of a capture has the same
photos, first anchors, seed and steps; seconds are those of training alone, psnr_db is the mean over
all held-out photos of a modality, `mean` that of the modalities.
"""

import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from ways import asked, parser_of, settings_of, table, turns  # noqa: E402

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402

WAYS = {
    "default": {},
    "even encoding": {"encoding": "even"},
    "eq. 9: opacity 0.01, scale 1e-9": {"opacity_share": 0.01, "scale_share": 1e-9},
    "eq. 8: D-SSIM 0.8": {"ssim_share": 0.8},
    "rates x 2": {"rate_scale": 2.0},
    "rates x 0.5": {"rate_scale": 0.5},
    "rise 100": {"rise": 100},
    "revive 0": {"revive": 0.0},
    "2 layers": {"layers": 2},
    "coarse 2": {"coarse": 2},
    "thermal smooth 0.6": {"thermal_smooth": 0.6},
    "own color": {"own": "color"},
    "own frame": {"own": "frame"},
    "no growth": {"grow": False},
    "10 splats": {"splats_per_anchor": 10},
    "preset paper": {
        "preset": "paper", "encoding": "even", "splats_per_anchor": 10, "opacity_share": 0.01,
        "scale_share": 1e-9,
    },
}  # fmt: skip
COLUMNS = ("capture", "way", "seed", "steps", "seconds", "anchors", "modality", "psnr_db")


def main() -> None:
    options, device = asked(parser_of(__doc__, WAYS)), open_device()
    with table(options, COLUMNS, device) as add:
        for turn in turns(options, settings_of(options), WAYS):
            trainer = Trainer(device, turn.capture, turn.settings, loaded=turn.photos)
            for _ in trainer.steps():
                pass
            psnr = trainer.held_out_psnr(most=len(trainer.held_out))
            psnr["mean"] = float(np.mean(list(psnr.values())))
            shared = {
                "steps": trainer.iteration, "seconds": f"{trainer.elapsed:.1f}",
                "anchors": trainer.anchors_count,
            }  # fmt: skip
            add(
                turn.about | shared | {"modality": name, "psnr_db": f"{db:.2f}"}
                for name, db in psnr.items()
            )


if __name__ == "__main__":
    main()
