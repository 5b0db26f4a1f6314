"""Partition of the demo by the true label maps of its ray tracer: how good, from how many views.

    python tools/decomposition/workshop.py --out docs/bench/partition.csv

Ten objects, pictures of 384x288.  Each row names the views that gave evidence (how many, at which
x) and the rule; mIoU is that of label pictures in 8 views that gave none, at the row's test x, and
least is the object with the lowest IoU.  "by place" labels each anchor by the nearest solid: what
no masks could better by much.  Rows of seconds are processor time of one run, the ratios within it.
"""

import argparse
import os
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from shapeshift.app.paths import DEMO  # noqa: E402
from shapeshift.decomposition.label_pictures import LabelPictures  # noqa: E402
from shapeshift.decomposition.partition import (  # noqa: E402
    LabelledView,
    gather_evidence,
    label_rows,
    partition,
)
from shapeshift.decomposition.score import mean_score, score_maps  # noqa: E402
from shapeshift.rasterizer.bin import bin_tiles  # noqa: E402
from shapeshift.rasterizer.device import Device, open_device  # noqa: E402
from shapeshift.rasterizer.evidence import Evidence  # noqa: E402
from shapeshift.rasterizer.project import Camera, project  # noqa: E402
from shapeshift.rasterizer.raster import rasterize_rgba  # noqa: E402
from shapeshift.runtime_models.evaluate import Evaluator  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel, ObjectLabel  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.training.synthetic.workshop import dome  # noqa: E402
from tools.synthetic.labels import OBJECTS, label_map, labels_of_places  # noqa: E402

SIZE = (384, 288)
NAMES = tuple(ObjectLabel(label, name) for label, name in enumerate(OBJECTS, 1))
COUNT = len(NAMES) + 1
SPEED_VIEWS, REPEATS = 6, 5
COLUMNS = "evidence,test_x,rule,miou,boundary_iou,accuracy,least,least_iou"


def true_views(count: int, offset: float, x: float) -> list[LabelledView]:
    return [LabelledView(view, x, label_map(view, x)) for view in dome(count, offset, SIZE)]


def quality(device: Device, model: AnchorModel, tests: list[LabelledView]) -> str:
    """The figures of one labelled model."""
    pictures = LabelPictures(device, model)
    pairs = [(pictures.label_map(t.view, t.x), t.labels) for t in tests]
    scores = score_maps(pairs, NAMES)
    worst = min(scores, key=lambda score: score.iou)
    means = [mean_score(scores, name) for name in ("iou", "boundary_iou", "accuracy")]
    return ",".join([*(f"{m:.4f}" for m in means), worst.object.name, f"{worst.iou:.4f}"])


def quality_rows(device: Device, model: AnchorModel) -> list[str]:
    closed, opened = true_views(48, 0.0, 0.0), true_views(24, 2 / 3, 1.0)
    tests = {0: true_views(8, 0.17, 0.0), 1: true_views(8, 2 / 3 + 0.17, 1.0)}
    given = {
        "48 at RGB": closed,
        "12 at RGB": closed[::4],
        "4 at RGB": closed[::12],
        "24 at Opened": opened,
        "48 at RGB + 24 at Opened": closed + opened,
    }
    rows = []
    for x, views in tests.items():
        labels = labels_of_places(model.anchors.astype(np.float64), x)[0]
        best = replace(model, labels=labels, objects=NAMES)
        rows.append(f"none,{x},by place,{quality(device, best, views)}")
        sys.stdout.write(rows[-1] + "\n")
    for name, views in given.items():
        sums = gather_evidence(device, model, views, COUNT)
        cut = partition(model, sums, NAMES)
        assert isinstance(cut, AnchorModel)
        for x in tests:
            rows.append(f"{name},{x},anchors at .4,{quality(device, cut, tests[x])}")
            sys.stdout.write(rows[-1] + "\n")
        if name == "48 at RGB":
            for share in (0.3, 0.5):
                other = replace(cut, labels=label_rows(sums, share).astype(np.uint8))
                row = quality(device, other, tests[0])
                rows.append(f"{name},0,anchors at {share:g} without neighbours,{row}")
                sys.stdout.write(rows[-1] + "\n")
    return rows


def speed_rows(device: Device, model: AnchorModel) -> list[str]:
    """Milliseconds a view of processor time: lists, evidence and drawing of the same lists."""
    views = true_views(SPEED_VIEWS, 0.0, 0.0)
    bands = np.array([0, 11, 12, 13, 14, 15], np.uint8)[np.arange(SIZE[0]) * 6 // SIZE[0]]
    sixteen = [np.where(v.labels > 0, v.labels, bands) for v in views]
    splats = [device.upload(a) for a in Evaluator(model).geometry(0.0)]
    splats.append(device.zeros((model.splat_count, 3)))
    evidence = Evidence(device, model.splat_count, 16, model.splats_per_anchor)

    def lists() -> list:
        shown = []
        for v in views:
            camera = Camera(*v.view.pinhole(), SIZE, v.view.near, v.view.widest_tangents())
            projected = project(device, *splats, camera=camera)
            shown.append((projected, bin_tiles(device, projected, SIZE)))
        return shown

    shown = lists()

    def weigh() -> None:
        for pair, labels in zip(shown, sixteen, strict=True):
            evidence.add(pair[0], pair[1], labels)

    def draw() -> None:
        for pair in shown:
            rasterize_rgba(device, pair[0], pair[1], SIZE)

    found = {}
    for name, work in (("lists", lists), ("evidence", weigh), ("draw", draw)):
        times = []
        for _ in range(REPEATS):
            began = time.process_time()
            work()
            device.queue.finish()
            times.append(time.process_time() - began)
        found[name] = 1e3 * min(times) / len(views)
    ratio = (found["lists"] + found["evidence"]) / (found["lists"] + found["draw"])
    told = ", ".join(f"{name} {ms:.1f}" for name, ms in found.items())
    return [
        f"# ms a view of processor time, 16 labels, {model.splat_count} splats: {told}; "
        f"a view of evidence takes {ratio:.2f} times one of drawing"
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    device, model = open_device("cpu"), read_model(DEMO)
    assert isinstance(model, AnchorModel)
    rows = quality_rows(device, model)
    speed = speed_rows(device, model)
    head = [
        f"# python tools/decomposition/workshop.py --out {options.out}",
        f"# {device.platform}; load average {os.getloadavg()[0]:.1f} at the end",
        *speed,
        COLUMNS,
    ]
    options.out.write_text("\n".join([*head, *rows]) + "\n")
    sys.stdout.write("\n".join(speed) + "\n")


if __name__ == "__main__":
    main()
