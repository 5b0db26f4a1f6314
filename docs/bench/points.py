"""What first points are worth: `--points` by held-out PSNR, a row a source and modality.

    python docs/bench/points.py CAPTURE ... [--clouds SCAN.las ...] --out docs/bench/points.csv
        [--iterations 1000] [--seeds 2] [--anchors 6000]

Sources that a capture does not have are rows without figures, with the program's sentence.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from rasterizer.device import open_device  # noqa: E402
from runtime_models.model import BadFile  # noqa: E402
from scene.capture import Capture  # noqa: E402
from scene.read_capture import read_capture  # noqa: E402
from training.initial import SOURCES  # noqa: E402
from training.photos import choose_downscale, load_photos  # noqa: E402
from training.settings import TrainSettings  # noqa: E402
from training.train import Trainer  # noqa: E402

COLUMNS = "capture,points,seed,modality,psnr_db,seconds,first_anchors,anchors,voxel_m,origin"


def show(row: list) -> str:
    text = ",".join(f"{v:.4f}" if isinstance(v, float) else str(v).replace(",", ";") for v in row)
    print(text, flush=True)  # noqa: T201
    return text


def one_run(device, capture: Capture, loaded: dict, settings: TrainSettings) -> list[str]:
    name = capture.folder.name
    start = [name, Path(settings.points).name, settings.seed]
    try:
        trainer = Trainer(device, capture, settings, loaded=loaded)
    except BadFile as error:
        return [show([*start, "", "", "", "", "", "", error])]
    first = trainer.anchors_count
    for _ in trainer.steps():
        pass
    end = [trainer.elapsed, first, trainer.anchors_count, trainer.voxel, trainer.origin]
    psnr = trainer.held_out_psnr(most=len(trainer.held_out))
    return [show([*start, modality, db, *end]) for modality, db in psnr.items()]


def measure(folder: Path, sources: list[str], settings: TrainSettings, seeds: int) -> list[str]:
    """Every source in turn, seed by seed, so that a busy machine slows all of them alike."""
    capture, device = read_capture(folder), open_device()
    factor = settings.downscale or choose_downscale(capture.photos)
    loaded = {s: load_photos(capture, s, factor, settings.masks) for s in ("train", "test")}
    return [
        row
        for seed in range(seeds)
        for source in sources
        for row in one_run(device, capture, loaded, replace(settings, points=source, seed=seed))
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", nargs="+", type=Path)
    parser.add_argument("--clouds", nargs="*", default=[])
    parser.add_argument("--out", type=Path)
    parser.add_argument("--iterations", type=int, default=1000)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--anchors", type=int, default=6000)
    parser.add_argument("--downscale", type=int)
    asked = parser.parse_args()
    settings = TrainSettings(
        iterations=asked.iterations, anchors=asked.anchors, downscale=asked.downscale
    )
    rows = [show(COLUMNS.split(","))]
    for folder in asked.captures:
        sources = [*(s for s in SOURCES if s != "auto"), *asked.clouds]
        rows += measure(folder, sources, settings, asked.seeds)
    if asked.out is not None:
        asked.out.write_text("\n".join(rows) + "\n")


if __name__ == "__main__":
    main()
