"""The part of a scene that is trained anew: boxes, and the pixels of photos that they cover."""

from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.change.similarity import Similarity
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.sections.section import BoxShape
from shapeshift.training.photos import LoadedPhoto

STEP = 32  # pixels that the sides of cut photos are whole numbers of: few sizes, few buffers
LEAST_PIXELS = 64  # of the region in a photo; what shows less of it teaches nothing


@dataclass(frozen=True)
class UpdateRegion:
    """What may change: the union of some boxes of the world."""

    boxes: tuple[BoxShape, ...]

    def __post_init__(self) -> None:
        if not self.boxes:
            raise ValueError("a region of no box would change nothing; name one box or more.")

    def distance(self, points: np.ndarray) -> np.ndarray:
        """(N,) metres from points (N, 3) to the nearest box; 0 inside."""
        return np.min([_outside(box, points) for box in self.boxes], axis=0)

    def holds(self, points: np.ndarray) -> np.ndarray:
        """(N,) bool: which points (N, 3) lie in one of the boxes, faces included."""
        return np.asarray(self.distance(points) == 0)

    def nearest(self, points: np.ndarray) -> np.ndarray:
        """(N, 3) points, each moved to the nearest place of a box; those inside as they are."""
        out = np.array(points, np.float64)
        for row in np.flatnonzero(~self.holds(out)):
            box = min(self.boxes, key=lambda box: _outside(box, out[row : row + 1])[0])
            local = (out[row] - box.centre) @ box.axes
            inside = np.clip(local, -np.array(box.half), box.half) * (1 - 1e-6)
            out[row] = box.axes @ inside + box.centre
        return out

    def shadow(self, view: View) -> np.ndarray:
        """(H, W) bool: pixels whose ray meets one of the boxes in front of the eye."""
        left, right, down, up = view.tangents
        width, height = view.size
        x = left + (right - left) * (np.arange(width) + 0.5) / width
        y = up - (up - down) * (np.arange(height) + 0.5) / height
        ways = np.stack(np.broadcast_arrays(x, y[:, None], -1.0), axis=-1)  # (H, W, 3) in the eye
        matrix = view.world_from_eye.matrix()
        out = np.zeros((height, width), bool)
        for box in self.boxes:
            eye = (matrix[:3, 3] - box.centre) @ box.axes
            out |= _meets(eye, ways @ matrix[:3, :3].T @ box.axes, np.array(box.half))
        return out


def _outside(box: BoxShape, points: np.ndarray) -> np.ndarray:
    """(N,) metres to the box, 0 inside."""
    local = (np.asarray(points, np.float64) - box.centre) @ box.axes
    return np.linalg.norm(np.maximum(np.abs(local) - box.half, 0), axis=1)


def _meets(eye: np.ndarray, ways: np.ndarray, half: np.ndarray) -> np.ndarray:
    """(H, W) bool of rays from `eye` (3,) along `ways` (H, W, 3) in a box's axes: the slab test."""
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (-half - eye) / ways, (half - eye) / ways
    begin = np.nanmax(np.minimum(first, second), axis=-1)
    end = np.nanmin(np.maximum(first, second), axis=-1)
    return np.asarray((end >= begin) & (end > 0))


def cut_photos(
    photos: dict[str, list[LoadedPhoto]], region: UpdateRegion
) -> dict[str, list[LoadedPhoto]]:
    """Of every split the photos that see the region, cut to it; nothing else in them counts."""
    return {
        split: [cut for photo in found if (cut := cut_photo(photo, region)) is not None]
        for split, found in photos.items()
    }


def cut_photo(photo: LoadedPhoto, region: UpdateRegion) -> LoadedPhoto | None:
    """The smallest part of a photo, in whole STEPs, that holds the region; None: it sees little."""
    seen = region.shadow(photo.view)
    if photo.weight is not None:
        seen &= photo.weight > 0
    if not seen.sum() >= LEAST_PIXELS:
        return None
    used_rows, used_columns = (np.flatnonzero(seen.any(axis=axis)) for axis in (1, 0))
    top, height = _span(used_rows, seen.shape[0])
    left, width = _span(used_columns, seen.shape[1])
    rows, columns = slice(top, top + height), slice(left, left + width)
    weight = seen if photo.weight is None else seen * photo.weight
    return replace(
        photo.in_memory(),
        view=photo.view.part(left, top, (width, height)),
        rgba=np.ascontiguousarray(photo.rgba[rows, columns]),
        weight=np.ascontiguousarray(weight[rows, columns], np.float32),
        depth=None if photo.depth is None else np.ascontiguousarray(photo.depth[rows, columns]),
        normals=None
        if (normals := photo.normals) is None
        else np.ascontiguousarray(normals[rows, columns]),
    )


def _span(used: np.ndarray, side: int) -> tuple[int, int]:
    """(first, how many) of a side's pixels, about those that are used (n,), rising."""
    count = min(-(-(used[-1] + 1 - used[0]) // STEP) * STEP, side)
    first = (used[0] + used[-1] + 1 - count) // 2
    return int(np.clip(first, 0, side - count)), int(count)


def moved_capture(capture: Capture, a_from_b: Similarity) -> Capture:
    """A capture in the world of the scene that is updated."""
    photos = []
    for photo in capture.photos:
        world = photo.view.world_from_eye.matrix()
        world[:3, :3] = a_from_b.rotation @ world[:3, :3]
        world[:3, 3] = a_from_b.apply(world[:3, 3])
        scale = a_from_b.scale
        view = replace(
            photo.view, world_from_eye=Pose.from_matrix(world),
            near=photo.view.near * scale, far=photo.view.far * scale,
        )  # fmt: skip
        units = photo.depth_unit * scale, photo.float_depth_unit * scale
        photos.append(replace(photo, view=view, depth_unit=units[0], float_depth_unit=units[1]))
    points = None if capture.points is None else a_from_b.apply(capture.points.astype(np.float64))
    return replace(
        capture,
        photos=tuple(photos),
        points=None if points is None else points.astype(np.float32),
    )


def refuse_unseen(photos: dict[str, list[LoadedPhoto]], stops: tuple[str, ...], where: str) -> None:
    """BadFile where no training photo of a stop sees the region."""
    for name in stops:
        if not any(photo.modality == name for photo in photos["train"]):
            raise BadFile(
                f"no training photo of '{name}' in {where} sees the region; name another box "
                "(metres of the scene's world), or say how the worlds lie with --change."
            )
