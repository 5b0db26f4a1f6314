"""Does what `segment` says of an object go with the truth?  Rank correlation over captures.

    python tools/decomposition/agreement.py FOLDER ... --out docs/bench/agreement.csv

Each FOLDER is a capture with objects.json (boxes) and labels (true maps), and NAME.shift trained of
it, in it or beside it; tools/synthetic/desk.py makes one.  The demo comes by itself, with boxes in
the views that show most.  Objects are cut three times: as `segment` does; wrong on purpose, each
mask made alone and all that it encloses filled; and with the nearest other object, which is not
listed, in its box.  iou is that of the cut object in the true maps, agreement and doubt are what
the table of `segment` shows.
"""

import argparse
import csv
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from PIL import Image  # noqa: E402
from scipy.ndimage import binary_fill_holes  # noqa: E402
from scipy.stats import spearmanr  # noqa: E402

from shapeshift.app.opening import open_capture  # noqa: E402
from shapeshift.app.paths import DEMO  # noqa: E402
from shapeshift.decomposition.judge import judge  # noqa: E402
from shapeshift.decomposition.masks.anchor_walk import make_graph, nodes_of  # noqa: E402
from shapeshift.decomposition.masks.pixel_walk import PixelWalk  # noqa: E402
from shapeshift.decomposition.masks.specs import ObjectSpec, ObjectSpecs, PhotoPrompt, read_specs  # noqa: E402
from shapeshift.decomposition.masks.work_photos import (  # noqa: E402
    WorkPhoto,
    find_photo,
    prompt_of,
    work_photos,
)
from shapeshift.decomposition.segment_scene import (  # noqa: E402
    Segmented,
    SegmentedPart,
    read_pictures,
    scores_of,
)
from shapeshift.decomposition.shown import ShownAnchors  # noqa: E402
from shapeshift.decomposition.walk_objects import (  # noqa: E402
    labels_of_masks,
    segment_by_walk,
    with_labels,
)
from shapeshift.rasterizer.device import Device, open_device  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel, ObjectLabel  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.scene.captures.capture import Capture, Photo  # noqa: E402
from shapeshift.training.synthetic.workshop import dome  # noqa: E402
from tools.synthetic.labels import LABELS, label_map  # noqa: E402

COLUMNS = ("capture", "masks", "object", "iou", "agreement", "doubt")
TOGETHER, ALONE, PAIR = "together", "alone, filled", "with an unlisted neighbour"
SIZE, VIEWS, MARGIN = (384, 288), 16, 3  # of the demo's photos; pixels of a box around an object


def demo_capture(folder: Path, shown: ShownAnchors) -> tuple[Capture, ObjectSpecs]:
    """Photos of the demo as its model looks, true label maps, a box an object."""
    (folder / "rgb").mkdir(parents=True, exist_ok=True)
    (folder / "labels/rgb").mkdir(parents=True, exist_ok=True)
    photos, maps = [], []
    for i, view in enumerate(dome(VIEWS, 0.0, SIZE)):
        path = folder / f"rgb/{i:03}.png"
        pixels = np.rint(255 * np.clip(shown.look(view, 0.0), 0, 1)).astype(np.uint8)
        Image.fromarray(pixels).save(path)
        maps.append(label_map(view))
        Image.fromarray(maps[-1]).save(folder / f"labels/rgb/{i:03}.png")
        photos.append(Photo(view, path, "RGB"))
    objects = []
    for name, label in LABELS.items():
        if label:
            best = int(np.argmax([(labels == label).sum() for labels in maps]))
            rows, columns = np.nonzero(maps[best] == label)
            low = np.maximum(np.array([columns.min(), rows.min()]) - MARGIN, 0)
            high = np.minimum(np.array([columns.max(), rows.max()]) + 1 + MARGIN, SIZE)
            box = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
            objects.append(ObjectSpec(label, name, (PhotoPrompt(f"rgb/{best:03}.png", box),)))
    stops = tuple(stop for stop in shown.model.stops if stop.name == "RGB")
    return Capture(folder, stops, tuple(photos)), ObjectSpecs(folder, tuple(objects))


def cut_wrong(
    shown: ShownAnchors, photos: list[WorkPhoto], specs: ObjectSpecs, right: Segmented
) -> Segmented:
    """Each object by a mask of its own, without what stands above what, and without holes."""
    eyes = np.array([photo.view.world_from_eye.position for photo in photos])
    graph = make_graph(nodes_of(shown.model, eyes.mean(0).astype(np.float32)), eyes)
    masks: dict[int, dict[int, np.ndarray]] = {}
    for spec in specs.objects:
        view = find_photo(photos, spec.prompts[0].photo, spec.name)
        prompt = prompt_of(spec, spec.prompts[0], photos[view])
        (found,) = PixelWalk().candidates(photos[view].pixels(), prompt)
        masks[spec.label] = {view: binary_fill_holes(found.mask)}
    labels = labels_of_masks(shown, photos, graph, masks)
    parts = tuple(
        SegmentedPart(spec, 1, int((labels == spec.label).sum()), float(masks[spec.label][
            next(iter(masks[spec.label]))].sum())) for spec in specs.objects
    )  # fmt: skip
    objects = tuple(ObjectLabel(spec.label, spec.name) for spec in specs.objects)
    return replace(right, model=with_labels(shown.model, labels, objects), parts=parts)


Box = tuple[float, float, float, float]


def boxes_of(specs: ObjectSpecs, photo: str, labels: np.ndarray | None) -> dict[int, Box]:
    """Of each object in a photo, by label: its prompt's, else that of the true map (H, W)."""
    boxes: dict[int, Box] = {}
    for spec in specs.objects:
        said = spec.prompts[0]
        if said.photo == photo and said.box is not None:
            boxes[spec.label] = said.box
        elif labels is not None and (labels == spec.label).any():
            rows, columns = np.nonzero(labels == spec.label)
            boxes[spec.label] = (float(columns.min()), float(rows.min()),
                                 float(columns.max() + 1), float(rows.max() + 1))  # fmt: skip
    return boxes


def gap(one: Box, other: Box) -> tuple[float, float]:
    """Pixels between two boxes, 0 where they overlap, and between their middles."""
    a, b = np.reshape(one, (2, 2)), np.reshape(other, (2, 2))
    apart = np.maximum(np.maximum(a[0] - b[1], b[0] - a[1]), 0)
    return float(np.linalg.norm(apart)), float(np.linalg.norm((a - b).mean(0)))


def pairs_of(specs: ObjectSpecs, maps: dict[str, np.ndarray]) -> Iterator[ObjectSpecs]:
    """Each two nearest in a prompted photo as one: the larger one's, with a box around both.

    maps: the true label map (H, W) of photos, by file name without its ending.
    """
    done: set[frozenset[int]] = set()
    for spec in specs.objects:
        photo = spec.prompts[0].photo
        boxes = boxes_of(specs, photo, maps.get(Path(photo).stem))
        if len(boxes) < 2 or spec.label not in boxes:
            continue
        near = min(boxes.keys() - {spec.label}, key=lambda k: gap(boxes[k], boxes[spec.label]))
        if frozenset((spec.label, near)) in done:
            continue
        done.add(frozenset((spec.label, near)))
        corners = np.array([boxes[spec.label], boxes[near]])
        sides = corners[:, 2:] - corners[:, :2]
        box = tuple(map(float, (*corners[:, :2].min(0), *corners[:, 2:].max(0))))
        larger = (spec.label, near)[int(np.argmax(sides.prod(1)))]
        whose = next(o for o in specs.objects if o.label == larger)
        other = next(o for o in specs.objects if o.label in (spec.label, near) and o is not whose)
        prompt = PhotoPrompt(photo, (box[0], box[1], box[2], box[3]))
        one = replace(whose, name=f"{whose.name} + {other.name}", prompts=(prompt,))
        yield replace(specs, objects=(one,))


def rows_of(
    device: Device, name: str, model: AnchorModel, capture: Capture, specs: ObjectSpecs, true: Path
) -> Iterator[tuple[str, str, str, float, float, str]]:
    shown, photos = ShownAnchors(device, model), work_photos(capture, model.stops)
    right = segment_by_walk(shown, photos, specs)
    pictures = read_pictures(true, capture, model, None)
    used = {picture.photo for picture in right.pictures if picture.photo is not None}
    cuts = [(TOGETHER, right), (ALONE, cut_wrong(shown, photos, specs, right))]
    maps = {picture.photo.stem: picture.labels for picture in pictures if picture.photo}
    cuts += [(PAIR, segment_by_walk(shown, photos, pair)) for pair in pairs_of(specs, maps)]
    for how, found in cuts:
        scores = scores_of(device, found, pictures)
        judged = judge(device, found.model, found.parts, photos, used)
        for score, one in zip(scores, judged, strict=True):
            yield name, how, one.name, round(score.iou, 3), round(one.agreement, 3), one.doubt


def rank(rows: Sequence[tuple], how: str) -> str:
    """Spearman's correlation of iou and agreement; what nothing is said of counts as 0."""
    chosen = [row for row in rows if row[1] == how or how == "all"]
    truth, said = np.array([(row[3], np.nan_to_num(row[4])) for row in chosen]).T
    return f"{how} {float(spearmanr(truth, said)[0]):.3f} of {len(chosen)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", type=Path, nargs="*")
    parser.add_argument("--work", type=Path, required=True, help="for the demo's photos")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    device, rows = open_device("cpu"), []
    model = read_model(DEMO)
    assert isinstance(model, AnchorModel)
    capture, specs = demo_capture(options.work / "demo", ShownAnchors(device, model))
    rows += rows_of(device, "demo", model, capture, specs, options.work / "demo/labels")
    for folder in options.captures:
        inner, beside = folder / f"{folder.name}.shift", folder.with_suffix(".shift")
        model = read_model(inner if inner.exists() else beside)
        assert isinstance(model, AnchorModel)
        capture = open_capture(folder, None, lambda *said: None)
        specs = read_specs(folder / "objects.json")
        rows += rows_of(device, folder.name, model, capture, specs, folder / "labels")
    names = " ".join(folder.name for folder in options.captures)
    ranks = "; ".join(rank(rows, how) for how in (TOGETHER, ALONE, PAIR, "all"))
    with options.out.open("w", newline="") as file:
        file.write(f"# python tools/decomposition/agreement.py {names} --work WORK --out ")
        file.write(f"{options.out}\n# {device.platform}\n# Spearman: {ranks}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for name, how, what, iou, agreement, doubt in rows:
            writer.writerow([name, how, what, f"{iou:.3f}", f"{agreement:.3f}", doubt])
    sys.stdout.write(ranks + "\n")


if __name__ == "__main__":
    main()
