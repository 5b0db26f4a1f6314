"""Small photos first: --coarse 4 starts at a quarter of their sides, then a half, then all."""

from dataclasses import dataclass, replace

import numpy as np

from shapeshift.scene.captures.depth_photo import at_centres
from shapeshift.scene.captures.photo import shrink
from shapeshift.training.photos import LoadedPhoto

LEAST_SIDE = 16  # pixels: a photo is not made smaller than that


def smaller(photo: LoadedPhoto, factor: int) -> LoadedPhoto:
    """The photo with its sides divided by `factor`: the mean colour of what each pixel covers."""
    width, height = photo.view.size
    size = (max(round(width / factor), 1), max(round(height / factor), 1))
    if factor == 1 or min(size) < LEAST_SIDE:
        return photo
    alpha = photo.rgba[..., 3:].astype(np.float32) / 255
    laid = shrink(np.concatenate([photo.rgba[..., :3] * alpha, alpha], axis=2), size)
    alpha = laid[..., 3:]
    rgb = laid[..., :3] / np.maximum(alpha, 1e-6)
    rgba = np.clip(np.rint(np.concatenate([rgb, 255 * alpha], axis=2)), 0, 255).astype(np.uint8)
    weight = photo.weight
    if weight is not None:
        weight = shrink(weight[..., None], size)[..., 0]
    depth = None if photo.depth is None else at_centres(photo.depth, size)
    view = photo.view.resized(size)
    return replace(photo, view=view, rgba=rgba, weight=weight, depth=depth)


@dataclass(frozen=True)
class Coarse:
    """Which size a photo has at a moment of the run; made once and kept."""

    first: int = 1  # a power of two: what the sides are divided by at the start
    until: float = 0.35  # of the run: all pixels count from then on
    made: dict[tuple, LoadedPhoto] | None = None

    def factor(self, fraction: float) -> int:
        """Every size gets an equal part of the run up to `until`."""
        halvings = self.first.bit_length() - 1
        if not halvings or fraction >= self.until:
            return 1
        return self.first >> int(fraction / self.until * halvings)

    @property
    def factors(self) -> list[int]:
        """All that a run goes through, the last one first: 1, 2, 4 ..."""
        return [1 << power for power in range(self.first.bit_length())]

    def photo(self, photo: LoadedPhoto, factor: int) -> LoadedPhoto:
        if factor == 1:
            return photo
        key = (photo.modality, photo.name, factor)
        if key not in self.made:
            self.made[key] = smaller(photo, factor)
        return self.made[key]

    def drop(self, factor: int) -> None:
        """Forget the photos that are smaller than this factor makes them: their time is over."""
        for key in [key for key in self.made if key[2] > factor]:
            del self.made[key]
