"""What the start may take of a run's seconds: quality at equal seconds in all, start and training.

    python3 tools/training/first_anchors/start.py CAPTURE ... --out docs/bench/start.csv
        [--seconds 60] [--downscale N] [--ways chosen whole] [--seeds 0]

First anchors are triangulated out of the photos (and stand on a hull, where there are masks), the
capture's own points are not read.  whole: as closely as without a budget; chosen: as closely as the
seconds allow (training/first_anchors/triangulation.py).  Where the start takes more than half of
them, the run is longer, as used_s says.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[n]) for n in (1, 3)]

from ways import Turn, asked, measure_ways, parser_of, settings_of  # noqa: E402

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.training.first_anchors import triangulation  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402

COLUMNS = (
    "capture", "size", "seconds", "seed", "start", "used_s", "start_s", "first", "steps", "psnr_db",
)  # fmt: skip
WAYS: dict[str, dict] = {"chosen": {}, "whole": {}}
CHOOSE = triangulation.choose_effort


def rows_of(turn: Turn) -> Iterator[dict]:
    whole = turn.about["way"] == "whole"
    triangulation.choose_effort = lambda photos, seconds: CHOOSE(photos, None if whole else seconds)
    capture = replace(turn.capture, points=None, point_colors=None)
    trainer = Trainer(open_device(), capture, turn.settings, loaded=turn.photos)
    first = trainer.anchors_count
    for _ in trainer.steps():
        pass
    width, height = turn.photos["train"][0].view.size
    psnr = trainer.held_out_psnr(most=len(trainer.held_out))
    yield {
        "capture": turn.about["capture"], "size": f"{width}x{height}", "seed": turn.about["seed"],
        "seconds": turn.settings.seconds, "start": turn.about["way"],
        "used_s": f"{trainer.seconds:.1f}", "start_s": f"{trainer.start_s:.1f}", "first": first,
        "steps": trainer.iteration, "psnr_db": f"{np.mean(list(psnr.values())):.2f}",
    }  # fmt: skip


def main() -> None:
    options = asked(parser_of(__doc__, WAYS))
    measure_ways(options, COLUMNS, settings_of(options), WAYS, rows_of)


if __name__ == "__main__":
    main()
