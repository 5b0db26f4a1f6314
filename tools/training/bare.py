"""Captures whose points, masks and depth are taken away: anchors beside plain splats.

    python3 tools/training/bare.py CAPTURE ... --out docs/bench/bare.csv [--seconds 60] \
        [--points auto random] [--models anchors splats] [--seed 1] [--downscale N ...]

CAPTURE is a folder of posed photos, or `workshop`: the demo's bench, made on the spot.
Photos keep their poses alone; a stated background is taken away, too, so that the photos must show
it.  Both models have the same seconds of one core, plain splats shared among the modalities, and
start from the same source.  start_s: processor seconds, of the process and of those that it
started, until the first step; seconds does not count them.
"""

import argparse
import resource
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from ways import add_sweep, captures_of, sweep  # noqa: E402

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.runtime_models.model import BadFile  # noqa: E402
from shapeshift.scene.captures.capture import Capture  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.training.baselines.plain import PlainTrainer, one_modality  # noqa: E402
from shapeshift.training.baselines.plain_settings import PlainSettings  # noqa: E402
from shapeshift.training.settings import TrainSettings, suited  # noqa: E402
from shapeshift.training.synthetic.workshop import make_workshop  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402

COLUMNS = (
    "capture", "points", "model", "seed", "modality", "psnr_db", "seconds", "steps", "start_s",
    "first", "count", "origin",
)  # fmt: skip
WORKSHOP = {"size": (384, 288), "views": 36, "test_views": 8}


def stripped(capture: Capture) -> Capture:
    """The capture with nothing but its photos and poses."""
    photos = tuple(replace(photo, mask=None, depth=None) for photo in capture.photos)
    return replace(capture, photos=photos, points=None, point_colors=None, background=None)


def processor_s() -> float:
    """Of this process and of those that it started."""
    each = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in each)


def train(make) -> tuple[dict[str, float], dict]:
    """Decibels of each modality, and what is said of the whole run."""
    before = processor_s()
    trainer = make()
    start_s, first = processor_s() - before, len(trainer.adam[trainer.param_group])
    for _ in trainer.steps():
        pass
    found = trainer.held_out_psnr(most=len(trainer.held_out))
    return found, {
        "seconds": trainer.elapsed, "steps": trainer.iteration, "start_s": start_s, "first": first,
        "count": len(trainer.adam[trainer.param_group]), "origin": trainer.origin,
    }  # fmt: skip


def anchors(device, capture: Capture, options: argparse.Namespace, points: str, factor) -> list:
    settings = TrainSettings(
        iterations=None, seconds=options.seconds, seed=options.seed, points=points, downscale=factor
    )
    settings = suited(settings, (), capture)
    psnr, said = train(lambda: Trainer(device, capture, settings))
    return [(name, db, said) for name, db in psnr.items()]


def splats(device, capture: Capture, options: argparse.Namespace, points: str, factor) -> list:
    settings = PlainSettings(
        iterations=None, seconds=options.seconds / len(capture.stops), seed=options.seed,
        points=points, downscale=factor,
    )  # fmt: skip
    found = []
    for stop in capture.stops:
        part = one_modality(capture, stop.name)
        psnr, said = train(lambda part=part: PlainTrainer(device, part, settings))
        found.append((stop.name, psnr[stop.name], said))
    return found


def rows_of(found: list) -> list[dict]:
    """A row a modality, and one of the mean where they are several."""
    shown = {"seconds": "{:.1f}", "start_s": "{:.1f}"}
    rows = [
        {"modality": name, "psnr_db": f"{db:.2f}"}
        | {key: shown.get(key, "{}").format(value) for key, value in said.items()}
        for name, db, said in found
    ]
    if len(rows) > 1:
        mean = sum(db for _, db, _ in found) / len(found)
        rows.append({"modality": "mean", "psnr_db": f"{mean:.2f}"})
    return rows


def asked() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--points", nargs="+", default=["auto"])
    parser.add_argument("--models", nargs="+", default=["anchors", "splats"])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--downscale", type=int, nargs="+", help="one a capture; default: usual")
    add_sweep(parser)
    return parser.parse_args()


def measured(
    folder: Path, options: argparse.Namespace, points: str, model: str, factor: int | None
) -> list[dict]:
    capture = stripped(read_capture(folder))
    run = {"anchors": anchors, "splats": splats}[model]
    try:
        found = rows_of(run(open_device("cpu"), capture, options, points, factor))
    except BadFile as why:
        found = [{"origin": str(why).replace(str(capture.folder), capture.folder.name)}]
    what = {"capture": folder.name, "points": points, "model": model, "seed": options.seed}
    return [what | row for row in found]


def main() -> None:
    options = asked()
    factors = options.downscale or [None] * len(options.captures)
    places = captures_of(options, {"workshop": partial(make_workshop, **WORKSHOP, processes=1)})
    runs = {
        f"{folder.name} {points} {model}": partial(measured, folder, options, points, model, factor)
        for folder, factor in zip(places.values(), factors, strict=True)
        for points in options.points
        for model in options.models
    }
    sweep(options, COLUMNS, runs, places, "cpu")


if __name__ == "__main__":
    main()
