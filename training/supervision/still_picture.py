"""The picture that a camera sees behind a subject that turns, and what photos show before it."""

from dataclasses import dataclass, replace

import numpy as np

from shapeshift.training.photos import LoadedPhoto
from shapeshift.training.supervision.backgrounds import BACKDROP, near

STILL = 0.9  # of the photos that have the same colour in a pixel: there nothing moves
LEAST_TOLERANCE = 3.0  # of 255: what rounding leaves of one colour, and a little
NOISES = 4.0  # standard deviations of the camera's noise that pass for the same colour
RARE = 0.998  # of the deviations: JPEG has few large ones, beside edges
FEWEST = 4  # photos that show the background at a pixel where it is known ...
SHOWN = 0.12  # ... and of all photos: where a subject hides it in more, nothing is known
# Of the photos within three tolerances, those within one: noise is narrow, a subject that turns
# and happens to be alike is spread.
SHARP = 0.85
GAPS = 0.02  # of the longer side: in outlines, where the subject has the background's colour


@dataclass(frozen=True)
class StillPicture:
    """Of the photos of one camera."""

    rgb: np.ndarray  # (H, W, 3) uint8
    known: np.ndarray  # (H, W) bool
    tolerance: float  # of 255: what differs by no more is the background
    hidden: float  # of the pixels that are not always alike, those that are known: something hid it


def still_picture(photos: list[np.ndarray]) -> StillPicture:
    """What several of the photos (H, W, 3) uint8 show alike at a pixel, as the background is.

    What is alike in no connection with the photos' edges is the subject: a plain turntable's
    middle is the same in all photos.
    """
    from scipy.ndimage import label, median_filter

    pixels = np.stack(photos)  # (N, H, W, 3)
    tolerance = tolerance_of(pixels)
    alike = np.ones(pixels.shape[:3], np.int16)  # (N, H, W) how many photos show the same
    for i in range(len(pixels)):
        for j in range(i):
            low, high = np.minimum(pixels[i], pixels[j]), np.maximum(pixels[i], pixels[j])
            same = (high - low).max(axis=2) <= tolerance
            alike[i] += same
            alike[j] += same
    best = alike.argmax(axis=0)[None, ..., None]
    rgb = np.take_along_axis(pixels, best, axis=0)[0]
    away = np.abs(pixels.astype(np.int16) - rgb).max(axis=3)
    agree = away <= tolerance
    count = agree.sum(axis=0)
    known = count >= max(FEWEST, SHOWN * len(pixels))
    known &= count >= SHARP * (away <= 3 * tolerance).sum(axis=0)
    parts, _ = label(median_filter(known.astype(np.uint8), 5))
    edges = np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]])
    known = np.isin(parts, np.unique(edges[edges > 0]))
    mean = (pixels * agree[..., None]).sum(axis=0) / count[..., None]
    moved = near(pixels, rgb).mean(axis=0) < STILL
    hidden = float(known[moved].mean()) if moved.any() else 0.0
    return StillPicture(np.rint(mean).astype(np.uint8), known, tolerance, hidden)


def tolerance_of(pixels: np.ndarray) -> float:
    """Of 255: how far photos (N, H, W, 3) of one still thing differ, by where most are alike."""
    middle = np.median(pixels, axis=0)
    still = near(pixels, middle).mean(axis=0) >= STILL
    away = np.abs(pixels[:, still] - middle[still])
    noise = away[away <= 255 * BACKDROP]  # the rest is what hides it in single photos
    sigma = float(np.sqrt((noise**2).mean())) if noise.size else 0.0
    tail = float(np.quantile(noise, RARE)) if noise.size else 0.0
    return max(LEAST_TOLERANCE, NOISES * sigma, tail)


def subject_mask(rgb: np.ndarray, still: StillPicture) -> np.ndarray:
    """(H, W) bool: where a photo (H, W, 3) uint8 shows something else than what stands still."""
    from scipy.ndimage import binary_closing, binary_fill_holes, median_filter

    differs = np.abs(rgb.astype(np.int16) - still.rgb).max(axis=2) > still.tolerance
    shown = median_filter((differs | ~still.known).astype(np.uint8), 3) > 0  # without noise
    reach = max(1, round(GAPS * max(shown.shape)))
    closed = binary_closing(np.pad(shown, reach, "edge"), iterations=reach)
    return binary_fill_holes(closed)[reach:-reach, reach:-reach]


def cut_out(photo: LoadedPhoto, still: StillPicture) -> LoadedPhoto:
    """The photo with an alpha that leaves the subject alone; of the rest nothing else is known.

    What does not count, as beyond a lens's edge, is no background.
    """
    rgba = photo.rgba.copy()
    mask = subject_mask(rgba[..., :3], still)
    nothing = photo.weight is not None and ~(photo.weight > 0)
    rgba[..., 3] = np.where(mask | nothing, np.uint8(255), np.uint8(0))
    depth, normals = photo.depth, photo.normals
    if depth is not None:
        depth = np.where(mask, depth, np.float32(0))
    if normals is not None:
        normals = np.where(mask[..., None], normals, np.int8(0))
    return replace(photo, rgba=rgba, masked=True, depth=depth, normals=normals)
