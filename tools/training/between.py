"""What lies between the stops: cures beside what they cost at the stops and gain between them.

    python3 tools/training/between.py CAPTURE [CAPTURE ...] --seconds 120 \
        --out docs/bench/between.csv

CAPTURE is a folder of posed photos, or `balls` or `workshop`, which are made on the spot, or `rig`:
balls whose modalities are photographed from the same places.  A way is a row of WAYS below: the
settings of training that it changes; the last ones are about modalities that are not treated alike.
Every way of a capture has the same photos, first anchors,
seed and budget.  A row whose `where` is a stop has the mean PSNR over its held-out photos; a row
"A to B" has the figures of training/evaluation/midpoints.py over `--views` of them, and in `sweep`
what the case of that name of `launch.py stability` says of the first one: "holds", or what fails.
"""

import argparse
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from ways import asked, parser_of, settings_of, table, turns  # noqa: E402

from shapeshift.app.stability_cases.motion import Span  # noqa: E402
from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.runtime_models.model import BadFile  # noqa: E402
from shapeshift.scene.captures.capture import Capture  # noqa: E402
from shapeshift.scene.pose import View  # noqa: E402
from shapeshift.training.evaluation.midpoints import (  # noqa: E402
    Frequencies,
    Midpoints,
    between,
    draw_in_training,
)
from shapeshift.training.photos import BLACK  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402

FREQUENCIES = "frequencies"
EVEN = {"encoding": "even"}
STOPS = {"encoding": "stops"}
WAYS = {
    "narrow": EVEN,
    "sigma 0.08": EVEN | {"sigma": 0.08},
    "sigma 0.15": EVEN | {"sigma": 0.15},
    "stops": STOPS,
    "photos": EVEN | {"between": "photos"},
    "pictures": EVEN | {"between": "pictures"},
    "splats 0.1": EVEN | {"between": "splats", "between_pull": 0.1},
    "splats 1": EVEN | {"between": "splats", "between_pull": 1.0},
    "stops photos": STOPS | {"between": "photos"},
    "stops splats 0.1": STOPS | {"between": "splats", "between_pull": 0.1},
    FREQUENCIES: EVEN,
    "heat smooth 0.1": EVEN | {"thermal_smooth": 0.1},
    "heat smooth 0.6": EVEN | {"thermal_smooth": 0.6},
    "first twice": EVEN | {"balance": "FIRST=2"},  # FIRST: the capture's first stop
}
COLUMNS = (
    "capture", "way", "seed", "steps", "seconds", "anchors", "where", "psnr_db", "apart", "flash",
    "emptied", "blend_db", "jump", "around", "sweep",
)  # fmt: skip
FIGURES = {"apart": 4, "flash": 5, "emptied": 4, "blend_db": 2, "jump": 2, "around": 3}  # digits


def spans(capture: Capture) -> list[tuple]:
    """Neighbouring stops."""
    return list(pairwise(sorted(capture.stops, key=lambda stop: stop.x)))


def main() -> None:
    parser = parser_of(__doc__, WAYS)
    parser.add_argument("--views", type=int, default=4, help="to look from")
    parser.add_argument("--steps", type=int, default=50, help="of x between two stops")
    options, device = asked(parser), open_device()
    with table(options, COLUMNS, device) as add:
        for turn in turns(options, settings_of(options), WAYS):
            first = turn.capture.stops[0].name
            balance = turn.settings.balance.replace("FIRST", first)
            changed = replace(turn.settings, balance=balance)
            try:
                trainer = Trainer(device, turn.capture, changed, loaded=turn.photos)
            except BadFile as error:  # photos of which no two share a place
                sys.stderr.write(f"{turn.about['capture']}, {turn.about['way']}: {error}\n")
                continue
            if turn.about["way"] == FREQUENCIES:
                trainer.encoding = Frequencies(changed.control)
            add(turn.about | row for row in measured(trainer, options))


def measured(trainer: Trainer, options: argparse.Namespace) -> list[dict]:
    """The rows of a run."""
    for _ in trainer.steps():
        pass
    shared = {
        "steps": trainer.iteration,
        "seconds": f"{trainer.elapsed:.1f}",
        "anchors": trainer.anchors_count,
    }
    psnr = trainer.held_out_psnr(most=len(trainer.held_out))
    psnr["mean"] = float(np.mean(list(psnr.values())))
    rows = [shared | {"where": name, "psnr_db": f"{db:.2f}"} for name, db in psnr.items()]
    draw = draw_in_training(trainer, trainer.schedule.background or BLACK)
    for low, high in spans(trainer.capture):
        seen = [p.view for p in trainer.held_out if p.modality == low.name][: options.views]
        found = between(draw, seen, low.x, high.x, options.steps)
        rows.append(
            shared
            | {"where": f"{low.name} to {high.name}"}
            | told(found)
            | {"sweep": sweep(trainer, seen[0], low.x, high.x, options.steps)}
        )
    return rows


def told(found: Midpoints) -> dict[str, str]:
    return {name: f"{getattr(found, name):.{digits}f}" for name, digits in FIGURES.items()}


def sweep(trainer: Trainer, view: View, low: float, high: float, steps: int) -> str:
    """What the sweep of `launch.py stability` says of this way between two stops."""
    draw, frames = draw_in_training(trainer, BLACK), {}
    for x in np.linspace(low, high, steps + 1):
        image, cover = draw(view, float(x))
        frames[float(x)] = np.concatenate([image, cover[..., None]], axis=2), image
    # What has no Gaussians is held to those of the paper, as layers are.
    findings = Span(frames, low, high).findings()
    failed = [row.figure.partition(",")[0] for row in findings if not row.holds]
    return "; ".join(failed) or "holds"


if __name__ == "__main__":
    main()
