"""Captures that nothing was tuned on: anchors beside plain splats, with the defaults alone.

    python3 tools/training/first_anchors/strangers.py --out docs/bench/strangers.csv \
        [--seconds 20] [--kinds room aerial ...] [--seeds 0] [--models anchors splats]

Kinds are those of tools/synthetic/strangers.py, each another place for another seed, made on the
spot and read as a stranger's files are.  Both models have the same processor seconds of one core
and start from what the program itself finds.  psnr_db: of all held-out photos; worst_db: of the
worst of them; fitted_db: of their right halves, with the colours fitted on the left ones, which is
what counts where exposures differ; whole_db, where something stands still behind the subject: of
whole photos, which are drawn before it; subject_db: of the pixels that the tracer's subject fills,
in the same drawings; start_s: processor seconds until the first step, which --seconds
counts.
"""

import argparse
import csv
import shlex
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TextIO

import numpy as np
from PIL import Image

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[2]), str(HERE.parent)]

from bare import processor_s  # noqa: E402

from shapeshift.rasterizer.device import Device, open_device  # noqa: E402
from shapeshift.runtime_models.model import BadFile  # noqa: E402
from shapeshift.scene.captures.capture import Capture  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.scene.pose import View  # noqa: E402
from shapeshift.training.baselines.plain import PlainTrainer  # noqa: E402
from shapeshift.training.baselines.plain_settings import PlainSettings  # noqa: E402
from shapeshift.training.drawing import DrawnView  # noqa: E402
from shapeshift.training.evaluation.evaluate import before  # noqa: E402
from shapeshift.training.evaluation.metrics import psnr  # noqa: E402
from shapeshift.training.photos import BLACK  # noqa: E402
from shapeshift.training.settings import TrainSettings, suited  # noqa: E402
from shapeshift.training.supervision.exposure import fitted_psnr  # noqa: E402
from shapeshift.training.supervision.still_background import key_of  # noqa: E402
from shapeshift.training.synthetic.tracer import Place  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402
from tools.synthetic.strangers import KINDS, make_stranger, mask_of  # noqa: E402

COLUMNS = (
    "capture", "seed", "model", "psnr_db", "worst_db", "fitted_db", "whole_db", "subject_db",
    "seconds", "steps", "start_s", "count", "origin", "said",
)  # fmt: skip
MODELS = {"anchors": (Trainer, TrainSettings), "splats": (PlainTrainer, PlainSettings)}


def trained(
    device, capture: Capture, model: str, options: argparse.Namespace, seed: int, place: Place
) -> dict:
    make, settings = MODELS[model]
    asked = settings(iterations=None, seconds=options.seconds, seed=seed)
    if isinstance(asked, TrainSettings):
        asked = suited(asked, (), capture)
    before = processor_s()
    run = make(device, capture, asked)
    start_s = processor_s() - before
    for _ in run.steps():
        pass
    background = run.schedule.background or BLACK
    drawn = [draw(run, photo.view) for photo in run.held_out]
    pairs = list(zip(drawn, run.held_out, strict=True))
    each = [run.psnr_of(drawing, photo, background) for drawing, photo in pairs]
    fitted = [
        fitted_psnr(picture_of(device, drawing), photo, photo.over(background))
        for drawing, photo in pairs
    ]
    if options.pictures:
        save_pictures(run, options.pictures / f"{capture.folder.name}_{seed}_{model}.png")
    return {
        "psnr_db": f"{sum(each) / len(each):.2f}", "worst_db": f"{min(each):.2f}",
        "fitted_db": f"{sum(fitted) / len(fitted):.2f}",
        **of_whole_photos(run, drawn, place),
        "seconds": f"{run.elapsed:.1f}", "steps": run.iteration, "start_s": f"{start_s:.1f}",
        "count": len(run.adam[run.param_group]), "origin": run.origin,
        "said": " ".join(run.warnings).replace(str(capture.folder), capture.folder.name),
    }  # fmt: skip


def of_whole_photos(run, drawn: list[DrawnView], place: Place) -> dict[str, str]:
    """Scores of held-out photos as they were before what stands still was left out."""
    if not run.still.pictures:
        return {}
    whole, subject = [], []
    for drawing, photo in zip(drawn, run.held_out, strict=True):
        picture = before(run.device, drawing.frame, run.still.pictures[key_of(photo)])
        wanted = photo.rgba[..., :3].astype(np.float32) / 255
        there = (mask_of(photo.view, place, 0) >= 0.5).astype(np.float32)
        whole.append(psnr(picture, wanted))
        subject.append(psnr(picture, wanted, there))
    names = {"whole_db": whole, "subject_db": subject}
    return {name: f"{sum(values) / len(values):.2f}" for name, values in names.items()}


def draw(run, view: View):
    """What a run shows from there, over the background that it knows."""
    background = run.schedule.background or BLACK
    if isinstance(run, PlainTrainer):
        return run.step.draw(view, background)
    return run.step.draw(view, run.control(run.stops[0].name), background)


def picture_of(device, drawing) -> np.ndarray:
    """(H, W, 3) of what is drawn."""
    return device.download(drawing.frame.image).transpose(1, 2, 0)


def save_pictures(run, path: Path) -> None:
    """Up to six held-out photos, and below them what the run draws."""
    columns, background = [], run.schedule.background or BLACK
    for photo in run.held_out[:6]:
        drawn = picture_of(run.device, draw(run, photo.view))
        columns.append(np.concatenate([photo.over(background), drawn]))
    sheet = np.rint(255 * np.clip(np.concatenate(columns, axis=1), 0, 1)).astype(np.uint8)
    Image.fromarray(sheet).save(path)


def asked() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument(
        "--kinds",
        nargs="+",
        choices=list(KINDS),
        default=[name for name, kind in KINDS.items() if not kind.masks],
    )
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--models", nargs="+", choices=list(MODELS), default=list(MODELS))
    parser.add_argument("--pictures", type=Path, help="a folder for photos beside drawings")
    return parser.parse_args()


def begun_rows(
    file: TextIO, program: str, device: Device, columns: Sequence[str]
) -> csv.DictWriter:
    """A file's first lines: the command, the machine, the columns."""
    command = f"tools/training/first_anchors/{program} {shlex.join(sys.argv[1:])}"
    file.write(f"# python3 {command}\n# {device.name}, {device.platform}\n")
    rows = csv.DictWriter(file, columns, lineterminator="\n", restval="")
    rows.writeheader()
    return rows


def main() -> None:
    options, device = asked(), open_device("cpu")
    with options.out.open("w", newline="") as file, tempfile.TemporaryDirectory() as folder:
        rows = begun_rows(file, Path(__file__).name, device, COLUMNS)
        for kind in options.kinds:
            for seed in options.seeds:
                there = Path(folder) / str(seed) / kind
                there.mkdir(parents=True)
                place, _ = make_stranger(there, kind, seed)
                for model in options.models:
                    try:
                        found = trained(device, read_capture(there), model, options, seed, place)
                    except BadFile as why:
                        found = {"said": str(why).replace(str(there), kind)}
                    rows.writerow({"capture": kind, "seed": seed, "model": model} | found)
                    file.flush()


if __name__ == "__main__":
    main()
