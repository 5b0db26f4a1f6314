"""What is doubtful about the photos of a capture, in words, before a training."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.memory import Memory
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.depth_photo import load_depth
from shapeshift.scene.captures.lens_resampling import LEAST_PHOTOS
from shapeshift.scene.captures.normal_photo import load_normals
from shapeshift.scene.captures.photo import has_alpha_channel, load_photo
from shapeshift.scene.captures.undistort import lost
from shapeshift.scene.pose import View

# Photos of a capture, made smaller: what training and its scores know of them.

MOST_PIXELS = 640  # a side; larger photos are halved, thirded ... by default
PHOTOS = 0.5  # of the memory that files may take: what photos do as long as a run lasts
SAMPLE = 200  # photos of a modality, at most, that are asked what all of them show alike
BLACK = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class LoadedPhoto:
    view: View  # of the size used
    modality: str
    rgba: np.ndarray  # (H, W, 4) uint8; alpha below 255 where the background shows
    weight: np.ndarray | None  # (H, W) float32, what counts; None = everything
    name: str  # of the file
    depth: np.ndarray | None = None  # (H, W) float32 metres along the view, 0 = not known
    masked: bool = False  # whether a mask or an alpha channel says what lies outside of it
    normals: np.ndarray | None = None  # (H, W, 4) int8, as load_normals gives them
    unknown: int = 0  # pixels without a value; their weight is 0

    @property
    def has_depth(self) -> bool:
        return self.depth is not None

    @property
    def has_normals(self) -> bool:
        return self.normals is not None

    @property
    def kind(self) -> tuple:
        """What its steps are compiled for."""
        return self.view.size, self.has_depth, self.has_normals

    @property
    def bytes(self) -> int:
        arrays = (self.rgba, self.weight, self.depth, self.normals)
        return sum(array.nbytes for array in arrays if array is not None)

    def in_memory(self) -> "LoadedPhoto":
        """The photo with its pixels, wherever they lie."""
        return self

    @property
    def see_through(self) -> bool:
        return bool((self.rgba[..., 3] < 255).any())

    @property
    def is_blank(self) -> bool:
        """Whether no pixel of it counts."""
        return self.unknown > 0 and self.weight is not None and not self.weight.any()

    def over(self, background: tuple[float, float, float]) -> np.ndarray:
        """(H, W, 3) float32 the photo over a background, display sRGB 0..1."""
        alpha = self.rgba[..., 3:].astype(np.float32) / 255
        color = self.rgba[..., :3].astype(np.float32) / 255
        return alpha * color + (1 - alpha) * np.asarray(background, np.float32)


def choose_downscale(photos: tuple[Photo, ...]) -> int:
    """The smallest whole factor after which no side exceeds MOST_PIXELS."""
    return -(-max(max(photo.view.size) for photo in photos) // MOST_PIXELS)


def sampled(photos: list[LoadedPhoto]) -> list[LoadedPhoto]:
    """At most SAMPLE photos of each modality, evenly, in their order."""
    rows: dict[str, list[int]] = {}
    for row, photo in enumerate(photos):
        rows.setdefault(photo.modality, []).append(row)
    kept: list[int] = []
    for mine in rows.values():
        count = min(len(mine), SAMPLE)
        kept += [mine[i * len(mine) // count] for i in range(count)]
    return [photos[row] for row in sorted(kept)]


def memory_of(photos: tuple[Photo, ...], factor: int) -> int:
    """Bytes that photos take whose sides are divided by `factor`: see LoadedPhoto."""
    each = (math.prod(p.view.divided(factor).size) * bytes_a_pixel(p) for p in photos)
    return sum(each)


def bytes_a_pixel(photo: Photo) -> int:
    weighted = photo.mask is not None or photo.lens is not None or photo.may_lack_values
    mapped = (photo.depth is not None) + (photo.normals is not None)
    return 4 + 4 * weighted + 4 * mapped


def memory_for_photos() -> int:
    """Bytes that all photos of a run may take together."""
    return int(PHOTOS * Memory().most)


def read(photo: Photo, factor: int, masks: str, one_of_many: bool = False) -> LoadedPhoto:
    """Load one photo, made smaller by `factor`; `masks` is that of TrainSettings.

    Masks that mean "valid" leave it unmasked: they say of no pixel that it is empty.
    one_of_many: as in load_photo.
    """
    rgb, mask, gone = load_photo(photo, factor, one_of_many)
    alpha, weight = np.full(rgb.shape[:2], 255, np.uint8), None
    masks = meaning(photo, masks)
    masked = mask is not None and (photo.mask is None or masks == "object")
    if mask is not None and masked:
        alpha = mask
    elif mask is not None and masks == "valid":
        weight = mask.astype(np.float32) / 255
        if not weight.any():
            raise BadFile(
                f"{photo.mask} is black all over: nothing of its photo would count; leave the "
                "photo out, or its mask."
            )
    unknown = 0
    if gone is not None and gone.any():  # neither object nor background: nothing is known there
        alpha = np.where(gone, np.uint8(255), alpha)
        weight = np.where(gone, np.float32(0), np.float32(1) if weight is None else weight)
        beyond = False if photo.lens is None else lost(photo.lens, rgb.shape[1::-1], factor)
        unknown = int((gone & ~np.asarray(beyond)).sum()) if photo.may_lack_values else 0
    rgba = np.concatenate([rgb, alpha[..., None]], axis=2)
    depth = None if photo.depth is None else load_depth(photo, factor)
    normals = None if photo.normals is None else load_normals(photo, factor)
    # Nothing is known of what does not count.
    seen = alpha >= 128 if weight is None else (weight >= 0.5) & (alpha >= 128)
    for values in (depth, normals):
        if values is not None:
            values[~seen] = 0
    view = photo.view.divided(factor)
    return LoadedPhoto(
        view, photo.modality, rgba, weight, photo.name, depth, masked, normals, unknown
    )


def meaning(photo: Photo, masks: str) -> str:
    """What the photo's mask is taken for, by the setting `masks` of TrainSettings."""
    return photo.mask_means if masks == "auto" else masks


def is_masked(photo: Photo, masks: str) -> bool:
    """Whether its mask or its alpha channel says what lies outside, by headers alone."""
    if photo.mask is None:
        return has_alpha_channel(photo)
    return meaning(photo, masks) == "object"


@dataclass(frozen=True)
class PhotoReader:
    """How the photos of a capture are read, in whatever order."""

    factor: int
    masks: str
    many: frozenset[tuple[str, ColmapCamera]]  # split and lens of so many that a matrix pays

    @classmethod
    def of(cls, photos: tuple[Photo, ...], factor: int, masks: str) -> "PhotoReader":
        bent = Counter((photo.split, photo.lens) for photo in photos if photo.lens is not None)
        return cls(factor, masks, frozenset(key for key, n in bent.items() if n >= LEAST_PHOTOS))

    def bytes_of(self, photo: Photo) -> int:
        """What the photo's pixels take."""
        return math.prod(photo.view.divided(self.factor).size) * bytes_a_pixel(photo)

    def way(self, photo: Photo) -> tuple[int, str, bool]:
        """What is done to a photo's file, for who keeps what comes out."""
        return self.factor, meaning(photo, self.masks), (photo.split, photo.lens) in self.many

    def read(self, photo: Photo) -> LoadedPhoto:
        return read(photo, *self.way(photo))


def load_photos(capture: Capture, split: str, factor: int, masks: str) -> list[LoadedPhoto]:
    """All photos of a split that have a pixel with a value, in memory: see open_photos where they
    may not fit.  Raises BadFile.
    """
    mine = tuple(photo for photo in capture.photos if photo.split == split)
    reader = PhotoReader.of(mine, factor, masks)
    # Photos of one lens after each other: of the matrices one is kept.
    of_lens: dict[ColmapCamera | None, list[int]] = {}
    for i, photo in enumerate(mine):
        of_lens.setdefault(photo.lens, []).append(i)
    order = [i for numbers in of_lens.values() for i in numbers]
    loaded = {i: reader.read(mine[i]) for i in order}
    return [loaded[i] for i in range(len(mine)) if not loaded[i].is_blank]


def unknown_pixels(
    photos: Sequence[LoadedPhoto], blank: Sequence[LoadedPhoto | Photo]
) -> list[str]:
    """A sentence for each modality that has pixels without a value.

    photos: what is used; blank: photos of which no pixel has one, which are left out.
    """
    said = []
    for name in dict.fromkeys(photo.modality for photo in (*photos, *blank)):
        mine = [photo for photo in photos if photo.modality == name and photo.unknown]
        out = [photo for photo in blank if photo.modality == name]
        pixels = sum(math.prod(photo.view.size) for photo in photos if photo.modality == name)
        if mine:
            share = 100 * sum(photo.unknown for photo in mine) / pixels
            said.append(
                f"{name}: {share:.2g} % of the pixels, in {len(mine)} photos, have no value (no "
                "data, NaN, or beyond what was measured); they are unknown and count for nothing."
            )
        if out:
            plural = "s" if len(out) > 1 else ""
            said.append(
                f"{name}: no pixel of {len(out)} photo{plural} has a value, for example of "
                f"{path_end(Path(out[0].name))}; left out."
            )
    return said


FEW = 10  # training photos of a modality, up to which what lies between them is a guess


def validate_views(photos: list[LoadedPhoto], masks: str) -> tuple[list[LoadedPhoto], list[str]]:
    """The photos to train on, and a sentence for each thing that a person should know.

    masks: that of TrainSettings.  Where a mask says that nothing lies outside of the object, a
    photo without one shows the contrary: such photos are left out while they are the smaller part
    of their modality.
    """
    kept, warnings = list(photos), []
    for name in dict.fromkeys(photo.modality for photo in photos):
        mine = [photo for photo in kept if photo.modality == name]
        bare = [photo for photo in mine if not photo.masked]
        if masks in ("auto", "object") and 0 < len(bare) < len(mine):
            out = 2 * len(bare) < len(mine)
            if out:
                kept = [p for p in kept if p.modality != name or p.masked]
                mine = [p for p in mine if p.masked]
            what = "are left out" if out else "count as a whole, with what lies behind the object"
            warnings.append(
                f"{name}: {len(bare)} photos without a mask, for example {bare[0].name}, {what}; "
                "make masks for them, or train with --masks ignore."
            )
        if len(mine) <= FEW:
            more = [p.modality for p in photos if p.modality != name]
            shared = max(set(more), key=more.count, default=name)
            plural = "s" if len(mine) > 1 else ""
            warnings.append(
                f"{name} has {len(mine)} training photo{plural} only: seen from elsewhere it "
                "will be a guess; 30 and more from all around are a good capture."
                + (
                    f"  If it shows the shapes of {shared}, it can share them: "
                    'fixed = "offset,scale,rotation,opacity" in the file of --settings.'
                    if more.count(shared) > FEW
                    else ""
                )
            )
    return kept, warnings
