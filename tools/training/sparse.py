"""Few photos: what the defaults give with 3, 6, 12 of them, and what ways to train add.

    python3 tools/training/sparse.py CAPTURE MODALITY [CAPTURE MODALITY ...]
        --out docs/bench/sparse.csv [--photos 3 6 12 0] [--iterations 600] [--max-anchors 6000]
        [--downscale N] [--seeds 0] [--ways default ...]

CAPTURE is a folder of posed photos, MODALITY one of it, which is trained alone.  photos are its
training photos, as many of them as that, spread over all; 0 is all.  psnr_db and ssim are of all
held-out photos, train_db of up to 8 of the photos that were learned from.  Ways take turns.

  default        as `train` does it
  alike          colours that do not see the eye (view_dependent)
  half           half of the anchors
  ungrown        the first anchors stay
  left out       each step leaves out a tenth of the anchors, drawn by chance (DropGaussian, 2025)
  left out 2     a fifth
  early          half of the steps
  coarse         a slope on scales below two pixels of the finest photo (--min-scale-px 2)
"""

import argparse
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[2])]

from sweep import add_sweep, sweep  # noqa: E402

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.scene.captures.capture import Capture  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.training.baselines.plain import one_modality  # noqa: E402
from shapeshift.training.evaluation.metrics import ssim  # noqa: E402
from shapeshift.training.photos import BLACK, LoadedPhoto, choose_downscale  # noqa: E402
from shapeshift.training.settings import TrainSettings  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402
from shapeshift.training.visibility import Visibility  # noqa: E402

COLUMNS = (
    "capture", "modality", "photos", "way", "seed", "psnr_db", "ssim", "train_db", "steps",
    "anchors", "seconds",
)  # fmt: skip
LOOKED_AT = 8  # training photos


class Thinned(Visibility):
    """Visible anchors less a share of them, others at every look."""

    share, looks = 0.0, 0

    def visible_rows(self, stop: int, camera, anchors):
        rows = super().visible_rows(stop, camera, anchors)
        self.looks += 1
        rows = np.arange(self.count) if rows is None else self.device.download(rows)
        rng = np.random.default_rng([5, self.looks])
        kept = rows[rng.random(len(rows)) >= self.share]
        return self.device.upload((kept if len(kept) else rows).astype(np.int32))


class ThinnedTrainer(Trainer):
    left_out = 0.0

    def fresh_statistics(self, count: int):
        stats, _ = super().fresh_statistics(count)
        seen = Thinned(self.device, count, len(self.stops), self.layout.splats)
        seen.share = self.left_out
        return stats, seen


WAYS = {
    "default": {},
    "alike": {"view_dependent": False},
    "half": {"max_anchors": 0.5},
    "ungrown": {"grow": False},
    "left out": {"left_out": 0.1},
    "left out 2": {"left_out": 0.2},
    "early": {"iterations": 0.5},
    "coarse": {"min_scale_px": 2},
}


def part_of(capture: Capture, photos: int) -> Capture:
    """With so many training photos, spread over all; the held-out ones stay."""
    (stop,) = capture.stops
    mine = capture.of(stop.name, "train")
    some = np.unique(np.linspace(0, len(mine) - 1, photos or len(mine)).round().astype(int))
    kept = [mine[i] for i in some] + capture.of(stop.name, "test")
    return replace(capture, photos=tuple(kept))


def changed(settings: TrainSettings, way: dict) -> TrainSettings:
    """With a way's settings; shares are of what was there."""
    given = {n: v for n, v in way.items() if n != "left_out"}
    shares = {n: round(v * getattr(settings, n)) for n, v in given.items() if type(v) is float}
    return replace(settings, **(given | shares))


def fit_of(trainer: Trainer, photos: list[LoadedPhoto]) -> tuple[float, float]:
    """Mean dB and SSIM over photos."""
    background, values = trainer.schedule.background or BLACK, []
    for photo in photos:
        drawing = trainer.step.draw(photo.view, trainer.control(photo.modality), background)
        image = trainer.device.download(drawing.frame.image).transpose(1, 2, 0)
        likeness = ssim(image, photo.over(background), photo.weight)
        values.append((trainer.psnr_of(drawing, photo, background), likeness))
    psnr_db, mean = np.mean(values, axis=0)
    return float(psnr_db), float(mean)


def measured(
    folder: Path, options: argparse.Namespace, modality: str, photos: int, seed: int, way: str
) -> list[dict]:
    whole = one_modality(read_capture(folder), modality)
    settings = TrainSettings(
        iterations=options.iterations, max_anchors=options.max_anchors, seed=seed,
        downscale=options.downscale or choose_downscale(whole.photos),
    )  # fmt: skip
    kind = type("", (ThinnedTrainer,), {"left_out": WAYS[way].get("left_out", 0)})
    kind = kind if "left_out" in WAYS[way] else Trainer
    trainer = kind(open_device(), part_of(whole, photos), changed(settings, WAYS[way]))
    for _ in trainer.steps():
        pass
    psnr_db, likeness = fit_of(trainer, trainer.held_out)
    train_db, _ = fit_of(trainer, trainer.schedule.photos[modality][:LOOKED_AT])
    return [{
        "capture": folder.name, "modality": modality, "photos": photos, "way": way, "seed": seed,
        "psnr_db": f"{psnr_db:.2f}", "ssim": f"{likeness:.4f}", "train_db": f"{train_db:.2f}",
        "steps": trainer.iteration, "anchors": trainer.anchors_count,
        "seconds": f"{trainer.elapsed:.1f}",
    }]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", nargs="+", help="folder and modality, in turns")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--photos", type=int, nargs="+", default=[3, 6, 12, 0])
    parser.add_argument("--iterations", type=int, default=600)
    parser.add_argument("--max-anchors", type=int, default=6000)
    parser.add_argument("--downscale", type=int)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--ways", nargs="+", choices=list(WAYS), default=list(WAYS))
    add_sweep(parser)
    options = parser.parse_args()
    pairs = list(zip(options.captures[::2], options.captures[1::2], strict=True))
    runs = {}
    for word, modality in pairs:
        folder = Path(word).absolute()
        for photos in options.photos:
            for seed in options.seeds:
                for way in options.ways:
                    name = f"{folder.name} {modality} {photos} {seed} {way}"
                    runs[name] = partial(measured, folder, options, modality, photos, seed, way)
    sweep(options, COLUMNS, runs, {word: Path(word).absolute() for word, _ in pairs})


if __name__ == "__main__":
    main()
