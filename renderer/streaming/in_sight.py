"""In how many pixels each leaf is seen, from the last look; and when the next look is due."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.rasterizer.bin import bin_tiles, sort_order
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.evidence import Evidence
from shapeshift.rasterizer.pack import pack
from shapeshift.rasterizer.project_arena import Limits, SortFrames, project_arena
from shapeshift.renderer.tiles.inputs import camera_of
from shapeshift.runtime_models.leaf_levels import LeafLevels
from shapeshift.runtime_models.model import SplatLayers, is_antialiased
from shapeshift.scene.pose import Pose, View

# Which leaves a view holds, how much of the picture each covers, how far away it is.

WIDER = math.radians(10)  # on each side: what comes into sight next
TAIL = 0.15  # of a box's half sides: splats may reach out of the box of their leaf
BLUR = 0.02  # tangent: and out of the picture's edge
WIDEST = math.radians(80)  # from straight on; wider pictures have no tangents


@dataclass(frozen=True)
class LeafSight:
    """Of leaves."""

    held: np.ndarray  # (L,) bool: a view may show it
    wide: np.ndarray  # (L,) bool: so may a view WIDER on each side
    cover: np.ndarray  # (L,) pixels that its box covers, if nothing hides it
    distance: np.ndarray  # (L,) metres from the eye to its box


def sight_of(
    levels: LeafLevels, world_from_objects: np.ndarray, views: Sequence[View]
) -> LeafSight:
    """In any of the views, of n copies one after the other; world_from_objects (n, 4, 4), rigid."""
    middle, half = (levels.high + levels.low) / 2, (levels.high - levels.low) / 2
    shape = (len(world_from_objects), len(middle))
    held, wide = np.zeros(shape, bool), np.zeros(shape, bool)
    cover, distance = np.zeros(shape), np.full(shape, np.inf)
    radius = np.linalg.norm(half, axis=1)
    for view in views:
        eye_from_objects = view.eye_from_world() @ world_from_objects
        held |= _inside(middle, half, eye_from_objects, view.tangents, view.near)
        wide |= _inside(middle, half, eye_from_objects, wider(view.tangents), 0.0)
        eyes = np.linalg.inv(eye_from_objects)[:, None, :3, 3]
        away = np.linalg.norm(np.maximum(np.abs(eyes - middle) - half, 0), axis=2)
        distance = np.minimum(distance, away)
        focal = view.size[0] / (view.tangents[1] - view.tangents[0])
        pixels = (focal * radius / np.maximum(away, 0.3 * radius + view.near)) ** 2
        cover = np.maximum(cover, np.minimum(pixels, view.size[0] * view.size[1]))
    return LeafSight(*(each.ravel() for each in (held, wide | held, cover, distance)))


def _inside(
    middle: np.ndarray, half: np.ndarray, eye_from_objects: np.ndarray, tangents: tuple, near: float
) -> np.ndarray:
    """(n, L) bool: boxes that are not wholly outside of one side of a view's pyramid."""
    turns, shifts = eye_from_objects[:, :3, :3], eye_from_objects[:, :3, 3]
    left, right, down, up = tangents
    out = BLUR
    planes = np.array([  # a point in the eye's axes is inside where the product is above 0
        (-1, 0, -(right + out)), (1, 0, left - out), (0, -1, -(up + out)), (0, 1, down - out),
        (0, 0, -1),
    ])  # fmt: skip
    in_objects = np.swapaxes(planes @ turns, 1, 2)  # (n, 3, 5)
    place = middle @ in_objects + (shifts @ planes.T)[:, None]  # (n, L, 5)
    reach = (1 + TAIL) * half @ np.abs(in_objects)
    return np.asarray((place + reach > np.array([0, 0, 0, 0, near])).all(axis=2))


def wider(tangents: tuple, angle: float = WIDER) -> tuple[float, float, float, float]:
    """Tangents so many radians wider on each side."""
    angles = [math.atan(tangent) for tangent in tangents]
    left, right, down, up = (
        math.tan(min(max(a + way * angle, -WIDEST), WIDEST))
        for a, way in zip(angles, (-1, 1, -1, 1), strict=True)
    )
    return left, right, down, up


def look_view(views: Sequence[View], part: int) -> View:
    """One view that holds all of these and WIDER on each side, with 1 / part of the pixels a side:
    from the middle of the eyes, turned as the first.
    """
    first = views[0]
    ends = np.array([view.tangents for view in views])
    whole = (ends[:, 0].min(), ends[:, 1].max(), ends[:, 2].min(), ends[:, 3].max())
    tangents = wider(whole)
    left, right, down, up = first.tangents
    across = first.size[0] / (right - left) / part
    below = first.size[1] / (up - down) / part
    size = (
        max(round((tangents[1] - tangents[0]) * across), 1),
        max(round((tangents[3] - tangents[2]) * below), 1),
    )
    middle = np.mean([view.world_from_eye.position for view in views], axis=0)
    pose = Pose(middle, first.world_from_eye.wxyz)
    return replace(
        first, world_from_eye=pose, tangents=tangents, size=size, whole=None, hidden=None, gaze=None
    )


# seen: in how many pixels each leaf is seen, what hides it counted: a small coarse picture.
#
# The coarsest levels of all leaves are drawn in a quarter of the pixels a side; a leaf's pixels
# are the sums of alpha times transmittance of its splats.

PART = 4  # of the picture's sides
MOST = 1 << 20  # splats of a look; objects beyond are taken by what their boxes cover


class CoarseLook:
    """The coarsest levels of a scene's leaves on an OpenCL device."""

    def __init__(self, device: Device, models: Sequence[SplatLayers], first: np.ndarray) -> None:
        """first: (O,) the number of the first leaf of each model, over all of them."""
        self._device = device
        ends = np.cumsum([model.splat_count for model in models])
        self.objects = int(np.searchsorted(ends, MOST, side="right"))  # that take part
        mine = models[: self.objects]
        self.leaves = int(first[self.objects])  # the first so many are theirs
        size = sum(model.splat_count for model in mine)
        self._mean_opacity, self._covariance = device.empty((size, 4)), device.empty((size, 8))
        self._color, start = device.zeros((size, 4)), 0
        leaf = np.zeros(size, np.int64)
        for model, before in zip(mine, first, strict=False):
            assert model.leaves is not None
            rows = (model.means, model.scales, model.wxyz, model.opacity)
            pack(device, rows, start, self._mean_opacity, self._covariance)
            leaf[start : start + model.splat_count] = before + model.leaves.coarse_leaf
            start += model.splat_count
        counts = [model.splat_count for model in mine]
        self._leaf = leaf
        self._index = device.upload(np.repeat(np.arange(len(mine), dtype=np.int32), counts))
        self._antialiased = tuple(map(is_antialiased, mine))

    def pixels(
        self, views: Sequence[View], world_from_objects: Sequence[np.ndarray], leaves: int
    ) -> np.ndarray:
        """(leaves,) pixels of the views that each leaf is seen in, and WIDER around them.

        A pose full of NaN hides its object.
        """
        if not len(self._leaf):
            return np.zeros(leaves)
        device, view = self._device, look_view(views, PART)
        camera = camera_of(view)
        (projected,) = project_arena(
            device, self._mean_opacity, self._covariance, self._color, self._index,
            np.array(world_from_objects[: self.objects]), [camera], Limits(),
            SortFrames((camera.camera_from_world,)), None, self._antialiased,
        )  # fmt: skip
        order = sort_order(device, projected.in_tiles)
        tiles = bin_tiles(device, projected, view.size, order=order)
        evidence = Evidence(device, len(self._leaf), 1)
        evidence.add(projected, tiles, np.zeros(view.size[::-1], np.uint8))
        return np.bincount(self._leaf, evidence.sums()[:, 0], leaves) * PART**2


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


# Where the eye will be: what its last step leads to.

STEPS = 15  # frames ahead
FARTHEST = math.radians(40)  # that a view is turned ahead


def views_ahead(before: Sequence[View], now: Sequence[View], steps: int = STEPS) -> list[View]:
    """The views after so many more steps like the last one; [] where nothing moves, or jumps."""
    if len(before) != len(now):
        return []
    out = []
    for old, new in zip(before, now, strict=True):
        step = new.world_from_eye.position - old.world_from_eye.position
        turn = product(new.world_from_eye.wxyz, conjugate(old.world_from_eye.wxyz))
        turn = turn if turn[0] >= 0 else -turn
        sine = float(np.linalg.norm(turn[1:]))
        angle = 2 * math.atan2(sine, turn[0])
        if not (step.any() or angle > 0) or angle * steps > 4 * FARTHEST:
            return []
        wxyz = new.world_from_eye.wxyz
        if sine > 0:
            half = min(angle * steps, FARTHEST) / 2
            ahead = np.array([math.cos(half), *(math.sin(half) * turn[1:] / sine)])
            wxyz = product(ahead, wxyz)
            wxyz = wxyz / np.linalg.norm(wxyz)
        out.append(
            replace(new, world_from_eye=Pose(new.world_from_eye.position + steps * step, wxyz))
        )
    return out


def conjugate(wxyz: np.ndarray) -> np.ndarray:
    return wxyz * np.array([1.0, -1, -1, -1])


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Quaternions wxyz: the turn b, then a."""
    w, v = a[0] * b[0] - a[1:] @ b[1:], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.array([w, *v])
