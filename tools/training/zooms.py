"""A bound from below on the size of splats: what it gives when one looks closer or from afar.

    python3 tools/training/zooms.py CAPTURE MODALITY ... --out docs/bench/zooms.csv
        [--iterations 600] [--max-anchors 6000] [--seeds 0 1] [--views 4] [--downscale 4]
        [--bounds 0 0.45]

CAPTURE is a folder of photos, made --downscale times smaller for the training, or `workshop`, the
demo's bench at 192x144 pixels, made on the spot unless there is such a folder.  Held-out views are
drawn at 1/4, 1/2, 1, 2 and 4 times the size of the training.  The truth is the photo itself, for
the bench ray-traced again at four times its size, and for the smaller sizes what blocks of its
pixels have in the mean.  bound_px is min_scale_px; thin is the share of the opacity in splats one
axis of which is below 0.45 pixels.
"""

import argparse
import csv
import shlex
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[2])]

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.scene.captures.capture import Capture  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.scene.pose import View  # noqa: E402
from shapeshift.training.baselines.plain import one_modality  # noqa: E402
from shapeshift.training.evaluation.metrics import psnr  # noqa: E402
from shapeshift.training.photos import BLACK, read  # noqa: E402
from shapeshift.training.settings import TrainSettings  # noqa: E402
from shapeshift.training.synthetic.tracer import photograph  # noqa: E402
from shapeshift.training.synthetic.workshop import make_workshop, radiance  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402

COLUMNS = (
    "capture", "modality", "bound_px", "seed", "size", "psnr_db", "thin", "steps", "seconds",
)  # fmt: skip
WORKSHOP = {"size": (192, 144), "views": 36, "test_views": 8}
SIZES, MOST = (0.25, 0.5, 1, 2, 4), 4
THIN = 0.45  # pixels
Truth = dict[float, list[tuple[View, np.ndarray]]]  # by size: views and their pictures (H, W, 3)


def shrunk(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """The means of an image's blocks: what a sensor of fewer pixels sees."""
    width, height = size
    rows, columns = image.shape[0] // height, image.shape[1] // width
    image = image[: rows * height, : columns * width]
    return image.reshape(height, rows, width, columns, 3).mean(axis=(1, 3), dtype=np.float32)


def truth_of(capture: Capture, traced: bool, views: int, background) -> Truth:
    out: Truth = {}
    (stop,) = capture.stops
    tests = capture.of(stop.name, "test")
    for photo in tests[:: -(-len(tests) // views)]:
        if traced:
            width, height = photo.view.size
            finest = photo.view.resized((width * MOST, height * MOST))
            image = photograph(finest, radiance(stop.name))[0]
        else:
            finest, image = photo.view, read(photo, 1, "object").over(background)
        for size in SIZES:
            view = finest.divided(round(MOST / size))
            out.setdefault(size, []).append((view, shrunk(image, view.size)))
    return out


def scores(trainer: Trainer, truth: Truth) -> dict[float, float]:
    """Mean dB at every size."""
    (stop,), behind = trainer.stops, trainer.schedule.background or BLACK
    control, out = trainer.control(stop.name), {}
    for size, pictures in truth.items():
        values = []
        for view, wanted in pictures:
            image = trainer.device.download(trainer.step.draw(view, control, behind).frame.image)
            values.append(psnr(image.transpose(1, 2, 0), wanted))
        out[size] = float(np.mean(values))
    return out


def thin_share(trainer: Trainer) -> float:
    """Of the opacity, as the first training photo sees the splats."""
    (stop,) = trainer.stops
    trainer.min_scale.look(trainer.adam["anchors"])
    photo = trainer.schedule.photos[stop.name][0]
    splats = trainer.step.decode(trainer.control(stop.name), photo.view.world_from_eye.position)
    scales, opacity, pixels = (
        trainer.device.download(a)
        for a in (splats.scales, splats.opacity, trainer.min_scale.pixels)
    )
    solid = np.maximum(opacity, 0)
    least = THIN * pixels.repeat(trainer.layout.splats)
    return float(solid[scales.min(axis=1) < least].sum() / solid.sum())


def runs(options: argparse.Namespace, device, folder: Path) -> Iterator[dict]:
    for name, modality in zip(options.captures[::2], options.captures[1::2], strict=True):
        traced, there = Path(name).name == "workshop", Path(name)
        if traced and not there.exists():
            there = make_workshop(folder, **WORKSHOP, processes=1).folder
        capture, truth = one_modality(read_capture(there), modality), None
        for seed in options.seeds:
            for bound in options.bounds:
                settings = TrainSettings(
                    iterations=options.iterations, max_anchors=options.max_anchors, seed=seed,
                    min_scale_px=bound, downscale=1 if traced else options.downscale,
                )  # fmt: skip
                trainer = Trainer(device, capture, settings)
                behind = trainer.schedule.background or BLACK
                truth = truth or truth_of(capture, traced, options.views, behind)
                for _ in trainer.steps():
                    pass
                found, thin = scores(trainer, truth), thin_share(trainer)
                for size, db in found.items():
                    yield {
                        "capture": Path(name).name, "modality": modality, "bound_px": bound,
                        "seed": seed, "size": size, "psnr_db": f"{db:.2f}", "thin": f"{thin:.3f}",
                        "steps": trainer.iteration, "seconds": f"{trainer.elapsed:.1f}",
                    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", nargs="+", help="folder and modality, in turns")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--iterations", type=int, default=600)
    parser.add_argument("--max-anchors", type=int, default=6000)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    parser.add_argument("--views", type=int, default=4)
    parser.add_argument("--downscale", type=int, default=MOST)
    parser.add_argument("--bounds", type=float, nargs="+", default=[0, 0.45])
    options, device = parser.parse_args(), open_device()
    words = [Path(w).name if Path(w).is_dir() else w for w in sys.argv[1:]]
    with options.out.open("w", newline="") as file, tempfile.TemporaryDirectory() as folder:
        file.write(f"# python3 tools/training/zooms.py {shlex.join(words)}\n")
        file.write(f"# {device.name}, {device.platform}\n")
        rows = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        rows.writeheader()
        for row in runs(options, device, Path(folder)):
            rows.writerow(row)
            file.flush()


if __name__ == "__main__":
    main()
