"""What a model shows between its stops, where no photo says how it should look."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shapeshift.runtime_models.stop_weights import StopBlend, encode_control
from shapeshift.scene.pose import View
from shapeshift.training.drawing import Color
from shapeshift.training.evaluation.evaluate import Painter
from shapeshift.training.evaluation.metrics import psnr

COVERED = 1 / 255  # of a pixel, from where on it is not empty
ALIKE = 1e-4  # mean difference below which two stops are the same picture
Draw = Callable[[View, float], tuple[np.ndarray, np.ndarray]]  # (H, W, 3) and coverage (H, W) at x


@dataclass(frozen=True)
class Midpoints:
    """One way between two stops: each figure is its mean over the views at the worst x.

    A blend of both ends, pixel by pixel, has 0, 0, 100, 1 and 1.
    """

    low: float  # x of the stops
    high: float
    apart: float  # mean |difference| of the ends
    flash: float  # mean over the pixels of how far they lie outside of both ends' range
    emptied: float  # the part of what both ends cover that is bare
    blend_db: float  # PSNR against the blend of the ends
    jump: float  # the largest step of x over an even one
    around: float  # |picture - first end| + |picture - last end|, over `apart`


@dataclass(frozen=True)
class Frequencies:
    """The paper's counter-example to Psi: sines and cosines of x in octaves.

    It stands where a ControlEncoding does while training; packages cannot hold it.
    """

    d: int = 16

    def encode(self, x: float) -> np.ndarray:
        """(d,) float32."""
        angle = np.pi * x * 2.0 ** np.arange((self.d + 1) // 2)
        both = np.stack([np.sin(angle), np.cos(angle)], axis=1).ravel()
        return both[: self.d].astype(np.float32)


def between(draw: Draw, views: list[View], low: float, high: float, steps: int) -> Midpoints:
    """The way from stop to stop in so many steps of x."""
    xs = np.linspace(low, high, steps + 1)
    figures = []  # a row a view and x: flash, emptied, blend_db, around
    moves, apart = [], []
    for view in views:
        images, covers = zip(*(draw(view, float(x)) for x in xs), strict=True)
        first, last = images[0], images[-1]
        apart.append(distance(first, last))
        least, most = np.minimum(first, last), np.maximum(first, last)
        filled = np.minimum(covers[0], covers[-1])
        moves.append([distance(a, b) for a, b in pairwise(images)])
        for share, image, cover in zip(np.linspace(0, 1, len(xs)), images, covers, strict=True):
            outside = np.maximum(image - most, 0) + np.maximum(least - image, 0)
            bare = np.maximum(filled - cover, 0).sum() / max(filled.sum(), COVERED)
            blend = (1 - share) * first + share * last
            figures.append(
                (outside.mean(), bare, psnr(image, blend), distance(image, first)
                 + distance(image, last))
            )  # fmt: skip
    rows = np.array(figures, np.float64).reshape(len(views), len(xs), 4)[:, 1:-1]
    flash, emptied, blend_db, around = rows.mean(axis=0).T  # of every x
    even = max(float(np.mean(apart)), ALIKE)
    return Midpoints(
        low, high, float(np.mean(apart)), float(flash.max()), float(emptied.max()),
        float(blend_db.min()), float(np.mean(moves, axis=0).max()) * steps / even,
        float(around.max()) / even,
    )  # fmt: skip


def distance(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(a - b).mean(dtype=np.float64))


def draw_of(painter: Painter, background: Color) -> Draw:
    """Pictures of a model as its package holds it."""

    def draw(view: View, x: float) -> tuple[np.ndarray, np.ndarray]:
        painter.set_control(x)
        return pictures(painter.device, painter.draw(view, background)[2])

    return draw


def draw_in_training(trainer, background: Color, direct: bool = False) -> Draw:
    """Pictures of what a Trainer holds, whatever its encoding is.

    direct: x goes into the encoding as it is, as a reader does that knows of no blends of stops.
    """
    blend = StopBlend(trainer.stops, direct=direct)

    def draw(view: View, x: float) -> tuple[np.ndarray, np.ndarray]:
        psi = encode_control(trainer.encoding, blend, x)[0]
        drawing = trainer.step.draw(view, psi, background)
        return pictures(trainer.device, drawing.frame)

    return draw


def pictures(device, frame) -> tuple[np.ndarray, np.ndarray]:
    """((H, W, 3) colours, (H, W) coverage) of a frame, copies."""
    image = device.download(frame.image).transpose(1, 2, 0).copy()
    return image, 1 - device.download(frame.transmittance)
