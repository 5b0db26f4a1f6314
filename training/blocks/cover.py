"""Which photos belong to which block, which of their pixels show it, and what else these show.

A photo's weight is what its picture of the coarse run is made of: alpha times transmittance of
every anchor's splats, summed over the pixels.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.project import project
from shapeshift.rasterizer.raster import rasterize, rasterize_backward
from shapeshift.runtime_models.stop import ControlEncoding, Stop
from shapeshift.scene.captures.capture import Photo
from shapeshift.training.drawing import DrawnView
from shapeshift.training.heads.networks import HeadLayout
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.photos import BLACK
from shapeshift.training.step import TrainingStep

LEAST_SHARE = 0.05  # of a photo's weight that lies in a block that it belongs to
SHOWS = 0.1  # of a pixel is the block's: it counts in the block's run, with those beside it ...
BESIDE_PX = 3  # ... up to so many pixels away
LEFT_OUT = 0.03  # of the weight of a block's pixels: that of the anchors that its run does without
CHANNELS = 3  # blocks that one picture tells apart
Progress = Callable[[int, int], None]  # photos done, of all


@dataclass(frozen=True)
class Seen:
    """A photo that belongs to a block."""

    photo: int
    pixels: np.ndarray  # (H, W) bool: those that count


@dataclass(frozen=True)
class Cover:
    """What one block learns from."""

    photos: tuple[Seen, ...]  # rising
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
        self.step = TrainingStep(device, layout, voxel, Adam(device, values, rates))
        self.control = {stop.name: encoding.encode(stop.x) for stop in stops}

    def draw(self, photo: Photo, factor: int) -> DrawnView:
        """A photo as large as it is trained."""
        return self.step.draw(photo.view.divided(factor), self.control[photo.modality], BLACK)

    def weights(self, drawn: DrawnView, pixels: np.ndarray | None = None) -> np.ndarray:
        """(A,) what each anchor gives to a picture, in pixels; pixels (H, W): of these alone."""
        device, size = self.device, drawn.camera.size
        asked = np.ones(size[::-1]) if pixels is None else pixels
        nothing, error = device.zeros((3, *size[::-1])), device.upload(asked.astype(np.float32))
        record = rasterize_backward(
            device, drawn.projected, drawn.tiles, drawn.frame, nothing, absolute=False, error=error
        )
        return device.download(record)[:, 9].reshape(-1, self.splats).sum(1, dtype=np.float64)

    def shares(self, drawn: DrawnView, block: np.ndarray, wanted: Sequence[int]) -> np.ndarray:
        """(len(wanted), H, W) how much of each pixel is of which block; block (A,) of anchors."""
        device, camera = self.device, drawn.camera
        of_splats, found = np.repeat(block, self.splats), []
        for first in range(0, len(wanted), CHANNELS):
            some = wanted[first : first + CHANNELS]
            color = np.zeros((len(of_splats), CHANNELS), np.float32)
            for channel, number in enumerate(some):
                color[:, channel] = of_splats == number
            fields = (*drawn.splats.fields()[:4], device.upload(color))
            projected = project(device, *fields, camera)
            tiles = bin_tiles(device, projected, camera.size)
            frame = rasterize(device, projected, tiles, camera.size, BLACK)
            found.append(device.download(frame.image)[: len(some)])
        return np.concatenate(found)


def cover_of(
    picture: CoarsePicture, photos: Sequence[Photo], factor: int, block: np.ndarray, count: int,
    report: Progress | None = None,
) -> tuple[Cover, ...]:  # fmt: skip
    """Of each of `count` blocks; block: (A,) of which block each anchor is, -1 of none."""
    inside = block >= 0
    sums = np.zeros((count, len(block)))
    mine: list[list[Seen]] = [[] for _ in range(count)]
    for i, photo in enumerate(photos):
        if report is not None:
            report(i, len(photos))
        drawn = picture.draw(photo, factor)
        weights = picture.weights(drawn)
        of_blocks = np.bincount(block[inside], weights[inside], minlength=count)
        belongs = (of_blocks >= LEAST_SHARE * weights.sum()) & (of_blocks > 0)
        wanted = np.flatnonzero(belongs).tolist()
        if not wanted:
            continue
        shares = picture.shares(drawn, block, wanted)
        for number, share in zip(wanted, shares, strict=True):
            pixels = widened(share >= SHOWS, BESIDE_PX)
            if pixels.any():
                mine[number].append(Seen(i, pixels))
                sums[number] += picture.weights(drawn, pixels)
    return tuple(
        Cover(tuple(mine[b]), context_of(sums[b], block == b)) for b in range(count)
    )  # fmt: skip


def widened(pixels: np.ndarray, by: int) -> np.ndarray:
    """(H, W) bool: those and the ones up to `by` rows and columns away."""
    from scipy.ndimage import maximum_filter

    return np.asarray(maximum_filter(pixels, 2 * by + 1, mode="constant"))


def context_of(weights: np.ndarray, own: np.ndarray) -> np.ndarray:
    """(A,) bool: anchors outside, without those that together give LEFT_OUT of the weight (A,)."""
    outside = np.where(own, 0.0, weights)
    order = np.argsort(outside, kind="stable")
    left_out = np.cumsum(outside[order]) <= LEFT_OUT * weights.sum()
    shown = np.zeros(len(weights), bool)
    shown[order[~left_out]] = True
    return shown & ~own
