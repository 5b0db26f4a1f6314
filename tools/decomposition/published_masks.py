"""One object by four published masks, scored on all of them: maryrose_tankard, a row a training.

    python tools/decomposition/published_masks.py DATA/maryrose_tankard --work WORK \\
        --seconds 40 --out docs/bench/tankard.csv

The photos are trained with their masks unused, so that the table and its cloth are in the scene;
`segment` gets the masks of the first photo and of those a quarter, a half and three quarters on.
"""

import argparse
import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
COLUMNS = "capture,core_s,given,scored,iou,boundary_iou,accuracy"


def write_maps(masks: Path, work: Path) -> tuple[int, int]:
    """WORK/true and WORK/given as label maps of 0 and 1; how many are in each."""
    paths = sorted(masks.glob("*.png"))
    given = {i * len(paths) // 4 for i in range(4)}
    for folder in ("true", "given"):
        (work / folder).mkdir(parents=True, exist_ok=True)
    for i, path in enumerate(paths):
        with Image.open(path) as picture:
            labels = (np.asarray(picture.convert("L")) > 127).astype(np.uint8)
        for folder in ("true", "given") if i in given else ("true",):
            Image.fromarray(labels).save(work / folder / path.name)
    return len(given), len(paths)


def prepare(data: Path, work: Path) -> None:
    """WORK/tankard and WORK/plush: links to photos and poses, boxes, label maps, a training."""
    from tools.decomposition.from_photos import CASES as REAL
    from tools.decomposition.from_photos import objects_file

    drawn = ROOT / "tests/fixtures/drawn_labels/plush"
    for name, source, small in (("tankard", "maryrose_tankard", 4), ("plush", "plush_snowmiku", 3)):
        folder = work / name
        (folder / "truth").mkdir(parents=True, exist_ok=True)
        for file in ("images", "masks", "cameras.json", "points3d.npz"):
            if (data / source / file).exists() and not (folder / file).exists():
                (folder / file).symlink_to(data / source / file)
        first = dict(list(REAL[name].objects.items())[:1])  # the one that has label maps
        objects_file(replace(REAL[name], objects=first), folder / "objects.json")
        if name == "tankard":
            write_maps(data / source / "masks", work / "maps")
            shutil.copytree(work / "maps/true", folder / "truth/labels", dirs_exist_ok=True)
            shutil.copytree(work / "maps/given", folder / "labels", dirs_exist_ok=True)
        else:
            shutil.copytree(drawn, folder / "truth/labels", dirs_exist_ok=True)
            (folder / "labels").mkdir(exist_ok=True)
            for path in sorted(drawn.glob("*.png"))[::2]:
                shutil.copy(path, folder / "labels")
        if not (folder / f"{name}.shift").exists():
            words = ["train", str(folder), "--out", str(folder / f"{name}.shift"),
                     "--masks", "ignore", "--seconds", "90", "--downscale", str(small)]  # fmt: skip
            program = [sys.executable, "-P", str(ROOT / "shapeshift/__main__.py")]
            subprocess.run([*program, *words], check=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--seconds", type=float, default=40.0)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    given, scored = write_maps(options.data / "masks", options.work)
    program = [sys.executable, "-P", str(ROOT / "shapeshift" / "__main__.py")]
    package = options.work / "t.shift"
    small = ["--downscale", "4"]
    if not package.is_file():
        words = ["--masks", "ignore", "--seconds", f"{options.seconds:g}", *small]
        subprocess.run([*program, "train", str(options.data), "--out", str(package), *words],
                       check=True)  # fmt: skip
    cut = options.work / "cut" / "t.scene.json"
    words = ["--masks", str(options.work / "given"), "--score", str(options.work / "true"),
             "--no-complete", "--json", "--overwrite", "--out", str(cut), *small]  # fmt: skip
    said = subprocess.run([*program, "segment", str(package), str(options.data), *words],
                          check=True, stdout=subprocess.PIPE).stdout  # fmt: skip
    (score,) = json.loads(said)["objects"].values()
    figures = ",".join(f"{score[k]:.3f}" for k in ("iou", "boundary_iou", "accuracy"))
    row = f"{options.data.name},{options.seconds:g},{given},{scored},{figures}\n"
    sys.stdout.write(row)
    if options.out:
        head = "# python tools/decomposition/published_masks.py DATA/maryrose_tankard --work WORK "
        head += f"--seconds {options.seconds:g} --out tankard.csv\n# photos of 250x250 pixels\n"
        options.out.write_text(head + COLUMNS + "\n" + row)


if __name__ == "__main__":
    main()
