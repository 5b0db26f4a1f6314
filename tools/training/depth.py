"""What depth photos are worth: decibels and depth with and without them, from few photos and many.

    python3 tools/training/depth.py --seconds 60 --out docs/bench/depth.csv

The capture is balls (training/synthetic/balls.py) or a folder whose photos have depth.  start is
where the first anchors come from: the capture's points, or, without them, a visual hull.  views
is how many training photos of each modality are used, 0 for all.  share is depth_share; 0 trains on
the same photos alone.  depth_error is what `eval` tells over the held-out photos: the mean of
|depth - d| / d, 1 where less than half of a pixel is covered.  Shares take turns within a seed.
"""

import argparse
import csv
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.scene.captures.capture import Capture  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.training.evaluation.evaluate import evaluate_model  # noqa: E402
from shapeshift.training.settings import TrainSettings  # noqa: E402
from shapeshift.training.synthetic.balls import make_balls  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402

COLUMNS = (
    "capture", "start", "views", "share", "seed", "steps", "seconds", "anchors", "modality",
    "psnr_db", "ssim", "depth_error",
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--capture", type=Path, help="default: balls")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seconds", type=float, help="a run; or give --iterations")
    parser.add_argument("--iterations", type=int)
    parser.add_argument("--max-anchors", type=int, default=4000)
    parser.add_argument(
        "--starts", nargs="+", choices=("points", "hull"), default=["points", "hull"]
    )
    parser.add_argument("--views", type=int, nargs="+", default=[3, 6, 12, 0])
    parser.add_argument("--shares", type=float, nargs="+", default=[0, 0.1, 0.2, 0.3, 0.5, 1.0])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--size", type=int, default=200, help="pixels of the photos of balls")
    options = parser.parse_args()
    if options.seconds is None and options.iterations is None:
        parser.error("a run needs an end: give --seconds or --iterations")
    settings = TrainSettings(
        iterations=options.iterations, seconds=options.seconds, max_anchors=options.max_anchors
    )
    device = open_device()
    with options.out.open("w", newline="") as file, tempfile.TemporaryDirectory() as folder:
        file.write(f"# python3 tools/training/depth.py {' '.join(sys.argv[1:])}\n")
        file.write(f"# {device.name}, {device.platform}\n")
        rows: csv.DictWriter[str] = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        rows.writeheader()
        if options.capture is None:
            make_balls(Path(folder), options.size, depth=True)
        capture = read_capture(options.capture or Path(folder))
        if not any(photo.depth for photo in capture.photos):
            parser.error(f"{options.capture}: no photo has a depth photo")
        for start in options.starts:
            for views in options.views:
                for seed in options.seeds:
                    for share in options.shares:
                        part = part_of(capture, start, views)
                        asked = replace(settings, seed=seed, depth_share=share)
                        shared = {
                            "capture": options.capture.name if options.capture else "balls",
                            "start": start, "views": views, "share": share, "seed": seed,
                        }  # fmt: skip
                        rows.writerows(shared | row for row in measured(device, part, asked))
                        file.flush()


def part_of(capture: Capture, start: str, views: int) -> Capture:
    """With so many training photos of each modality, spread over all; the held-out ones stay."""
    photos = []
    for stop in capture.stops:
        mine = capture.of(stop.name, "train")
        some = np.unique(np.linspace(0, len(mine) - 1, views or len(mine)).round().astype(int))
        photos += [mine[i] for i in some] + capture.of(stop.name, "test")
    points = {} if start == "points" else {"points": None, "point_colors": None}
    return replace(capture, photos=tuple(photos), **points)


def measured(device, capture: Capture, settings: TrainSettings) -> list[dict]:
    """A row a modality and their mean, at the end of a run."""
    trainer = Trainer(device, capture, settings)
    for _ in trainer.steps():
        pass
    scores = evaluate_model(device, trainer.model(), capture)
    shared = {
        "steps": trainer.iteration,
        "seconds": f"{trainer.elapsed:.1f}",
        "anchors": trainer.anchors_count,
    }
    found = {name: (s.psnr_db, s.ssim, s.depth_error) for name, s in scores.items()}
    known = [numbers for numbers in found.values() if numbers[2] is not None]
    if len(known) == len(found):
        found["mean"] = tuple(np.mean(np.array(known, float), axis=0))
    return [
        shared | {
            "modality": name, "psnr_db": f"{psnr:.2f}", "ssim": f"{ssim:.4f}",
            "depth_error": "" if error is None else f"{error:.5f}",
        }
        for name, (psnr, ssim, error) in found.items()
    ]  # fmt: skip


if __name__ == "__main__":
    main()
