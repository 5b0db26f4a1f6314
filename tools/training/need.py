"""What captures need of a model: the need report of `launch.py fit`, a row a part and modality.

    python tools/training/need.py CAPTURE ... --out docs/bench/need.csv \
        [--iterations 600] [--seeds 2]

`change_db` is to the model before, `total_db` to the largest, each with its standard error over
held-out photos and seeds; bytes, ms and s are what the part costs.  The rows "largest" and
"fitted" hold the models themselves: PSNR, bytes on disk, decode ms, seconds of a training.
"""

import argparse
import platform
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.training.fit.ablation import Trial  # noqa: E402
from shapeshift.training.fit.fit import Fit, FitReport  # noqa: E402
from shapeshift.training.settings import TrainSettings  # noqa: E402

COLUMNS = (
    "capture,part,verdict,modality,change_db,change_error,total_db,total_error,bytes,decode_ms,"
    "train_s"
)


def show(row: list) -> str:
    text = ",".join(
        "" if v is None else f"{v:.3f}" if isinstance(v, float) else str(v) for v in row
    )
    print(text, flush=True)  # noqa: T201
    return text


def model_rows(name: str, word: str, found: Trial) -> list[str]:
    facts = found.as_dict()
    costs = [found.bytes, found.decode_ms, found.train_s]
    psnr = facts["psnr_db"].items()
    return [show([name, word, "", m, None, None, db, None, *costs]) for m, db in psnr]


def part_rows(name: str, need: FitReport) -> list[str]:
    return [
        show(
            [
                name, verdict.part, verdict.verdict, modality, change.mean, change.error,
                verdict.total[modality].mean, verdict.total[modality].error, verdict.bytes,
                verdict.decode_ms, verdict.train_s,
            ]
        )
        for verdict in need.decisions
        for modality, change in verdict.change.items()
    ]  # fmt: skip


def outline_rows(name: str, need: FitReport) -> list[str]:
    return [
        show([name, "outlines in common", "", f"{a} and {b}", None, None, iou, *[None] * 4])
        for (a, b), iou in need.outlines.items()
    ]


def measure(folder: Path, settings: TrainSettings, tolerance_db: float, seeds: int) -> list[str]:
    capture = read_capture(folder)
    need = Fit(open_device(), capture, settings, tolerance_db, seeds, lambda what, done: None).run()
    name = folder.name
    return [
        *model_rows(name, "largest", need.full), *part_rows(name, need),
        *outline_rows(name, need), *model_rows(name, "fitted", need.fitted),
    ]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", nargs="+", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--iterations", type=int, default=600)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--tolerance-db", type=float, default=0.1)
    parser.add_argument("--max-anchors", type=int, default=TrainSettings().max_anchors)
    parser.add_argument("--downscale", type=int)
    options = parser.parse_args()
    settings = TrainSettings(
        iterations=options.iterations, max_anchors=options.max_anchors,
        downscale=options.downscale,
    )  # fmt: skip
    rows = []
    for folder in options.captures:
        rows += measure(folder, settings, options.tolerance_db, options.seeds)
    if options.out:
        words = [Path(word).name if Path(word).is_dir() else word for word in sys.argv[1:]]
        command = f"# python tools/training/need.py {' '.join(words)}"
        machine = f"# {platform.machine()}, {open_device().name}"
        options.out.write_text("\n".join([command, machine, COLUMNS, *rows, ""]))


if __name__ == "__main__":
    main()
