"""Photos of other brightness: what evening them out gives, and how much it finds where all is even.

    python3 tools/training/exposure.py CAPTURE ... --out docs/bench/exposure.csv
        [--iterations 600] [--downscale N] [--seeds 0 1] [--size 200] [--spreads 0 0.08 0.2]

CAPTURE is a folder of posed photos, or `balls` or `workshop`, made on the spot.  Each training
photo is multiplied by a gain a channel, most of it common to all three, whose logarithm has the
planted standard deviation; held-out photos stay as they are.  found is the standard deviation that
the run found (training/supervision/exposure.py takes NOISE of it for its own), psnr_db of held-out
photos, fitted_db that of their right halves with the colours fitted on the left ones.  Rows with
evened = 0 are the same runs that never look at a photo's brightness.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[2])]

from ways import Turn, asked, measure_ways, parser_of, settings_of  # noqa: E402

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.training.evaluation.metrics import psnr  # noqa: E402
from shapeshift.training.photos import BLACK, LoadedPhoto  # noqa: E402
from shapeshift.training.supervision.exposure import fitted_psnr  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402

COLUMNS = (
    "capture", "planted", "evened", "seed", "modality", "psnr_db", "fitted_db", "found", "steps",
    "seconds",
)  # fmt: skip
WAYS = {"evened": {}, "as they are": {}}
COMMON = 0.9  # of a gain's variance: exposure; the rest is white balance


def darkened(photos: list[LoadedPhoto], spread: float) -> list[LoadedPhoto]:
    """The photos times gains of a spread, the same ones in every run; clipped as a sensor does."""
    rng, out = np.random.default_rng(7), []
    for photo in photos:
        common, own = rng.normal(), rng.normal(size=3)
        gain = np.exp(spread * (np.sqrt(COMMON) * common + np.sqrt(1 - COMMON) * own))
        rgba = photo.rgba.copy()
        rgba[..., :3] = np.clip(np.rint(photo.rgba[..., :3] * gain), 0, 255)
        out.append(replace(photo, rgba=rgba))
    return out


def rows_of(turn: Turn, spread: float) -> Iterator[dict]:
    photos = turn.photos | {"train": darkened(turn.photos["train"], spread)}
    trainer = Trainer(open_device(), turn.capture, turn.settings, loaded=photos)
    evened = turn.about["way"] == "evened"
    if not evened:
        trainer.exposures.begin = np.inf  # of the run: never
    for _ in trainer.steps():
        pass
    about = {"capture": turn.about["capture"], "planted": spread, "evened": int(evened)}
    about |= {"seed": turn.about["seed"], "steps": trainer.iteration}
    background = trainer.schedule.background or BLACK
    for stop in trainer.stops:
        mine = [photo for photo in trainer.held_out if photo.modality == stop.name]
        figures = [figures_of(trainer, photo, background) for photo in mine]
        psnr_db, fitted_db = np.mean(figures, axis=0)
        yield about | {
            "modality": stop.name, "psnr_db": f"{psnr_db:.2f}", "fitted_db": f"{fitted_db:.2f}",
            "found": f"{trainer.exposures.spread(stop.name):.3f}",
            "seconds": f"{trainer.elapsed:.0f}",
        }  # fmt: skip


def figures_of(trainer: Trainer, photo: LoadedPhoto, background) -> tuple[float, float]:
    drawing = trainer.step.draw(photo.view, trainer.control(photo.modality), background)
    width, height = photo.view.size
    image = trainer.device.download(drawing.frame.image).reshape(3, height, width)
    image, wanted = image.transpose(1, 2, 0), photo.over(background)
    return float(psnr(image, wanted, photo.weight)), fitted_psnr(image, photo, wanted)


def main() -> None:
    parser = parser_of(__doc__, WAYS)
    parser.add_argument("--spreads", type=float, nargs="+", default=[0.0, 0.08, 0.2])
    options = asked(parser)

    def all_spreads(turn: Turn) -> Iterator[dict]:
        for spread in options.spreads:
            yield from rows_of(turn, spread)

    measure_ways(options, COLUMNS, settings_of(options), WAYS, all_spreads)


if __name__ == "__main__":
    main()
