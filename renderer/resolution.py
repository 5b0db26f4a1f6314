"""Dynamic resolution: render_scale follows measured frame times, slowly enough not to swing.  And
images at another size."""

import math
from collections import deque
from statistics import median

import numpy as np

from shapeshift.scene.pose import View

STEP = 1 / 16  # scales are multiples of this, so that few sizes of images are ever made
SEEN = 8  # frames at one scale before it may change: their median hides a single slow frame
OVER, UNDER = 1.05, 0.85  # times the target: in between nothing changes
FAR_OVER = 1.15  # times the target: what lies below it may be noise, and is watched longer
WATCHED = 4 * SEEN  # frames: their median has half the noise
AIM = 0.95  # of the target, where a change wants to land
LONGEST_WAIT = 16 * SEEN  # frames, after growing has failed again and again


class Resolution:
    """Moves `scale` within [least, 1] so that frames take `target_ms`.

    Shrinks by what the median asks for, at the least one step, and where it is little over the
    target only after a longer look, so that noise does not make it swing; grows one step at a time,
    and only where the time would hold if it all grew with the pixels.  Growth that has to be taken
    back makes the next try wait twice as long.
    """

    def __init__(self, target_ms: float, least: float = 0.5, scale: float = 1.0) -> None:
        if not 0 < target_ms < math.inf:
            raise ValueError(f"target_ms is {target_ms}, expected a number of ms above 0.")
        if not 0 < least <= 1:
            raise ValueError(f"least is {least}, expected a scale above 0, at most 1.")
        self.target_ms = target_ms
        self.least = min(math.ceil(least / STEP) * STEP, 1.0)
        self.scale = self._rounded(scale)
        self._times: deque[float] = deque(maxlen=WATCHED)
        self._age = 0  # frames at this scale
        self._wait = SEEN  # frames before growing
        self._grew = False  # whether this scale was reached by growing

    def seen(self, frame_ms: float) -> float:
        """Takes the time of a frame that was drawn at `scale`; returns the scale of the next.

        Times that are no time (0, negative, NaN, infinite) are as if there had been no frame.
        """
        if not 0 < frame_ms < math.inf:
            return self.scale
        self._times.append(frame_ms)
        self._age += 1
        if self._age < SEEN:
            return self.scale
        ms, watched = median(list(self._times)[-SEEN:]), median(self._times)
        if ms > FAR_OVER * self.target_ms:
            self._shrink(ms)
        elif self._age >= WATCHED and min(ms, watched) > OVER * self.target_ms:
            self._shrink(watched)
        elif ms < UNDER * self.target_ms and self._age >= self._wait:
            self._grow(ms)
        elif self._grew and self._age > 2 * self._wait:
            self._wait, self._grew = SEEN, False  # it has lasted
        return self.scale

    def _shrink(self, ms: float) -> None:
        if self._grew:
            self._wait = min(2 * self._wait, LONGEST_WAIT)
        wanted = self.scale * math.sqrt(AIM * self.target_ms / ms)
        down = math.floor(wanted / STEP + 1e-9) * STEP
        self._move(max(min(down, self.scale - STEP), self.least), grew=False)

    def _grow(self, ms: float) -> None:
        larger = min(self.scale + STEP, 1.0)
        if ms * (larger / self.scale) ** 2 <= AIM * self.target_ms:
            self._move(larger, grew=True)

    def _move(self, scale: float, grew: bool) -> None:
        if scale != self.scale:
            self.scale, self._grew, self._age = scale, grew, 0
            self._times.clear()

    def _rounded(self, scale: float) -> float:
        return min(max(round(scale / STEP) * STEP, self.least), 1.0)


# The twin of GL's linear filter, for pictures that no GL has drawn.


def bilinear(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(H, W, C) float32 -> (height, width, C): between the centres of pixels, edges held."""
    width, height = size
    if image.shape[:2] == (height, width):
        return image
    for axis, wanted in ((0, height), (1, width)):
        have = image.shape[axis]
        at = np.clip((np.arange(wanted) + 0.5) * have / wanted - 0.5, 0, have - 1)
        low = np.minimum(at.astype(int), max(have - 2, 0))
        shape = [1, 1, 1]
        shape[axis] = wanted
        part = (at - low).astype(np.float32).reshape(shape)
        first, second = (
            np.take(image, low, axis),
            np.take(image, np.minimum(low + 1, have - 1), axis),
        )
        image = first + part * (second - first)
    return image


def scaled(view: View, part: float) -> View:
    """The view in `part` times its pixels a side, at least one."""
    width, height = (max(1, round(part * side)) for side in view.size)
    return view if part == 1 else view.resized((width, height))
