"""Anchors with light by direction and without: decibels, steps and bytes in the same core seconds.

    python3 tools/colors/light.py CAPTURE ... --seconds 120 --seeds 0 1 --out docs/bench/light.csv

CAPTURE is a folder of posed photos, or `balls` or `workshop`, which are made on the spot.  Both
ways of a capture and seed have the same photos, cap and budget, by the capture's defaults else.
psnr_db is the mean over all held-out photos, drawn from the package of 16 bits as `eval` does;
`mean` is that of the modalities.  step_ms: processor time of a step.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE.parent / "training")]

from ways import Turn, Way, asked, measure_ways, parser_of, settings_of, without  # noqa: E402

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.runtime_models.package.write_package import write_package  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.training.evaluation.evaluate import evaluate_model  # noqa: E402
from shapeshift.training.settings import TrainSettings  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402


def with_light(settings: TrainSettings) -> dict[str, str]:
    """Of a capture whose default has it, nothing changes."""
    have = settings.anchor_attributes
    return {"anchor_attributes": have if "light" in have else f"{have},light"}


WAYS: dict[str, Way] = {"without": without("light"), "light": with_light}
COLUMNS = (
    "capture", "way", "seed", "budget_s", "steps", "step_ms", "anchors", "package_bytes",
    "modality", "psnr_db",
)  # fmt: skip


def main() -> None:
    options = asked(parser_of(__doc__, WAYS))
    measure_ways(options, COLUMNS, settings_of(options), WAYS, rows_of)


def rows_of(turn: Turn) -> list[dict]:
    device = open_device()
    trainer = Trainer(device, turn.capture, turn.settings, loaded=turn.photos)
    for _ in trainer.steps():
        pass
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.shift"
        size = write_package(trainer.model(), path)
        scores = evaluate_model(device, read_model(path), turn.capture, trainer.factor)
    found = {name: score.psnr_db for name, score in scores.items()}
    found["mean"] = float(np.mean(list(found.values())))
    shared = turn.about | {
        "budget_s": turn.settings.seconds,
        "steps": trainer.iteration,
        "step_ms": f"{1e3 * trainer.elapsed / trainer.iteration:.1f}",
        "anchors": trainer.anchors_count,
        "package_bytes": size,
    }
    return [shared | {"modality": name, "psnr_db": f"{db:.2f}"} for name, db in found.items()]


if __name__ == "__main__":
    main()
