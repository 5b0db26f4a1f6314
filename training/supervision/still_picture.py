"""The picture that a camera sees behind a subject that turns, and what photos show before it."""

from dataclasses import dataclass, replace

import numpy as np

from shapeshift.training.photos import LoadedPhoto
from shapeshift.training.supervision.backgrounds import BACKDROP, near

STILL = 0.9  # of the photos that have the same colour in a pixel: there nothing moves
LEAST_TOLERANCE = 3.0  # of 255: what rounding leaves of one colour, and a little
NOISES = 4.0  # standard deviations of the camera's noise that pass for the same colour
RARE = 0.998  # of the deviations: JPEG has few large ones, beside edges
FEWEST = 3  # photos that must show the background at a pixel, more than half of those beside it
# From a pixel to the next a subject's outline passes in so many photos, or in this share of them:
# where more do, it may be a wall of few colours that is alike in them, before a bonnet.
LOST, LOST_SHARE = 2, 0.3
# Photos that show something else around a pixel and are like its background there, of those that
# show it: more are a subject of that colour, which rounds a corner into the background.
STRAY = 0.5
# Of the photos within three tolerances, those within one: noise is narrow, a subject that turns
# and happens to be alike is spread.
SHARP = 0.85
MEASURED = 320  # pixels a side, at most, that the noise is measured from
GAPS = 0.02  # of the longer side: in outlines, where the subject has the background's colour


@dataclass(frozen=True)
class StillPicture:
    """Of the photos of one camera."""

    rgb: np.ndarray  # (H, W, 3) uint8
    known: np.ndarray  # (H, W) bool
    tolerance: float  # of 255: what differs by no more is the background
    hidden: float  # of the pixels that are not always alike, those that are known: something hid it


def still_picture(photos: list[np.ndarray]) -> StillPicture:
    """What photos (H, W, 3) uint8 show behind what turns before them.

    It begins where nearly all are alike, in connection with their edges (a plain turntable's middle
    is the same in all photos, and the subject), and grows inwards from pixel to pixel: of the
    photos that show the background beside a pixel, most do so there, too, and then they are alike.
    So a stripe that a few photos from low down show beside a table's rim is known by these few, and
    a table of few colours, alike in as many photos, is none, since photos that do not show the
    background beside it have its colours, too.
    """
    pixels = np.stack(photos)  # (N, H, W, 3)
    tolerance = tolerance_of(pixels)
    rgb = np.median(pixels, axis=0).astype(np.float32)
    agree = np.stack([np.abs(photo - rgb).max(axis=2) <= tolerance for photo in photos])
    known = touching_edges(agree.mean(axis=0) >= STILL)
    rgb[known] = mean_where(pixels[:, known], agree[:, known])
    moved = near(pixels, rgb).mean(axis=0) < STILL
    shows = np.pad(agree & known, ((0, 0), (1, 1), (1, 1)))  # (N, 1 + H + 1, 1 + W + 1)
    grow(pixels, rgb, known, shows, tolerance, LOST_SHARE)
    hidden = float(known[moved].mean()) if moved.any() else 0.0
    if hidden:  # what is behind a subject is known by half
        grow(pixels, rgb, known, shows, tolerance, 1.0)
    return StillPicture(np.rint(rgb).astype(np.uint8), known, tolerance, hidden)


def grow(
    pixels: np.ndarray, rgb: np.ndarray, known: np.ndarray, shows: np.ndarray,
    tolerance: float, lost: float,
) -> None:  # fmt: skip
    """Adds to what is known of the background, from pixel to pixel.

    Changed in place: rgb (H, W, 3) float32; known (H, W) bool; shows (N, H + 2, W + 2) bool, which
    photos show the background there.  lost: as LOST_SHARE.
    """
    from scipy.ndimage import binary_dilation

    left = ~known  # what is still to be tried
    while (front := np.nonzero(left & binary_dilation(known)))[0].size:
        left[front] = False
        row, column = front
        beside = (
            shows[:, row, column + 1]
            | shows[:, row + 2, column + 1]
            | shows[:, row + 1, column]
            | shows[:, row + 1, column + 2]
        )  # fmt: skip  (N, F)
        colors, there = behind(pixels[:, row, column], beside, tolerance, lost)
        found = there.any(axis=0)
        row, column = row[found], column[found]
        rgb[row, column], known[row, column] = colors[found], True
        shows[:, row + 1, column + 1] = there[:, found]
        again = np.zeros_like(known)  # around what is new there is more to go by
        again[row, column] = True
        left |= binary_dilation(again) & ~known


def touching_edges(known: np.ndarray) -> np.ndarray:
    """(H, W) bool: the parts of it that reach the picture's edges."""
    from scipy.ndimage import label

    parts, _ = label(known)
    edges = np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]])
    return np.isin(parts, np.unique(edges[edges > 0]))


def behind(
    pixels: np.ndarray, beside: np.ndarray, tolerance: float, lost: float
) -> tuple[np.ndarray, np.ndarray]:
    """(F, 3) the background's colours at F pixels (N, F, 3) uint8 of N photos, and (N, F) bool
    which photos show it there; none do where it cannot be told.

    beside: (N, F) which photos show the background in a neighbour of the pixel.  Of more than half
    of these that are alike their median is one.  lost: as LOST_SHARE.
    """
    count = beside.sum(axis=0)
    ordered = np.sort(np.where(beside[..., None], pixels, np.int16(256)), axis=0)
    middle = ordered[np.maximum(count - 1, 0) // 2, np.arange(len(count))]  # (F, 3)
    away = np.abs(pixels - middle).max(axis=2)
    alike = away <= tolerance
    shown = (alike & beside).sum(axis=0)
    known = (shown >= FEWEST) & (2 * shown > count)
    known &= count - shown <= np.maximum(LOST, lost * count)
    known &= (alike & ~beside).sum(axis=0) <= STRAY * shown
    known &= shown >= SHARP * ((away <= 3 * tolerance) & beside).sum(axis=0)
    there = alike & beside & known
    return mean_where(pixels, there), there


def mean_where(pixels: np.ndarray, there: np.ndarray) -> np.ndarray:
    """(F, 3) means over the photos of pixels (N, F, 3) where `there` (N, F); 0 where none is."""
    total = np.einsum("nf,nfc->fc", there.astype(np.float32), pixels.astype(np.float32))
    return total / np.maximum(there.sum(axis=0), 1)[:, None]


def tolerance_of(pixels: np.ndarray) -> float:
    """Of 255: how far photos (N, H, W, 3) of one still thing differ, by where most are alike."""
    step = -(-max(pixels.shape[1:3]) // MEASURED)
    pixels = pixels[:, ::step, ::step]
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
