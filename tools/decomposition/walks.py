"""Objects of the demo without a network: walks over pixels and anchors, from one photo an object.

    python tools/decomposition/walks.py --out docs/bench/masks.csv

Each row is what a person gives in the one of 16 views that shows most of the object, and what comes
of it: the mask's IoU there, the IoU of the object in 8 other views (those that show 40 of its
pixels), and the seconds of processor time of the walks.  "true mask" stands for what a network
would give.  "height" is how high what a pixel shows stands above the plane around the box, out of
the scene; "15 more masks" makes masks of the other views in the same way, prompted by
the walk and judged as a segmenter's are: it lost.
"""

import argparse
import os
import sys
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from shapeshift.app.paths import DEMO  # noqa: E402
from shapeshift.decomposition.label_photos import prompts_of  # noqa: E402
from shapeshift.decomposition.label_pictures import LabelPictures  # noqa: E402
from shapeshift.decomposition.masks.anchor_walk import (  # noqa: E402
    AnchorGraph,
    make_graph,
    nodes_of,
    seeds_of_evidence,
)
from shapeshift.decomposition.masks.pixel_walk import PixelWalk, walk_together  # noqa: E402
from shapeshift.decomposition.masks.segmenter import Candidate, Prompt  # noqa: E402
from shapeshift.decomposition.propagate import Support, propagate  # noqa: E402
from shapeshift.decomposition.shown import ShownAnchors  # noqa: E402
from shapeshift.decomposition.walk_objects import heights_of, places_of, ways_of  # noqa: E402
from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.training.synthetic.workshop import dome  # noqa: E402
from tools.synthetic.labels import LABELS, OBJECTS, label_map  # noqa: E402

SIZE = (384, 288)
VIEWS, TESTS = 16, 8
THERMAL = 0.5  # x of that stop
EYE = (0.0, 0.6, 1.8)  # metres: from where colours of anchors are taken
MARGIN = 3  # pixels of a person's box around the object
LEAST_PIXELS = 40
GIVEN = ("true mask", "box", "box, heat", "box, heat, height", "box, heat, height, 15 more masks")
COLUMNS = "given,object,mask_iou,object_iou,cpu_s"


def iou(one: np.ndarray, other: np.ndarray) -> float:
    return float((one & other).sum() / max((one | other).sum(), 1))


class Bench:
    """The demo, its pictures and its truth."""

    def __init__(self) -> None:
        model = read_model(DEMO)
        assert isinstance(model, AnchorModel)
        self.model = model
        self.shown = ShownAnchors(open_device("cpu"), self.model)
        self.views = dome(VIEWS, 0.0, SIZE)
        self.maps = [label_map(view) for view in self.views]
        self.tests = [(view, label_map(view)) for view in dome(TESTS, 0.17, SIZE)]
        self.images = [np.concatenate([self.look(v, 0.0), self.look(v, THERMAL)[..., :1]], 2)
                       for v in self.views]  # fmt: skip
        self.eyes = np.array([view.world_from_eye.position for view in self.views])
        began = time.process_time()
        self.nodes = nodes_of(self.model, np.array(EYE, np.float32))
        self.graph: AnchorGraph = make_graph(self.nodes, self.eyes)
        self.graph_s = time.process_time() - began

    def look(self, view, x: float) -> np.ndarray:
        return np.rint(255 * np.clip(self.shown.look(view, x), 0, 1)).astype(np.uint8)

    def shown_in(self, view: int, masks: list[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
        return self.shown.masks(self.views[view], 0.0, masks)

    def walk(self, support: Support) -> np.ndarray:
        return self.graph.walk(seeds_of_evidence(support.inside, support.outside))

    def ask(self, view: int, support: Support) -> list[Candidate]:
        values = np.repeat(self.walk(support)[:, None], 3, axis=1)
        share = self.shown.picture(self.views[view], 0.0, values)[..., 0]
        return [c for p in prompts_of(share) for c in PixelWalk().candidates(self.images[view], p)]

    def object_iou(self, part: np.ndarray, label: int) -> float:
        """part: (A,) 1 where an anchor is the object's."""
        pictures = LabelPictures(self.shown.device, self.model, np.repeat(part, self.shown.each))
        found = [
            iou(pictures.label_map(view, 0.0) == 1, true == label)
            for view, true in self.tests
            if (true == label).sum() >= LEAST_PIXELS
        ]
        return float(np.mean(found))

    def row(self, given: str, name: str) -> tuple[float, float, float]:
        """The mask's IoU, the object's, and seconds."""
        label = LABELS[name]
        first = int(np.argmax([(labels == label).sum() for labels in self.maps]))
        true = self.maps[first] == label
        began = time.process_time()
        mask = true
        if given != "true mask":
            rows, columns = np.nonzero(true)
            box = (columns.min() - MARGIN, rows.min() - MARGIN, columns.max() + 1 + MARGIN,
                   rows.max() + 1 + MARGIN)  # fmt: skip
            image = self.images[first][..., : 3 if given == "box" else 4]
            prompt, heights, ways = Prompt(box), None, None
            if "height" in given:
                places = places_of(self.shown, self.views[first], 0.0, self.nodes)
                heights = heights_of(places, self.views[first], [prompt], self.nodes)
                ways = ways_of(places, self.views[first])
            (found,) = walk_together(image, [prompt], heights, ways)
            assert found is not None, "it has a box"
            mask = found.mask
        support = Support.none(self.shown.count)
        eyes = self.eyes if "more" in given else self.eyes[: first + 1]
        steps = propagate(support, {first: mask}, eyes, self.shown_in, self.ask)
        for _ in steps if "more" in given else [next(steps)]:
            pass
        part = self.walk(support)
        spent = time.process_time() - began
        return iou(mask, true), self.object_iou(part, label), spent


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    bench, rows = Bench(), []
    for given in GIVEN:
        figures = np.array([bench.row(given, name) for name in OBJECTS])
        for name, each in zip((*OBJECTS, "mean"), [*figures, figures.mean(0)], strict=True):
            cells = (f"{n:.3f}" for n in each)
            rows.append(",".join([f'"{given}"', name, *cells]))
        sys.stdout.write(rows[-1] + "\n")
    head = [
        f"# python tools/decomposition/walks.py --out {options.out}",
        f"# {open_device('cpu').platform}; load average {os.getloadavg()[0]:.1f} at the end",
        f"# the graph of {len(bench.nodes.rows):,} anchors took {bench.graph_s:.2f} s of processor "
        "time",
        COLUMNS,
    ]
    options.out.write_text("\n".join([*head, *rows]) + "\n")


if __name__ == "__main__":
    main()
