"""The pixels of a photo and of its mask, in the size that is asked for."""

import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from shapeshift.runtime_models.files.memory import GB, VARIABLE, Memory
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Photo

MOST_PIXELS = 1 << 27
# Photos pack 2 to 16 pixels into a byte, a rendering before one colour 40, a mask a thousand: that
# may have as many as the photo that it is for.  What is small may pack as it likes, 4K is.
FREE_PIXELS, PIXELS_A_BYTE = 1 << 23, 32
PIXEL = 28  # bytes of memory: decoded, converted, as floats
ROWS = 256  # that become floats at a time
BROKEN = (OSError, SyntaxError, ValueError, EOFError, RuntimeError)  # of Pillow, in broken files
FLOATS = "F"  # how PIL names floating-point greyscale
GREY_16 = ("I;16", "I;16B", "I;16L", "I")  # how PIL names 16-bit greyscale


def open_image(path: Path) -> Image.Image:
    """The image file, its header read; BadFile when it is missing or no image."""
    try:
        with quiet():
            return Image.open(path)
    except FileNotFoundError:
        raise BadFile(
            f"{path}: the image file is missing; put it there or drop the frame"
        ) from None
    except (UnidentifiedImageError, Image.DecompressionBombError, *BROKEN) as error:
        raise BadFile(f"{path}: not a readable image ({error}); PNG or JPEG is wanted") from None


@contextmanager
def quiet() -> Iterator[None]:
    """Without Pillow's warnings of odd metadata and large pictures: what is wrong is a BadFile."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def load_photo(
    photo: Photo, size: tuple[int, int] | None = None
) -> tuple[np.ndarray, np.ndarray | None]:
    """rgb (H, W, 3) float32 display sRGB 0..1 and mask (H, W) float32 0..1 or None.

    Greyscale becomes three equal channels.  An alpha channel becomes the mask and the colours are
    laid over black with it; a mask file takes precedence over alpha.  `size` (width, height) is
    reached by the mean over each new pixel's area.
    """
    rgb, alpha = read_pixels(photo.path, photo.counts)
    mask, pixels = alpha, rgb.shape[0] * rgb.shape[1]
    if photo.mask is not None:
        mask = read_pixels(photo.mask, most=pixels)[0].mean(axis=2)
    if mask is not None and mask.shape != rgb.shape[:2]:
        raise BadFile(
            f"{photo.mask}: the mask has {mask.shape[1]}x{mask.shape[0]} pixels, its photo "
            f"{rgb.shape[1]}x{rgb.shape[0]}; make them the same size"
        )
    if size is None or size == (rgb.shape[1], rgb.shape[0]):
        return rgb, mask
    return shrink(rgb, size), None if mask is None else shrink(mask[..., None], size)[..., 0]


def read_pixels(
    path: Path, counts: tuple[float, float] | None = None, most: int = 0
) -> tuple[np.ndarray, np.ndarray | None]:
    """rgb and alpha or None, as load_photo gives them; counts: what stands for 0 and 1.

    most: pixels that it may have however few its bytes, where a photo of as many goes with it.
    """
    with open_image(path) as image:
        charge_pixels(path, image.size, most)
        try:
            with quiet():
                image.load()
        except BROKEN as error:
            raise BadFile(f"{path}: the image is cut off ({error}); copy it again") from None
        if counts is not None or image.mode in (*GREY_16, FLOATS):
            grey = shares(np.asarray(image, np.float32), image.mode, counts, path)
            return np.repeat(grey[..., None], 3, axis=2), None
        if image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info:
            rgba = floats(image, "RGBA")
            alpha = rgba[..., 3].copy()
            rgba[..., :3] *= rgba[..., 3:]
            return np.ascontiguousarray(rgba[..., :3]), alpha
        return floats(image, "RGB"), None


def charge_pixels(path: Path, size: tuple[int, int], most: int = 0) -> None:
    """BadFile where a picture has more pixels than its bytes can mean, or than there is memory."""
    bytes_there, pixels, whole = path.stat().st_size, size[0] * size[1], Memory()
    usual = min(MOST_PIXELS, max(FREE_PIXELS, PIXELS_A_BYTE * bytes_there, most))
    if pixels > (MOST_PIXELS if whole.asked else usual):
        allow = math.ceil(PIXEL * pixels / GB)
        more = f", or set {VARIABLE}={allow} (GB)" if pixels <= MOST_PIXELS else ""
        raise BadFile(
            f"{path}: {size[0]}x{size[1]} pixels, at most {usual:,} are read out of "
            f"{bytes_there:,} bytes; scale it down, save it again{more}"
        )
    # What it may have is told in pixels: of the account only the machine's bound counts.
    whole.of(path, PIXEL * MOST_PIXELS).charge(PIXEL * pixels, f"{pixels:,} pixels")


def floats(image: Image.Image, mode: str) -> np.ndarray:
    """(H, W, C) float32 0..1 of a picture in a mode of bytes, some rows at a time."""
    out = np.empty((image.height, image.width, len(mode)), np.float32)
    for start in range(0, image.height, ROWS):
        end = min(start + ROWS, image.height)
        out[start:end] = image.crop((0, start, image.width, end)).convert(mode)
    out /= 255
    return out


def shares(
    grey: np.ndarray, mode: str, counts: tuple[float, float] | None, path: Path
) -> np.ndarray:
    """(H, W) float32 0..1 of a grey photo's numbers; what is none of them counts as 0."""
    if counts is None:
        if mode == FLOATS:
            raise BadFile(
                f"{path}: a photo of floating-point numbers; say with its modality's 'counts' "
                "[low, high] which of them stand for black and white"
            )
        return grey / 65535
    if mode not in (*GREY_16, FLOATS, "L"):
        raise BadFile(f"{path}: 'counts' are for greyscale photos, this one is {mode}")
    low, high = counts
    with np.errstate(invalid="ignore", over="ignore"):
        return np.clip(np.nan_to_num((grey - low) / (high - low)), 0, 1).astype(np.float32)


def shrink(pixels: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(H, W, C) -> (height, width, C), each new pixel the mean over the area it covers."""
    rows = area_weights(pixels.shape[0], size[1])
    columns = area_weights(pixels.shape[1], size[0])
    return np.stack([rows @ plane @ columns.T for plane in np.moveaxis(pixels, 2, 0)], axis=2)


def area_weights(old: int, new: int) -> np.ndarray:
    """(new, old) float32 rows that add up to 1: how much of each old pixel a new one covers."""
    edges = np.arange(new + 1) * old / new
    start, end = edges[:-1, None], edges[1:, None]
    cell = np.arange(old)
    covered = np.minimum(end, cell + 1) - np.maximum(start, cell)
    return (np.maximum(covered, 0) * new / old).astype(np.float32)
