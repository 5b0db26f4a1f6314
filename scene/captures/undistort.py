"""Photos of a bent lens as a pinhole camera would have taken them, and what of them is lost.

The distortion models are COLMAP's (pycolmap, behind the gate) and nerfstudio's: a ColmapCamera maps
tangents x/z, y/z of its axes (OpenCV: x right, y down) to pixels of the photo.
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from PIL import Image

from shapeshift.runtime_models.gate.gate import ask
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.lenses.brown import brown_pixels, is_brown
from shapeshift.scene.captures.lenses.panorama import (
    face_size,
    is_panorama,
    is_whole,
    panorama_pixels,
)

STRAIGHT = 0.5  # pixels that distortion may shift a corner by before it matters
WIDEST = 1.75  # tangent of the half angle up to which a pinhole shows anything: 120 degrees
SAMPLES = 2048  # of a ray from the principal point, to WIDEST at a corner
DIRECTIONS = 64  # of such rays
LEAST_KEPT = 0.25  # of the photo's area; less is left of it only where the numbers are wrong ...
MOST_GROWN = 8  # times it; 120 degrees of real lenses, which squeeze their edges, grow three times
ROWS = 256  # of pixels whose places are computed at a time
CELLS = (
    64,
    48,
    32,
    24,
    16,
    12,
    8,
)  # pixels a side of a mesh's cells, within which pixels are interpolated ...
MESH_ERROR = 0.05  # ... with an error of so many pixels at most, where any of CELLS allows it
OUTSIDE = -1e4  # pixels: where the mesh has cells that no photo has


@dataclass(frozen=True)
class Pinhole:
    """The straight camera of a bent lens: the same axes and focal lengths, a field of its own.

    It is as wide and as high as the photo is along the axes through its principal point.  Photos
    of barrel distortion so lose corners; to those of pincushion distortion the corners of the
    pinhole are unknown.
    """

    focal: tuple[float, float]  # pixels
    centre: tuple[float, float]  # pixels from the upper left
    size: tuple[int, int]  # pixels


def pixels_of(lens: ColmapCamera, tangents: np.ndarray) -> np.ndarray:
    """(N, 2) pixels of the photo that lie at tangents (N, 2); NaN or far away where none does."""
    if is_panorama(lens):
        return panorama_pixels(lens, tangents)
    if is_brown(lens):
        return brown_pixels(lens, tangents)
    return by_pycolmap(lens, tangents, back=False)


def by_pycolmap(lens: ColmapCamera, given: np.ndarray, back: bool) -> np.ndarray:
    """(N, 2) pixels at tangents, or back: tangents at pixels, of a lens of COLMAP's."""
    given = np.ascontiguousarray(given, np.float64)
    words = [lens.model, list(lens.size), list(lens.params), given, back]
    return ask("lens", Path(lens.model), words, size=given.nbytes)


def is_straight(lens: ColmapCamera, where: str) -> bool:
    """Whether the lens shifts no corner by more than STRAIGHT pixels.  Raises BadFile."""
    if not all(0 < f < np.inf for f in lens.focal):
        raise BadFile(f"{where} has focal lengths {lens.focal}; both must be above 0")
    if not lens.bends or is_panorama(lens):
        return not lens.bends
    return corner_shift(lens) <= STRAIGHT


@lru_cache(maxsize=64)  # thousands of photos have one lens
def corner_shift(lens: ColmapCamera) -> float:
    """Pixels by which distortion shifts the corner or middle of an edge that it shifts most."""
    width, height = lens.size
    x, y = np.meshgrid([0, width / 2, width], [0, height / 2, height])
    corners = np.stack([x.ravel(), y.ravel()], axis=1)
    return float(np.abs(pixels_of(lens, (corners - lens.centre) / lens.focal) - corners).max())


@lru_cache(maxsize=64)
def fold(lens: ColmapCamera) -> float:
    """The tangent up to which pixels move outwards in every direction; beyond it lenses fold back.

    Polynomials that were fitted to a photo do so a little beyond its corners.
    """
    if is_panorama(lens):
        return np.inf
    angle = np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS)
    axes = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    radius = np.arange(SAMPLES + 1) * (WIDEST * 2**0.5 / SAMPLES)
    places = pixels_of(lens, (axes[:, None] * radius[:, None]).reshape(-1, 2))
    places = (places / lens.focal).reshape(DIRECTIONS, len(radius), 2)
    with np.errstate(invalid="ignore"):
        outwards = (np.diff(places, axis=1) * axes[:, None]).sum(axis=2) > 0  # NaN is not
    return float(radius[np.where(outwards.all(axis=1), SAMPLES, outwards.argmin(axis=1)).min()])


@lru_cache(maxsize=64)
def pinhole_of(lens: ColmapCamera) -> Pinhole:
    """The straight camera.  Raises BadFile where the lens leaves too little of the photo, or would
    make too much of it.
    """
    if is_panorama(lens):
        focal, half = max(round(lens.focal[0]), 1), face_size(lens)
        size = (2 * half[0], 2 * half[1])
        refuse_grown(lens, size)
        return Pinhole((focal, focal), half, size)
    limit, (fx, fy), (width, height) = min(fold(lens), WIDEST), lens.focal, lens.size
    along = np.linspace(0, limit, SAMPLES)
    none = np.zeros_like(along)

    def reach(tangents: np.ndarray, axis: int, edge: float, sign: int) -> float:
        at = sign * pixels_of(lens, tangents)[:, axis]
        rising = np.diff(at) > 0  # NaN is not; the last step may lie over the fold itself
        end = len(at) if rising.all() else int(rising.argmin()) + 1
        return float(np.interp(sign * edge, at[:end], along[:end]))

    right = reach(np.stack([along, none], 1), 0, width, 1)
    left = reach(np.stack([-along, none], 1), 0, 0.0, -1)
    down = reach(np.stack([none, along], 1), 1, height, 1)
    up = reach(np.stack([none, -along], 1), 1, 0.0, -1)
    size = (round((left + right) * fx), round((up + down) * fy))
    if not size[0] * size[1] >= LEAST_KEPT * width * height:
        raise BadFile(
            f"its lens ({lens.model}) folds the photo over itself within {limit:.2f} of the focal "
            "length; check the distortion's numbers and their camera model"
        )
    refuse_grown(lens, size)
    return Pinhole((fx, fy), (left * fx, up * fy), size)


def refuse_grown(lens: ColmapCamera, size: tuple[int, int]) -> None:
    """Raises BadFile where a straight camera has far more pixels than its photo."""
    width, height = lens.size
    if not size[0] * size[1] <= MOST_GROWN * width * height:
        raise BadFile(
            f"its lens ({lens.model}) would make {size[0]}x{size[1]} pixels of the photo's "
            f"{width}x{height}; check the distortion's numbers and their camera model"
        )


def straight_pixels(lens: ColmapCamera, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(len(y), len(x), 2) pixels of the photo at columns x and rows y of its straight camera.

    OUTSIDE where the lens has folded back.
    """
    straight, limit = pinhole_of(lens), fold(lens)
    (fx, fy), (cx, cy) = straight.focal, straight.centre
    tangents = np.stack(np.meshgrid((x - cx) / fx, (y - cy) / fy), axis=-1)
    places = pixels_of(lens, tangents.reshape(-1, 2)).reshape(tangents.shape)
    known = np.hypot(*np.moveaxis(tangents, 2, 0)) < limit
    known &= (np.abs(places) < -OUTSIDE + max(lens.size)).all(axis=2)
    return np.where(known[..., None], places, OUTSIDE)


@lru_cache(maxsize=8)
def mesh(lens: ColmapCamera, size: tuple[int, int], by: float, pitch: int) -> tuple:
    """What Image.transform takes: boxes of an image of `size`, and their corners in the photo.

    by, pitch: as in `undistorted`.
    """
    for cell in CELLS:
        edges = [np.append(np.arange(0, side, cell), side) for side in size]
        x, y = edges
        at = straight_pixels(lens, x * by, y * by) / pitch
        middle = straight_pixels(lens, (x[1:] + x[:-1]) / 2 * by, (y[1:] + y[:-1]) / 2 * by) / pitch
        corners = (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:])  # as PIL wants them
        away = np.abs(sum(corners) / 4 - middle).max(axis=2)
        inside = (middle > 0).all(axis=2)
        if not inside.any() or away[inside].max() <= MESH_ERROR:
            break
    quads = np.concatenate(corners, axis=2)
    return tuple(
        ((int(x[i]), int(y[j]), int(x[i + 1]), int(y[j + 1])), tuple(quads[j, i].tolist()))
        for j in range(len(y) - 1)
        for i in range(len(x) - 1)
        if quads[j, i].min() > OUTSIDE / pitch
    )


def undistorted(
    image: Image.Image, lens: ColmapCamera, size: tuple[int, int], by: float = 1, pitch: int = 1
) -> Image.Image:
    """The photo as its straight camera sees it; where it shows nothing, 0.

    size: of the result, each pixel of which is `by` of the straight camera's.  image: the photo
    from its upper left, each pixel of which is `pitch` of the file's.  Between those bilinear:
    Pillow's bicubic shifts what it sharpens by a tenth of a pixel.
    """
    how = Image.Resampling.BILINEAR
    return image.transform(size, Image.Transform.MESH, mesh(lens, size, by, pitch), how)


@lru_cache(maxsize=8)
def lost(lens: ColmapCamera, size: tuple[int, int], by: float) -> np.ndarray:
    """(H, W) bool which pixels of the straight camera, each `by` of its own, see past the photo."""
    if is_panorama(lens) and is_whole(lens):
        return np.zeros(size[::-1], bool)
    x, y = ((np.arange(side) + 0.5) * by for side in size)
    edge, out = max(by / 2, 0.5), np.ones(size[::-1], bool)
    for start in range(0, len(y), ROWS):
        at = straight_pixels(lens, x, y[start : start + ROWS])
        inside = (at >= edge) & (at <= np.array(lens.size) - edge)
        out[start : start + ROWS] = ~inside.all(axis=2)
        if lens.crop is not None:
            off = np.hypot(*np.moveaxis(at - lens.centre, 2, 0))
            out[start : start + ROWS] |= ~(off <= lens.crop)
    return out
