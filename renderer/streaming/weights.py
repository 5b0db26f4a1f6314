"""In how many pixels each leaf is seen, from the last look; and when the next look is due."""

import math
from collections.abc import Sequence

import numpy as np

from shapeshift.renderer.streaming.seen import CoarseLook
from shapeshift.renderer.streaming.sight import LeafSight
from shapeshift.scene.pose import View

FLOOR = 4.0  # pixels: of a leaf that is in the picture, but hidden
TURNED = math.radians(3)  # after which the last look is stale
NEARER = 0.03  # of the distance of what is seen: the same
FADING = 0.7  # of what a leaf showed to the look before, it still counts
PATIENCE = 15  # frames between looks where objects move and the eye rests


class Weights:
    """Pixels of leaves, looked at anew as the eye moves."""

    def __init__(self, leaves: int, look: CoarseLook | None) -> None:
        self.pixels = np.zeros(leaves)
        self._look = look
        self.looks, self.looked = 0, False  # in this frame
        self._looked: list[View] = []
        self._known = np.zeros(leaves, bool)  # what the last look held
        self._distance = math.inf  # metres: of half of what it saw
        self._poses: bytes = b""
        self._age = 0  # frames

    def of(
        self, sight: LeafSight, views: Sequence[View], poses: np.ndarray,
        shown: Sequence[bool], fresh: bool,
    ) -> np.ndarray:  # fmt: skip
        """(L,) pixels, 0 of what is in no picture.  fresh: a look of these views and nothing else.

        What the look did not hold counts what its box covers, less what was hidden elsewhere.
        """
        if self._look is None:
            return np.where(sight.held, np.maximum(sight.cover, FLOOR), 0.0)
        if fresh or self._is_stale(views, poses):
            self._look_again(sight, views, poses, shown, fresh)
        self.looked = self._age == 0
        self._age += 1
        pixels = np.where(self._known, self.pixels, self.guessed(sight))
        return np.where(sight.held, np.maximum(pixels, FLOOR), 0.0)

    def guessed(self, sight: LeafSight) -> np.ndarray:
        """(L,) pixels by what boxes cover, less what was hidden where a look was had."""
        both = self._known & sight.held
        seen, cover = self.pixels[both].sum(), sight.cover[both].sum()
        part = min(seen / cover, 1.0) if 0 < seen and 0 < cover else 1.0
        return np.maximum(part * sight.cover, FLOOR)

    def _is_stale(self, views: Sequence[View], poses: np.ndarray) -> bool:
        if len(views) != len(self._looked) or not self._looked:
            return True
        for now, before in zip(views, self._looked, strict=True):
            if (now.tangents, now.size) != (before.tangents, before.size):
                return True
            turned = abs(float(now.world_from_eye.wxyz @ before.world_from_eye.wxyz))
            if not 2 * math.acos(min(turned, 1.0)) <= TURNED:
                return True
            moved = now.world_from_eye.position - before.world_from_eye.position
            if not float(np.linalg.norm(moved)) <= NEARER * self._distance:
                return True
        return self._poses != bytes_of(poses) and self._age >= PATIENCE

    def _look_again(
        self, sight: LeafSight, views: Sequence[View], poses: np.ndarray,
        shown: Sequence[bool], fresh: bool,
    ) -> None:  # fmt: skip
        assert self._look is not None
        hidden = np.full((4, 4), np.nan)
        placed = [pose if there else hidden for pose, there in zip(poses, shown, strict=True)]
        pixels = self._look.pixels(views, placed, len(self.pixels))
        before = 0.0 if fresh else FADING * self.pixels
        self.pixels = np.maximum(pixels, before)
        self._known = sight.wide & (np.arange(len(pixels)) < self._look.leaves)
        self._distance = median_of(sight.distance, pixels)
        self._looked, self._poses, self._age = list(views), bytes_of(poses), 0
        self.looks += 1


def median_of(values: np.ndarray, weight: np.ndarray) -> float:
    """The weighted median; infinite where nothing has a weight."""
    if not weight.sum() > 0:
        return math.inf
    order = np.argsort(values)
    part = np.cumsum(weight[order])
    return float(values[order[int(np.searchsorted(part, part[-1] / 2))]])


def bytes_of(poses: np.ndarray) -> bytes:
    return np.asarray(poses, np.float64).tobytes()
