"""One model with n variants of an object beside n models of it: bytes and decibels.

    python tools/training/variants.py --out docs/bench/variants.csv

The object is the ray-traced balls and box; a variant has its photos in other colours, by turns of
the hue and swapped channels, so that each is as hard as the other.  `joint`: one model, a stop a
variant.  `separate`: a model a variant, of which TRAINED are trained; bytes are n times their mean.
`style`: the model of the first variant, the others put in by `style` from 16 painted views of its
own, without their photos.  Decibels are of held-out photos, steps the same a variant.
"""

import argparse
import colorsys
import resource
import sys
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from ways import add_sweep, sweep  # noqa: E402

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel, Stop  # noqa: E402
from shapeshift.runtime_models.package.feature_codes import EXACT  # noqa: E402
from shapeshift.runtime_models.package.write_package import write_package  # noqa: E402
from shapeshift.scene.captures.capture import Capture, Photo  # noqa: E402
from shapeshift.training.evaluation.evaluate import evaluate_model  # noqa: E402
from shapeshift.training.settings import TrainSettings  # noqa: E402
from shapeshift.training.styles.add_style import NewStyle, add_style  # noqa: E402
from shapeshift.training.styles.style_pictures import Turns  # noqa: E402
from shapeshift.training.styles.train_stop import resized_views  # noqa: E402
from shapeshift.training.synthetic.balls import make_balls  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402

COLUMNS = ("variants", "way", "bytes", "times_joint", "psnr_db", "worst_db", "cpu_s")
SIZE, VIEWS, TESTS = 96, 24, 4
STEPS, ANCHORS = 240, 2500  # steps a variant
TRAINED = 2
COUNTS = (2, 4, 8, 16)


def recolored(picture: np.ndarray, variant: int) -> np.ndarray:
    """(H, W, 3) in 0..1 of the same in another colourway; 0 is the object's own.

    A matrix: swapped channels, then a turn about grey; black stays black.
    """
    order = [(0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)][variant % 6]
    turn = (variant // 6) / 6
    basis = np.array([colorsys.hsv_to_rgb((turn + i / 3) % 1, 1, 1) for i in range(3)])
    basis = basis / basis.sum(axis=0).max()
    return np.clip(picture[..., order] @ basis, 0, 1)


class Recoloured:
    """A StylePictures: the views of the model, each in another colourway."""

    turns = Turns()

    def __init__(self, variant: int) -> None:
        self.variant = variant

    def make(self, views, done):
        return [recolored(view.source, self.variant).astype(np.float32) for view in views]


def capture_of(base: Capture, variants: list[int]) -> Capture:
    """The photos of the base in each colourway, as modalities."""
    places = np.linspace(0, 1, max(len(variants), 2))
    stops = tuple(Stop(f"V{v}", float(x)) for v, x in zip(variants, places, strict=False))
    photos = []
    for variant in variants:
        for photo in base.photos:
            path = photo.path.with_name(f"v{variant}_{photo.path.name}")
            if not path.exists():
                with Image.open(photo.path) as image:
                    pixels = recolored(np.asarray(image.convert("RGB")) / 255, variant)
                Image.fromarray(np.rint(255 * pixels).astype(np.uint8)).save(path)
            photos.append(Photo(photo.view, path, f"V{variant}", None, photo.split))
    return replace(base, stops=stops, photos=tuple(photos))


def trained(device, capture: Capture) -> AnchorModel:
    steps = STEPS * len(capture.stops)
    trainer = Trainer(device, capture, TrainSettings(iterations=steps, max_anchors=ANCHORS))
    for _ in trainer.steps():
        pass
    return trainer.model()


def cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def decibels(device, model: AnchorModel, capture: Capture) -> list[float]:
    return [score.psnr_db for score in evaluate_model(device, model, capture).values()]


def rows_for(count: int) -> list[dict]:
    """The three ways for so many variants."""
    with tempfile.TemporaryDirectory() as folder:
        return rows_in(open_device(), Path(folder), count)


def rows_in(device, work: Path, count: int) -> list[dict]:
    base = make_balls(work / "balls", SIZE, VIEWS, TESTS)
    base = replace(base, photos=tuple(p for p in base.photos if p.modality == "RGB"))
    capture, began = capture_of(base, list(range(count))), cpu_s()
    joint = trained(device, capture)
    spent = cpu_s() - began
    size = write_package(joint, work / "joint.shift", EXACT)
    rows = [row(count, "joint", size, size, decibels(device, joint, capture), spent)]
    models, sizes, figures, times = [], [], [], []
    for variant in [0, count - 1][:TRAINED]:
        alone, began = capture_of(base, [variant]), cpu_s()
        models.append(trained(device, alone))
        times.append(cpu_s() - began)
        sizes.append(write_package(models[-1], work / "alone.shift", EXACT))
        figures += decibels(device, models[-1], alone)
    whole, took = round(count * float(np.mean(sizes))), count * float(np.mean(times))
    rows.append(row(count, "separate", whole, size, figures, took))
    views = resized_views([p.view for p in base.photos if p.split == "train"], SIZE)[:16]
    styled, began = models[0], cpu_s()
    for variant in range(1, count):
        style = NewStyle(f"V{variant}", "V0", steps=STEPS)
        styled = add_style(device, styled, style, Recoloured(variant), views)
    took = cpu_s() - began
    weight = write_package(styled, work / "styled.shift", EXACT)
    return [*rows, row(count, "style", weight, size, decibels(device, styled, capture), took)]


def row(count: int, way: str, size: int, joint: int, db: list[float], took: float) -> dict:
    return {
        "variants": count, "way": way, "bytes": size, "times_joint": f"{size / joint:.2f}",
        "psnr_db": f"{np.mean(db):.2f}", "worst_db": f"{min(db):.2f}", "cpu_s": f"{took:.1f}",
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--counts", nargs="*", type=int, default=list(COUNTS))
    add_sweep(parser)
    options = parser.parse_args()
    runs = {f"{count} variants": partial(rows_for, count) for count in options.counts}
    sweep(options, COLUMNS, runs, {})


if __name__ == "__main__":
    main()
