"""What a click or a box in the viewer takes, on the demo, whose truth its ray tracer knows.

    python tools/decomposition/clicks.py --out docs/bench/clicks.csv

"click": 15 anchors of each object, one at a time, through anchor_click.grow; "box": a box two
pixels looser than the object in each of the three of 48 views that show most of it, through the
tool's own Finder.  Figures are means: the IoU of the anchors that are taken with the true ones (of
anchors that show something), the best IoU that the wheel reaches, and seconds of processor time.
"""

import argparse
import os
import sys
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from shapeshift.app.editor.state.parts.finder import Finder, Query  # noqa: E402
from shapeshift.app.paths import DEMO  # noqa: E402
from shapeshift.decomposition.masks.anchor_click import Growth, grow  # noqa: E402
from shapeshift.decomposition.masks.anchor_walk import make_graph, nodes_of  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.scene.scene import Scene, SceneObject  # noqa: E402
from shapeshift.training.synthetic.workshop import dome  # noqa: E402
from tools.synthetic.labels import (  # noqa: E402
    LABELS,
    OBJECTS,
    label_map,
    labels_of_places,
)

SIZE, VIEWS, BOXES, CLICKS = (384, 288), 48, 3, 15
EYE = np.array([[0.0, 0.6, 1.8]])  # metres: where somebody looks from who has no cameras of it
LOOSE = 2.0  # pixels
COLUMNS = "given,object,iou,best_iou,cpu_s"


def scores(growth: Growth, mine: np.ndarray) -> tuple[float, float]:
    """IoU of the set that is taken, and of the best of the nested sets; mine (N,) bool."""
    hits = np.cumsum(mine[growth.nodes])
    every = hits / (np.arange(1, len(hits) + 1) + mine.sum() - hits)
    return float(every[growth.count - 1]), float(every.max())


class Bench:
    """The demo and its truth."""

    def __init__(self) -> None:
        self.model = read_model(DEMO)
        self.scene = Scene((SceneObject("demo", self.model),))
        self.graph = make_graph(nodes_of(self.model, EYE[0]), EYE)
        self.true = labels_of_places(self.graph.nodes.means)[0]
        self.views = dome(VIEWS, 0.0, SIZE)
        self.maps = [label_map(view) for view in self.views]
        self.finder = Finder(eyes=[EYE[0]])
        self.rng = np.random.default_rng(0)

    def growths(self, given: str, label: int) -> list[Growth]:
        if given == "click":
            seeds = self.rng.choice(np.flatnonzero(self.true == label), CLICKS)
            return [grow(self.graph, np.array([seed]), np.array([], int)) for seed in seeds]
        sizes = [(shown == label).sum() for shown in self.maps]
        out = []
        for view in np.argsort(sizes)[::-1][:BOXES]:
            rows, columns = np.nonzero(self.maps[view] == label)
            corners = (columns.min() - LOOSE, rows.min() - LOOSE,
                       columns.max() + 1 + LOOSE, rows.max() + 1 + LOOSE)  # fmt: skip
            found = self.finder.find(Query(self.scene, self.views[view], corners))
            assert found is not None, "there is an object in its box"
            out.append(found.growth)
        return out

    def row(self, given: str, name: str) -> np.ndarray:
        """IoU, best IoU, seconds of one."""
        label, began = LABELS[name], time.process_time()
        growths = self.growths(given, label)
        spent = (time.process_time() - began) / len(growths)
        figures = [scores(growth, self.true == label) for growth in growths]
        return np.array([*np.mean(figures, axis=0), spent])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    bench, rows = Bench(), []
    bench.finder.find(Query(bench.scene, bench.views[0], (192, 144, 192, 144)))  # makes its graph
    for given in ("click", "box"):
        figures = np.array([bench.row(given, name) for name in OBJECTS])
        for name, each in zip((*OBJECTS, "mean"), [*figures, figures.mean(0)], strict=True):
            rows.append(f"{given},{name}," + ",".join(f"{number:.3f}" for number in each))
        sys.stdout.write(rows[-1] + "\n")
    head = [
        f"# python tools/decomposition/clicks.py --out {options.out}",
        f"# {len(bench.graph.nodes.rows):,} anchors; load average {os.getloadavg()[0]:.1f}",
        COLUMNS,
    ]
    options.out.write_text("\n".join([*head, *rows]) + "\n")


if __name__ == "__main__":
    main()
