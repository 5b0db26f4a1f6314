"""What pixels without a value cost: trained with them, against photos that have all values.

    python3 tools/training/first_anchors/unknown_pixels.py --out docs/bench/unknown.csv \
        [--iterations 300] [--side 64] [--photos 24] [--seeds 0 1]

A ray-traced capture of balls, its heat as TIFF files of floats.  border: two pixels along the edges
are -9999, as GDAL's tag says; halves: the left half of every second photo is NaN; corners: what a
turned picture leaves, no data in all four.  whole: no pixel lacks, another training.  masked: the
whole photos with masks of the same pixels, which mean "valid".  All are scored on the same pixels
of the held-out photos, those that are known; psnr_db of heat, light_db of the light beside it.
"""

import argparse
import csv
import shlex
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, TiffImagePlugin

ROOT = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT)]

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.scene.captures.capture import Capture  # noqa: E402
from shapeshift.scene.captures.photo import load_photo  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.scene.captures.write_capture import write_capture  # noqa: E402
from shapeshift.training.evaluation.evaluate import evaluate_model  # noqa: E402
from shapeshift.training.settings import TrainSettings  # noqa: E402
from shapeshift.training.synthetic.balls import make_balls  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402

COLUMNS = (
    "lacks", "seed", "unknown", "photos", "psnr_db", "less_than_whole_db", "ssim", "light_db",
    "said",
)  # fmt: skip
GDAL_NODATA = 42113
LOW, HIGH = 20.0, 100.0  # degrees
HELD_OUT = 4


def lacking(case: str, side: int, number: int) -> np.ndarray:
    """(side, side) bool which pixels of a photo have no value."""
    y, x = np.indices((side, side))
    if case == "border":
        return np.minimum(np.minimum(x, y), side - 1 - np.maximum(x, y)) < 2
    if case == "halves":
        return (x < side // 2) & (number % 2 == 1)
    return np.minimum(x, side - 1 - x) + np.minimum(y, side - 1 - y) < side // 4


def heat_capture(source: Capture, folder: Path, case: str, how: str) -> Capture:
    """The capture with heat in degrees; how: whole, masked or unknown."""
    folder.mkdir(parents=True)
    photos, number = [], 0
    for photo in source.photos:
        if photo.modality == "Thermal":
            degrees = LOW + (HIGH - LOW) * load_photo(photo).rgb[..., 0] / np.float32(255)
            gone = lacking(case, len(degrees), number)
            path, number = folder / f"heat_{number:03}.tif", number + 1
            tags = TiffImagePlugin.ImageFileDirectory_v2()
            if how == "unknown":
                degrees[gone] = np.nan if case == "halves" else -9999
                if case != "halves":
                    tags[GDAL_NODATA] = "-9999"
                    tags.tagtype[GDAL_NODATA] = 2
            Image.fromarray(degrees).save(path, tiffinfo=tags)
            photo = replace(photo, path=path, counts=(LOW, HIGH))
            if how == "masked":
                mask = path.with_suffix(".mask.png")
                Image.fromarray(np.where(gone, 0, 255).astype(np.uint8)).save(mask)
                photo = replace(photo, mask=mask, mask_means="valid")
        else:
            copied = folder / photo.path.name
            copied.write_bytes(photo.path.read_bytes())
            photo = replace(photo, path=copied)
        photos.append(photo)
    write_capture(replace(source, folder=folder, photos=tuple(photos)))
    return read_capture(folder)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--iterations", type=int, default=300)
    parser.add_argument("--side", type=int, default=64)
    parser.add_argument("--photos", type=int, default=24)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    options = parser.parse_args()
    device = open_device()
    with options.out.open("w", newline="") as file, tempfile.TemporaryDirectory() as place:
        file.write(
            f"# python3 tools/training/first_anchors/unknown_pixels.py {shlex.join(sys.argv[1:])}\n"
        )
        rows = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        rows.writeheader()
        (balls := Path(place, "balls")).mkdir()
        source = make_balls(balls, options.side, options.photos, HELD_OUT)
        for seed in options.seeds:
            settings = TrainSettings(iterations=options.iterations, max_anchors=1500, seed=seed)
            whole = heat_capture(source, Path(place, f"whole_{seed}"), "border", "whole")
            trainer = trained(device, whole, settings)
            for case in ("border", "halves", "corners"):
                of_whole = None
                for how in ("unknown", "whole", "masked"):
                    folder = Path(place, f"{case}_{how}_{seed}")
                    mine = heat_capture(source, folder, case, how) if how != "whole" else whole
                    run = trainer if how == "whole" else trained(device, mine, settings)
                    if how == "unknown":
                        scored = mine
                        of_whole = evaluate_model(device, trainer.model(), scored)["Thermal"]
                    scores = evaluate_model(device, run.model(), scored)
                    heat = scores["Thermal"]
                    rows.writerow({
                        "lacks": case, "seed": seed, "photos": how,
                        "unknown": f"{heat.unknown:.3f}", "psnr_db": f"{heat.psnr_db:.2f}",
                        "less_than_whole_db": f"{of_whole.psnr_db - heat.psnr_db:.2f}",
                        "ssim": f"{heat.ssim:.4f}", "light_db": f"{scores['RGB'].psnr_db:.2f}",
                        "said": " ".join(w for w in run.warnings if "no value" in w),
                    })  # fmt: skip
                    file.flush()


def trained(device, capture: Capture, settings: TrainSettings) -> Trainer:
    run = Trainer(device, capture, settings)
    for _ in run.steps():
        pass
    return run


if __name__ == "__main__":
    main()
