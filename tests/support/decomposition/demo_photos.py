"""Photos of the bundled demo, drawn from its model, with the true label maps of its ray tracer."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from PIL import Image

from shapeshift.app.paths import DEMO
from shapeshift.decomposition.masks.segmenter import Candidate, Prompt
from shapeshift.decomposition.shown import ShownAnchors
from shapeshift.rasterizer.device import open_device
from shapeshift.runtime_models.model import AnchorModel, Stop
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.scene.pose import View
from shapeshift.training.synthetic.workshop import dome
from tools.synthetic.labels import label_map

SIZE = (192, 144)
COUNT = 8


@cache
def demo() -> ShownAnchors:
    model = read_model(DEMO)
    assert isinstance(model, AnchorModel)
    return ShownAnchors(open_device("cpu"), model)


@cache
def true_maps() -> tuple[list[View], list[np.ndarray]]:
    """Views that stand far from each other, and what they show."""
    views = dome(COUNT, 0.0, SIZE)
    return views, [label_map(view) for view in views]


def write_demo_capture(folder: Path) -> Capture:
    """rgb/000.png and so on, with transforms.json."""
    (folder / "rgb").mkdir(parents=True)
    photos = []
    for i, view in enumerate(true_maps()[0]):
        path = folder / f"rgb/{i:03}.png"
        pixels = np.clip(demo().look(view, 0.0), 0, 1)
        Image.fromarray(np.rint(255 * pixels).astype(np.uint8)).save(path)
        photos.append(Photo(view, path, "RGB"))
    capture = Capture(folder, (Stop("RGB", 0.0),), tuple(photos))
    write_capture(capture)
    return capture


def box_of_object(view: int, label: int, margin: int = 2) -> tuple[float, float, float, float]:
    rows, columns = np.nonzero(true_maps()[1][view] == label)
    return (
        float(max(columns.min() - margin, 0)), float(max(rows.min() - margin, 0)),
        float(min(columns.max() + 1 + margin, SIZE[0])),
        float(min(rows.max() + 1 + margin, SIZE[1])),
    )  # fmt: skip


@dataclass
class TrueSegmenter:
    """Knows the true maps of the demo's photos: of a prompt's place it offers the object there, a
    part of it, and it with much around; surest of the wrong ones.  Counts what it is asked.
    """

    pixels: list[np.ndarray]  # of the photos
    name = "the truth"
    reads_text = False
    takes_boxes = True
    wants_click = False
    encoded = 0
    asked = 0

    def encode(self, image: np.ndarray) -> int:
        self.encoded += 1
        return next(i for i, one in enumerate(self.pixels) if np.array_equal(one, image))

    def candidates(self, encoded: int, prompt: Prompt) -> list[Candidate]:
        self.asked += 1
        labels = true_maps()[1][encoded]
        if prompt.box is not None:
            left, top, right, bottom = (int(n) for n in prompt.box)
            here = labels[top : bottom + 1, left : right + 1]
        else:
            here = labels[prompt.inside[:, 1].astype(int), prompt.inside[:, 0].astype(int)]
        counts = np.bincount(here[here > 0], minlength=1)
        if not counts.any():
            return []
        mask = labels == counts.argmax()
        part = mask.copy()
        part[:, int(np.median(np.nonzero(mask)[1])) :] = False
        wide = mask.copy()
        for _ in range(8):
            wide[1:] |= wide[:-1].copy()
            wide[:-1] |= wide[1:].copy()
            wide[:, 1:] |= wide[:, :-1].copy()
            wide[:, :-1] |= wide[:, 1:].copy()
        return [Candidate(part, 0.97), Candidate(wide, 0.95), Candidate(mask, 0.6)]
