"""Photos of a capture, read once and made smaller: what training and its scores know of them."""

import math
from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.files.memory import Memory, amount
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.depth_photo import load_depth
from shapeshift.scene.captures.lens_resampling import LEAST_PHOTOS
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.pose import View

MOST_PIXELS = 640  # a side; larger photos are halved, thirded ... by default
PHOTOS = 0.5  # of the memory that files may take: what photos do as long as a run lasts
BLACK = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class LoadedPhoto:
    view: View  # of the size used
    modality: str
    rgba: np.ndarray  # (H, W, 4) uint8; alpha below 255 where the background shows
    weight: np.ndarray | None  # (H, W) float32, what counts; None = everything
    name: str  # of the file
    depth: np.ndarray | None = None  # (H, W) float32 metres along the view, 0 = not known
    masked: bool = False  # whether it came with a mask or an alpha channel

    @property
    def see_through(self) -> bool:
        return bool((self.rgba[..., 3] < 255).any())

    def over(self, background: tuple[float, float, float]) -> np.ndarray:
        """(H, W, 3) float32 the photo over a background, display sRGB 0..1."""
        alpha = self.rgba[..., 3:].astype(np.float32) / 255
        color = self.rgba[..., :3].astype(np.float32) / 255
        return alpha * color + (1 - alpha) * np.asarray(background, np.float32)


def choose_downscale(photos: tuple[Photo, ...]) -> int:
    """The smallest whole factor after which no side exceeds MOST_PIXELS and all fit into memory."""
    longest = max(max(photo.view.size) for photo in photos)
    factor = -(-longest // MOST_PIXELS)
    while factor < longest and memory_of(photos, factor) > memory_for_photos():
        factor += 1
    return factor


def memory_of(photos: tuple[Photo, ...], factor: int) -> int:
    """Bytes that photos take whose sides are divided by `factor`: see LoadedPhoto."""
    each = (math.prod(p.view.divided(factor).size) * bytes_a_pixel(p) for p in photos)
    return sum(each)


def bytes_a_pixel(photo: Photo) -> int:
    weighted = photo.mask is not None or photo.lens is not None
    return 4 + 4 * weighted + 4 * (photo.depth is not None)


def memory_for_photos() -> int:
    """Bytes that all photos of a run may take together."""
    return int(PHOTOS * Memory().most)


def memory_excess(photos: tuple[Photo, ...], factor: int) -> str:
    """Why photos of this size do not fit into memory, in words; "" where they do."""
    needed, may = memory_of(photos, factor), memory_for_photos()
    if needed <= may:
        return ""
    width, height = photos[0].view.divided(factor).size
    return (
        f"{len(photos):,} photos of {width}x{height} pixels would take {amount(needed)} of "
        f"memory, photos may take {amount(may)}"
    )


def memory_warnings(photos: tuple[Photo, ...], factor: int) -> list[str]:
    """A sentence where photos are smaller than usual because of memory."""
    usual = -(-max(max(photo.view.size) for photo in photos) // MOST_PIXELS)
    why = memory_excess(photos, usual) if usual < factor else ""
    return [f"{why}: they are made {factor} times smaller; --memory GB allows more."] if why else []


def read(photo: Photo, factor: int, masks: str, one_of_many: bool = False) -> LoadedPhoto:
    """Load one photo, made smaller by `factor`; `masks` is that of TrainSettings.

    one_of_many: as in load_photo.
    """
    rgb, mask, lost = load_photo(photo, factor, one_of_many)
    alpha, weight = np.full(rgb.shape[:2], 255, np.uint8), None
    if mask is not None and (photo.mask is None or masks == "object"):
        alpha = mask
    elif mask is not None and masks == "valid":
        weight = mask.astype(np.float32) / 255
        if not weight.any():
            raise BadFile(f"{photo.mask} is black all over: nothing of its photo would count.")
    if lost is not None and lost.any():  # neither object nor background: nothing is known there
        alpha = np.where(lost, np.uint8(255), alpha)
        weight = np.where(lost, np.float32(0), np.float32(1) if weight is None else weight)
    rgba = np.concatenate([rgb, alpha[..., None]], axis=2)
    depth = None if photo.depth is None else load_depth(photo, factor)
    if depth is not None:  # nothing is known of what does not count
        seen = alpha >= 128 if weight is None else (weight >= 0.5) & (alpha >= 128)
        depth = np.where(seen, depth, np.float32(0))
    view, masked = photo.view.divided(factor), mask is not None
    return LoadedPhoto(view, photo.modality, rgba, weight, str(photo.path), depth, masked)


def load_photos(capture: Capture, split: str, factor: int, masks: str) -> list[LoadedPhoto]:
    """All photos of a split.  Raises BadFile, also where they would need too much memory."""
    mine = tuple(photo for photo in capture.photos if photo.split == split)
    if mine and (why := memory_excess(mine, factor)):
        fits = choose_downscale(capture.photos)
        raise BadFile(f"{capture.folder}: {why}; --downscale {fits} fits, --memory GB allows more.")
    # Photos of one lens after each other: of the matrices one is kept.
    of_lens: dict[ColmapCamera | None, list[int]] = {}
    for i, photo in enumerate(mine):
        of_lens.setdefault(photo.lens, []).append(i)
    loaded: dict[int, LoadedPhoto] = {}
    for lens, numbers in of_lens.items():
        many = lens is not None and len(numbers) >= LEAST_PHOTOS
        loaded |= {i: read(mine[i], factor, masks, many) for i in numbers}
    return [loaded[i] for i in range(len(mine))]
