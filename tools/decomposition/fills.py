"""What completion fills behind the things of captures by rule, beside photos without the things.

    python -m tools.synthetic.everyday WORK turntable room forward dome
    python tools/decomposition/fills.py WORK/turntable WORK/room ... --out docs/bench/fills.csv

Each capture has NAME.shift, trained on it, in its folder.  Things are cut by the label maps of ten
photos.  Figures are the PSNR of the background alone within each thing's true mask, over the eight
photos that the place without its things was drawn for, before and after completion; "rest" is what
no thing covers.
"""

import argparse
import csv
import json
import sys
import time
from pathlib import Path

import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.app.decomposition.segment import Options, straight_capture  # noqa: E402
from shapeshift.app.opening import open_model  # noqa: E402
from shapeshift.decomposition.completion.complete import complete, only_background  # noqa: E402
from shapeshift.decomposition.completion.verify import (  # noqa: E402
    ModelPictures,
    decibels,
    over,
)
from shapeshift.decomposition.masks.specs import read_specs  # noqa: E402
from shapeshift.decomposition.photo_views import photo_views, row_evidence  # noqa: E402
from shapeshift.decomposition.segment_scene import (  # noqa: E402
    named_objects,
    read_pictures,
    segment,
)
from shapeshift.rasterizer.device import Device, open_device  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel  # noqa: E402
from shapeshift.scene.cameras.framing import default_background  # noqa: E402

LEAST_PIXELS = 30  # of a mask
FIELDS = ("capture", "thing", "pixels", "before_db", "after_db", "cpu_s", "what")


def rows_of(device: Device, folder: Path) -> list[dict]:
    """A row a thing and one of the rest."""
    options = Options(scene=folder / f"{folder.name}.shift", capture=folder,
                      out=folder / "x.scene.json", masks=folder / "labels")  # fmt: skip
    model = open_model(options.scene, options)
    assert isinstance(model, AnchorModel)
    capture = straight_capture(options, model, lambda *said: None)
    pictures = read_pictures(folder / "labels", capture, model, 1)
    objects = named_objects(pictures, read_specs(folder / "objects.json").objects)
    found = segment(device, model, pictures, objects, len(capture.photos), lambda done, of: None)
    cut = found.model
    assert isinstance(cut, AnchorModel) and cut.labels is not None
    behind = default_background(cut, capture.background or (0.0, 0.0, 0.0))
    views = photo_views(device, found, capture, 1)
    names = {part.spec.label: part.spec.name for part in found.parts if part.rows}
    begun = time.process_time()
    whole, told = complete(
        device, cut, views, list(names), row_evidence(device, cut, views).background,
        background=behind,
    )  # fmt: skip
    seconds = time.process_time() - begun
    pair = [ModelPictures(device, only_background(each)) for each in (cut, whole)]
    sums = {label: np.zeros(3) for label in (*names, 0)}  # pixels, squares before and after
    photos = {photo.path.stem: photo for photo in capture.photos}
    for path in sorted((folder / "truth/hidden").glob("*.png")):
        true = np.asarray(Image.open(path).convert("RGB"), np.float32) / 255
        labels = np.asarray(Image.open(folder / f"truth/labels/{path.name}"))
        view = photos[path.stem].view
        drawn = [over(each.draw(view, cut.stops[0].x), behind) for each in pair]
        errors = [((each - true) ** 2).mean(2) for each in drawn]
        for label in sums:
            mask = labels == label
            if mask.sum() >= LEAST_PIXELS:
                sums[label] += mask.sum(), *(error[mask].sum() for error in errors)
    said = {one.label: one.sentence() for one in told}
    return [
        {"capture": folder.name, "thing": names.get(label, "rest"), "pixels": int(pixels),
         "before_db": f"{decibels(before / pixels):.2f}",
         "after_db": f"{decibels(after / pixels):.2f}",
         "cpu_s": "" if label else f"{seconds:.1f}", "what": said.get(label, "")}
        for label, (pixels, before, after) in sums.items()
    ]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", type=Path, nargs="+")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    device = open_device("cpu")
    rows: list[dict] = []
    for folder in options.captures:
        for row in rows_of(device, folder):
            rows.append(row)
            sys.stdout.write(json.dumps(row) + "\n")
            sys.stdout.flush()
    if options.out:
        names = " ".join(each.name for each in options.captures)
        with options.out.open("w", newline="") as file:
            file.write(f"# python tools/decomposition/fills.py {names} --out {options.out}\n")
            file.write(f"# {device.platform}\n")
            table = csv.DictWriter(file, FIELDS, lineterminator="\n")
            table.writeheader()
            table.writerows(rows)


if __name__ == "__main__":
    main()
