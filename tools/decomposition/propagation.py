"""Propagation on the demo: from one true mask an object, which candidates are taken.

    python tools/decomposition/propagation.py --out docs/bench/propagation.csv

The candidates are made from the ray tracer's truth, as promptable networks give them: the object,
two fifths of it, it with its neighbour, another object, it swollen by 14 pixels; each with a
confidence that says nothing (.7 to .97).  In a fifth of the views the right one is not offered.
right: the mask that was taken has an IoU of .75 or more; confidence: how many would be right by
that alone.  Limits "absolute" are those that do not look at what the user's own mask scores (F .7,
area 2/3 to 1.5).  mIoU is that of label pictures in 8 other views after partition.
"""

import argparse
import os
import sys
import time
from pathlib import Path
from unittest.mock import patch

import numpy as np
from scipy import ndimage

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from shapeshift.app.paths import DEMO  # noqa: E402
from shapeshift.decomposition import propagate as rules  # noqa: E402
from shapeshift.decomposition.label_pictures import LabelPictures  # noqa: E402
from shapeshift.decomposition.masks.segmenter import Candidate  # noqa: E402
from shapeshift.decomposition.partition import (  # noqa: E402
    LabelledView,
    gather_evidence,
    partition,
)
from shapeshift.decomposition.propagate import Judged, Support, merge, propagate  # noqa: E402
from shapeshift.decomposition.score import mean_score, score_maps  # noqa: E402
from shapeshift.decomposition.shown import ShownAnchors  # noqa: E402
from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel, ObjectLabel  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.scene.pose import View  # noqa: E402
from shapeshift.training.synthetic.workshop import dome  # noqa: E402
from tools.synthetic.labels import LABELS, OBJECTS, label_map  # noqa: E402

SIZE = (384, 288)
VIEWS, OF, TESTS = 16, 48, 8
SEEDS = (0, 1, 2)  # also the first of the views, of which every third is taken
LEAST_PIXELS = 40  # of an object that a view must show for it to be asked
RIGHT = 0.75  # IoU
TRAP = 0.2  # share of the views without the right candidate
NAMES = tuple(ObjectLabel(LABELS[name], name) for name in OBJECTS)
COLUMNS = "seed,limits,asked,not_offered,right,wrong,rejected,confidence,miou,miou_not_silent,cpu_s"
Maps = list[np.ndarray]


def candidates_of(
    here: np.ndarray, label: int, rng: np.random.Generator, right: bool
) -> list[Candidate]:
    mask = here == label
    masks = [ndimage.binary_closing(mask)] if right else []
    rows, columns = np.nonzero(mask)
    along = columns if np.ptp(columns) > np.ptp(rows) else rows
    low = along < np.quantile(along, 0.4)
    part = np.zeros_like(mask)
    part[rows[low], columns[low]] = True
    masks.append(part)
    ring = ndimage.binary_dilation(mask, iterations=4) & ~mask
    near = np.bincount(here[ring], minlength=len(LABELS))
    near[[0, label]] = 0
    if near.any():
        masks.append(mask | (here == near.argmax()))
    others = [other for other in np.unique(here) if other not in (0, label)]
    if others:
        masks.append(here == rng.choice(others))
    masks.append(ndimage.binary_dilation(mask, iterations=14))
    return [
        Candidate(m, float(s))
        for m, s in zip(masks, rng.uniform(0.7, 0.97, len(masks)), strict=True)
    ]


def iou(one: np.ndarray, other: np.ndarray) -> float:
    return float((one & other).sum() / max((one | other).sum(), 1))


def is_accepted_absolutely(judged: Judged, own: Judged) -> bool:
    """The limits that lost."""
    return judged.f >= 0.7 and 2 / 3 < judged.area < 1.5


class Trial:
    """One seed: every object is propagated over the views."""

    def __init__(self, shown: ShownAnchors, views: list[View], maps: Maps, seed: int) -> None:
        self.shown, self.views, self.maps = shown, views, maps
        self.rng = np.random.default_rng(3 + 8 * seed)
        self.eyes = np.array([view.world_from_eye.position for view in views])
        self.asked = self.traps = self.right = self.wrong = self.rejected = self.sure = 0
        self.found: list[dict] = [{} for _ in views]  # decisions by label
        self.supports: dict[int, Support] = {}

    def run(self, label: int) -> None:
        sizes = [int((labels == label).sum()) for labels in self.maps]
        first, support = int(np.argmax(sizes)), Support.none(self.shown.count)
        self.supports[label] = support
        offered: dict[int, list[Candidate]] = {}

        def ask(view: int, _: Support) -> list[Candidate]:
            if sizes[view] < LEAST_PIXELS:
                return []
            trap = self.rng.random() < TRAP
            offered[view] = candidates_of(self.maps[view], label, self.rng, not trap)
            self.traps += trap
            return offered[view]

        given = {first: self.maps[first] == label}
        for decision in propagate(support, given, self.eyes, self.shown_in, ask):
            view = decision.view
            self.found[view][label] = decision
            if view not in offered:
                continue
            true = self.maps[view] == label
            surest = max(offered[view], key=lambda candidate: candidate.score)
            self.asked += 1
            self.sure += iou(surest.mask, true) >= RIGHT
            if decision.mask is None:
                self.rejected += 1
            elif iou(decision.mask, true) >= RIGHT:
                self.right += 1
            else:
                self.wrong += 1

    def shown_in(self, view: int, masks: list[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
        return self.shown.masks(self.views[view], 0.0, masks)

    def label_maps(self, silent: bool) -> Maps:
        """With, or without, pixels that say nothing."""
        out = []
        for view, here in zip(self.views, self.found, strict=True):
            hidden = {}
            for label, decision in here.items():
                if silent and decision.mask is None:
                    values = np.zeros((self.shown.count, 3))
                    values[:, 0] = np.maximum(self.supports[label].belief(), 0)
                    hidden[label] = self.shown.picture(view, 0.0, values)[..., 0]
            width, height = view.size
            out.append(merge(here, (height, width), hidden))
        return out


def miou_after(shown: ShownAnchors, views: list[View], maps: Maps, tests: list) -> float:
    pictures = [LabelledView(view, 0.0, labels) for view, labels in zip(views, maps, strict=True)]
    sums = gather_evidence(shown.device, shown.model, pictures, len(LABELS))
    cut = LabelPictures(shown.device, partition(shown.model, sums, NAMES))
    pairs = [(cut.label_map(view, 0.0), true) for view, true in tests]
    return mean_score(score_maps(pairs, NAMES))


def row_of(shown: ShownAnchors, seed: int, limits: str, every: list, tests: list) -> str:
    views, maps = (list(part) for part in zip(*every[seed :: OF // VIEWS][:VIEWS], strict=True))
    trial, began = Trial(shown, views, maps, seed), time.process_time()
    accept = rules.is_accepted if limits == "relative" else is_accepted_absolutely
    with patch.object(rules, "is_accepted", accept):
        for each in NAMES:
            trial.run(each.label)
    spent = time.process_time() - began
    figures = [
        miou_after(shown, views, trial.label_maps(silent), tests) for silent in (True, False)
    ]
    counts = (trial.asked, trial.traps, trial.right, trial.wrong, trial.rejected, trial.sure)
    return ",".join(
        [str(seed), limits, *map(str, counts), *(f"{f:.4f}" for f in figures), f"{spent:.1f}"]
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    model = read_model(DEMO)
    assert isinstance(model, AnchorModel)
    shown = ShownAnchors(open_device("cpu"), model)
    every = [(view, label_map(view)) for view in dome(OF, 0.0, SIZE)]
    tests = [(view, label_map(view)) for view in dome(TESTS, 0.17, SIZE)]
    rows = []
    for limits in ("relative", "absolute"):
        for seed in SEEDS:
            rows.append(row_of(shown, seed, limits, every, tests))
            sys.stdout.write(rows[-1] + "\n")
    head = [
        f"# python tools/decomposition/propagation.py --out {options.out}",
        f"# {open_device('cpu').platform}; load average {os.getloadavg()[0]:.1f} at the end",
        COLUMNS,
    ]
    options.out.write_text("\n".join([*head, *rows]) + "\n")


if __name__ == "__main__":
    main()
