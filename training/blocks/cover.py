"""Which photos belong to which block, and which anchors outside of it they show.

A photo's weight is what its picture of the coarse run is made of: alpha times transmittance of
every anchor's splats, summed over the pixels.  All pixels of a photo count in a block's run: where
only those did that show the block, its splats grew into the others (docs/bench/ideas.md).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from shapeshift.rasterizer.raster import rasterize_backward
from shapeshift.runtime_models.stop import ControlEncoding, Stop
from shapeshift.scene.captures.capture import Photo
from shapeshift.training.heads.networks import HeadLayout
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.photos import BLACK
from shapeshift.training.step import TrainingStep

LEAST_SHARE = 0.05  # of a photo's weight that lies in a block that it belongs to
LEFT_OUT = 0.02  # of the weight of a block's photos: that of the anchors that its run does without
Progress = Callable[[int, int], None]  # photos done, of all


@dataclass(frozen=True)
class Cover:
    """What one block learns from."""

    photos: tuple[int, ...]  # rising
    context: np.ndarray  # (A,) bool: anchors outside that its run has


class CoarsePicture:
    """The state of a coarse run, drawn to be looked at."""

    def __init__(
        self, device, state: dict[str, np.ndarray], layout: HeadLayout, voxel: float,
        encoding: ControlEncoding, stops: Sequence[Stop],
    ) -> None:  # fmt: skip
        names = ("weights", *layout.per_anchor)
        values = {name: state[f"{name}.value"] for name in names}
        rates = dict.fromkeys(names, np.zeros(1, np.float32))
        self.device, self.splats = device, layout.splats
        self.control = {stop.name: encoding.encode(stop.x) for stop in stops}
        controls, adam = np.stack(list(self.control.values())), Adam(device, values, rates)
        self.step = TrainingStep(device, layout, voxel, adam, controls)

    def weights(self, photo: Photo, factor: int) -> np.ndarray:
        """(A,) pixels that each anchor gives to a photo, as large as it is trained."""
        view, device = photo.view.divided(factor), self.device
        drawn = self.step.draw(view, self.control[photo.modality], BLACK)
        nothing = device.zeros((3, *view.size[::-1]))
        record = rasterize_backward(
            device, drawn.projected, drawn.tiles, drawn.frame, nothing, absolute=False, weight=True
        )
        return device.download(record)[:, 11].reshape(-1, self.splats).sum(1, dtype=np.float64)


def cover_of(
    picture: CoarsePicture, photos: Sequence[Photo], factor: int, block: np.ndarray, count: int,
    report: Progress | None = None,
) -> tuple[Cover, ...]:  # fmt: skip
    """Of each of `count` blocks; block: (A,) of which block each anchor is, -1 of none."""
    inside = block >= 0
    sums = np.zeros((count, len(block)))
    mine: list[list[int]] = [[] for _ in range(count)]
    for i, photo in enumerate(photos):
        weights = picture.weights(photo, factor)
        of_blocks = np.bincount(block[inside], weights[inside], minlength=count)
        belongs = (of_blocks >= LEAST_SHARE * weights.sum()) & (of_blocks > 0)
        for number in np.flatnonzero(belongs).tolist():
            mine[number].append(i)
            sums[number] += weights
        if report is not None:
            report(i + 1, len(photos))
    shown = [context_of(sums[number], block == number) for number in range(count)]
    return tuple(Cover(tuple(each), rows) for each, rows in zip(mine, shown, strict=True))


def context_of(weights: np.ndarray, own: np.ndarray) -> np.ndarray:
    """(A,) bool: anchors outside, without those that together give LEFT_OUT of the weight (A,)."""
    outside = np.where(own, 0.0, weights)
    order = np.argsort(outside, kind="stable")
    left_out = np.cumsum(outside[order]) <= LEFT_OUT * weights.sum()
    shown = np.zeros(len(weights), bool)
    shown[order[~left_out]] = True
    return shown & ~own
