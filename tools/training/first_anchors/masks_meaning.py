"""What it costs to take masks for something else: an object cut out, or people who are hidden.

    python3 tools/training/first_anchors/masks_meaning.py --out docs/bench/masks_meaning.csv \
        [--seconds 20] [--masks object valid] [--seeds 0]

Two kinds of tools/synthetic/strangers.py whose files do not say what their masks mean: cut_out,
an object before a wall, and passers, a room in which somebody stands in every photo; the column
auto is what their shapes tell the reader.  psnr_db is against what the tracer shows from the places
of the held-out photos without the wall and without the people, not against the photos; worst_db of
the worst of these.
"""

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[2]), str(HERE.parent), str(HERE)]

from strangers import begun_rows, draw  # noqa: E402

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.training.evaluation.metrics import psnr  # noqa: E402
from shapeshift.training.settings import Masks, TrainSettings  # noqa: E402
from shapeshift.training.synthetic.tracer import Place, photograph  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402
from tools.synthetic.strangers import (  # noqa: E402
    BLACK,
    KINDS,
    make_stranger,
    radiance,
)

COLUMNS = (
    "capture", "seed", "auto", "masks", "psnr_db", "worst_db", "seconds", "steps", "count", "said",
)  # fmt: skip


def truths(name: str, place: Place, views: list) -> list[np.ndarray]:
    """What is there without wall and people, from each view."""
    kind = replace(KINDS[name], backdrop=False, behind=BLACK)
    along = radiance(kind, place, lambda d: d)
    return [photograph(view, along)[0] for view in views]


def trained(device, folder: Path, masks: Masks, options, seed: int, made: tuple) -> dict:
    capture = read_capture(folder)
    settings = TrainSettings(iterations=None, seconds=options.seconds, seed=seed, masks=masks)
    run = Trainer(device, capture, settings)
    for _ in run.steps():
        pass
    held_out = [p for p in capture.photos if p.split == "test"]
    place, views = made
    numbers = [int(p.path.stem.rpartition("_")[2]) for p in held_out]
    wanted = truths(folder.name, place, [views[i] for i in numbers])
    each = []
    for photo, truth in zip(held_out, wanted, strict=True):
        drawn = device.download(draw(run, photo.view).frame.image).transpose(1, 2, 0)
        each.append(psnr(drawn, truth))
    return {
        "auto": held_out[0].mask_means,
        "psnr_db": f"{np.mean(each):.2f}", "worst_db": f"{min(each):.2f}",
        "seconds": f"{run.elapsed:.1f}", "steps": run.iteration,
        "count": len(run.adam[run.param_group]),
        "said": " ".join((*capture.doubts, *run.warnings)).replace(str(folder), folder.name),
    }  # fmt: skip


def asked() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--masks", nargs="+", default=["object", "valid"])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    return parser.parse_args()


def main() -> None:
    options, device = asked(), open_device("cpu")
    with options.out.open("w", newline="") as file, tempfile.TemporaryDirectory() as above:
        rows = begun_rows(file, Path(__file__).name, device, COLUMNS)
        for kind in ("cut_out", "passers"):
            for seed in options.seeds:
                folder = Path(above) / str(seed) / kind
                folder.mkdir(parents=True)
                made = make_stranger(folder, kind, seed)
                for masks in options.masks:
                    found = trained(device, folder, masks, options, seed, made)
                    rows.writerow({"capture": kind, "seed": seed, "masks": masks} | found)
                    file.flush()


if __name__ == "__main__":
    main()
