"""What a training step costs, pass by pass, with all anchors and with those that its stop shows.

    python3 tools/training/step_cost.py CAPTURE ... --steps 300 --out docs/bench/step_cost.csv \
        [--looks 20] [--downscale N ...] [--code NAME] [--anchor-attributes frame,color,light]

CAPTURE is a folder of posed photos.  After so many steps of training with its defaults (as a run of
four times as many) the anchors stay as they are, and the same photos of each stop are run in turns
with all anchors and with those that the view can show at the stop, as training does in nine steps
of ten.  anchors: how many ran, the mean; cpu_ms and the passes: milliseconds of one core, of each
the median over the looks.  code: what is measured, where rows of several commits are put together.
psnr_db: of the held-out photos of the stop after those steps; faster code has to have it, too.
"""

import argparse
import csv
import shlex
import sys
import time
from pathlib import Path
from typing import Any, cast

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.training.drawing import camera_of  # noqa: E402
from shapeshift.training.settings import TrainSettings  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402

PASSES = (
    "heads", "activate", "project", "bin", "rasterize", "loss", "rasterize backward",
    "project backward", "density", "heads backward", "adam",
)  # fmt: skip
COLUMNS = (
    "capture", "stop", "code", "run", "anchors", "of", "cpu_ms",
    *(f"{name.replace(' ', '_')}_ms" for name in PASSES), "psnr_db",
)  # fmt: skip


def trained(device, folder: Path, steps: int, factor: int | None, attributes: str) -> Trainer:
    """A run after so many steps."""
    settings = TrainSettings(iterations=4 * steps, downscale=factor, anchor_attributes=attributes)
    trainer = Trainer(device, read_capture(folder), settings)
    for now in trainer.steps():
        if now.iteration == steps:
            break
    trainer.step.clock = time.process_time
    return trainer


def look(trainer: Trainer, photo, some: bool) -> tuple[int, dict[str, float]]:
    """How many anchors a step of a photo ran, and the milliseconds of its passes."""
    step, stop = trainer.step, [s.name for s in trainer.stops].index(photo.modality)
    background = trainer.schedule.background or (0.0, 0.0, 0.0)
    rows = None
    if some:
        rows = trainer.visibility.visible_rows(stop, camera_of(photo.view), trainer.adam["anchors"])
    trainer.stats.stop, step.ms = stop, {}
    start = time.process_time()
    trainer.drawing = step.draw(photo.view, trainer.control(photo.modality), background, rows=rows)
    target = trainer.target(photo, background)
    grads = step.gradients(trainer.drawing, trainer.targets.loss(photo), target, trainer.stats)
    step.update(grads, 0.0)  # at no rate: all stays where it is
    trainer.device.queue.finish()
    ms = {name: step.ms.get(name, 0.0) for name in PASSES}
    ms["all"] = 1e3 * (time.process_time() - start)
    return len(cast(Any, step.gathered["anchors"])), ms


def measured(trainer: Trainer, looks: int) -> list[dict]:
    """Two rows a stop."""
    rows, decibels = [], trainer.held_out_psnr(len(trainer.held_out))
    for stop in trainer.stops:
        photos = trainer.schedule.photos[stop.name]
        found: dict[bool, list] = {False: [], True: []}
        index = [s.name for s in trainer.stops].index(stop.name)
        trainer.visibility.visits[index] = 1  # the next looks are none that run all
        for turn in range(looks + 1):
            photo = photos[turn * 7 % len(photos)]
            for some in (False, True):
                if trainer.visibility.visits[index] % 10 == 0:
                    trainer.visibility.visits[index] = 1
                found[some].append(look(trainer, photo, some))
        for some, each in found.items():
            ran = [count for count, _ in each[1:]]  # the first compiled and warmed up
            passes = {n: float(np.median([ms[n] for _, ms in each[1:]])) for n in each[0][1]}
            rows.append(
                {"stop": stop.name, "run": "shown" if some else "all"}
                | {"anchors": round(float(np.mean(ran))), "of": trainer.anchors_count}
                | {"cpu_ms": f"{passes['all']:.2f}"}
                | {f"{name.replace(' ', '_')}_ms": f"{passes[name]:.2f}" for name in PASSES}
                | {"psnr_db": f"{decibels[stop.name]:.2f}" if stop.name in decibels else ""}
            )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=300)
    parser.add_argument("--looks", type=int, default=20)
    parser.add_argument("--downscale", type=int, nargs="+", help="one a capture; default: usual")
    parser.add_argument("--code", default="")
    parser.add_argument("--anchor-attributes", default=TrainSettings().anchor_attributes)
    options, device = parser.parse_args(), open_device("cpu")
    words = [Path(w).name if Path(w).exists() else w for w in sys.argv[1:]]
    factors = options.downscale or [None] * len(options.captures)
    with options.out.open("w", newline="") as file:
        file.write(f"# python3 tools/training/step_cost.py {shlex.join(words)}\n")
        file.write(f"# {device.name}, {device.platform}\n")
        rows = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        rows.writeheader()
        for folder, factor in zip(options.captures, factors, strict=True):
            trainer = trained(device, folder, options.steps, factor, options.anchor_attributes)
            what = {"capture": folder.name, "code": options.code}
            rows.writerows(what | row for row in measured(trainer, options.looks))
            file.flush()


if __name__ == "__main__":
    main()
