"""A photo in the square that a segmenter looks at: padded (SAM) or stretched (SAM 2 and 3)."""

from dataclasses import dataclass

import numpy as np
from PIL import Image

BILINEAR = Image.Resampling.BILINEAR


@dataclass(frozen=True)
class Square:
    """A photo in a square of `side` pixels."""

    size: tuple[int, int]  # width, height of the photo, pixels
    side: int
    padded: bool  # the longer side fills the square; else both do

    @property
    def filled(self) -> tuple[int, int]:
        """Width and height of the photo within the square, pixels."""
        if not self.padded:
            return self.side, self.side
        width, height = self.size
        scale = self.side / max(width, height)
        return max(int(width * scale + 0.5), 1), max(int(height * scale + 0.5), 1)

    def shrink(self, image: np.ndarray) -> np.ndarray:
        """(h, w, 3) float32 0..255: the photo (H, W, 3) uint8 as it fills the square."""
        small = Image.fromarray(np.ascontiguousarray(image)).resize(self.filled, BILINEAR)
        return np.asarray(small, np.float32)

    def pad(self, pixels: np.ndarray) -> np.ndarray:
        """(1, 3, side, side): the shrunk photo (h, w, 3), zeros to its right and below it."""
        width, height = self.filled
        whole = np.pad(pixels, ((0, self.side - height), (0, self.side - width), (0, 0)))
        return np.ascontiguousarray(whole.transpose(2, 0, 1)[None])

    def places(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) float32 in the square of points (n, 2) of the photo."""
        scale = np.divide(self.filled, self.size)
        return (np.asarray(points, np.float64).reshape(-1, 2) * scale).astype(np.float32)

    def logits(self, mask: np.ndarray, side: int, most: float) -> np.ndarray:
        """(side, side) float32: a mask (H, W) as SAM's networks take one, -most to most."""
        width, height = (max(round(n * side / self.side), 1) for n in self.filled)
        small = Image.fromarray(mask.astype(np.float32)).resize((width, height), BILINEAR)
        out = np.full((side, side), -most, np.float32)
        out[:height, :width] = (2 * np.asarray(small) - 1) * most
        return out

    def stretch(self, logits: np.ndarray) -> np.ndarray:
        """(H, W) float32 of a square's logits (s, s): the photo's part of it, in its size."""
        rows, columns = logits.shape
        width, height = self.filled
        part = (0, 0, columns * width / self.side, rows * height / self.side)
        image = Image.fromarray(np.ascontiguousarray(logits, np.float32))
        return np.asarray(image.resize(self.size, BILINEAR, part))
