"""The pixels of a photo and of its mask, in the size that is asked for."""

import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image, UnidentifiedImageError

from shapeshift.runtime_models.files.memory import GB, VARIABLE, Memory
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Photo
from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.lens_resampling import LARGEST, resampled
from shapeshift.scene.captures.lenses.panorama import is_panorama
from shapeshift.scene.captures.radiometric.no_value import (
    FLOATS,
    GREY_16,
    SAID_NOTHING,
    SHADES,
    NoValue,
    smaller_with_gaps,
    stated_no_data,
    without_value,
)
from shapeshift.scene.captures.radiometric.number_photos import (
    GRIDS,
    is_radiometric,
    open_grid,
    radiometric_celsius,
)
from shapeshift.scene.captures.radiometric.tiff_bands import band_header, is_misread, open_band
from shapeshift.scene.captures.rare_photo import is_rare, rare_photo, refuse_scans
from shapeshift.scene.captures.rare_photo_run import USUAL
from shapeshift.scene.captures.undistort import lost, pinhole_of, undistorted

MOST_PIXELS = 1 << 27
# Photos pack 2 to 16 pixels into a byte, a rendering before one colour 40, a mask a thousand: that
# may have as many as the photo that it is for.  What is small may pack as it likes, 4K is.
FREE_PIXELS, PIXELS_A_BYTE = 1 << 23, 32
PIXEL = 28  # bytes of memory: decoded, converted, as floats
ASPECT = 0.02  # by how much what lies beside a photo may be wider or narrower than it
HEIC = {".heic", ".heif"}
ROWS = 256  # that become floats at a time
BROKEN = (OSError, SyntaxError, ValueError, EOFError, RuntimeError)  # of Pillow, in broken files


def open_image(path: Path, band: int = 0) -> Image.Image:
    """The image file, its header read; BadFile when it is missing or no image.

    band: which of several, counted from 1; 0: the file holds one.  Of a TIFF that has several, and
    colours of more than 8 bits, band 0 is its header alone, with "bands" in its info.
    """
    try:
        if band:
            with quiet():
                return open_band(path, band)
        if path.suffix.lower() in GRIDS:
            return open_grid(path)
        with quiet():
            image = Image.open(path, formats=USUAL)
        misread = is_misread(image)
        if not (misread or is_rare(image)):
            return image
        image.close()
        if misread:
            with quiet():
                return open_band(path, 1)
    except FileNotFoundError:
        raise BadFile(
            f"{path}: the image file is missing; put it there or drop the frame"
        ) from None
    except BadFile:  # of a grid, in its own words
        raise
    except UnidentifiedImageError:  # perhaps one of the rarer formats
        if not band and (header := band_header(path)) is not None:
            return header
        if path.stat().st_size == 0:
            raise BadFile(f"{path}: the image file is empty; copy it again") from None
        if path.suffix.lower() in HEIC:
            raise BadFile(
                f"{path}: HEIC photos are not read; save them as JPEG or PNG (a phone does so by "
                "its setting 'most compatible')"
            ) from None
    except (Image.DecompressionBombError, *BROKEN) as error:
        raise BadFile(f"{path}: not a readable image ({error}); PNG or JPEG is wanted") from None
    rare, size = rare_photo(path, MOST_PIXELS if Memory().asked else usual_pixels(path))
    if rare is None:
        charge_pixels(path, size)
    assert rare is not None, "more pixels than are usual are refused"
    return rare


@contextmanager
def quiet() -> Iterator[None]:
    """Without Pillow's warnings of odd metadata and large pictures: what is wrong is a BadFile."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


class Pixels(NamedTuple):
    """A photo as it is trained on; all arrays have its rows and columns."""

    rgb: np.ndarray  # (H, W, 3) uint8 display sRGB
    mask: np.ndarray | None  # (H, W) uint8: of the mask file, else the photo's alpha channel
    lost: np.ndarray | None  # (H, W) bool: what an undistorted photo does not show, or has no value


class Decoded(NamedTuple):
    """An image file as bytes."""

    image: Image.Image  # of mode L, RGB or RGBA; 0 where there is no value
    size: tuple[int, int]  # width and height of the file
    known: Image.Image | None = None  # of mode L, 0 where there is no value, else 255; None: 255


def load_photo(photo: Photo, factor: int = 1, one_of_many: bool = False) -> Pixels:
    """The photo with its sides divided by `factor`, each pixel the mean over the area it covers.

    What is less than a whole pixel at the right and at the bottom is cut off, as View.divided cuts
    it.  Greyscale becomes three equal channels.  Where a mask file takes precedence over an alpha
    channel, the colours are laid over black with the latter.  Of a bent lens the pixels are those
    of its straight camera, scene.undistort.  Pixels without a value count in no mean.
    """
    if photo.lens is not None:  # what is made of it is in memory at the same time
        charge_pixels(photo.path, photo.view.size)
    image, file_size, known = decoded(
        photo.path, photo.counts, factor, 0, photo.no_value, photo.band
    )
    mask_image, has_alpha = None, image.mode == "RGBA"
    if photo.mask is not None:
        image = over_black(image)
        mask_image = load_mask(photo.mask, file_size, factor)
    made = partial(
        smaller, file_size=file_size, lens=photo.lens, factor=factor, one_of_many=one_of_many
    )
    image, gone = (made(image), None) if known is None else smaller_with_gaps(image, known, made)
    mask: np.ndarray | None = None
    if mask_image is not None:
        mask = np.asarray(made(mask_image))
    elif has_alpha:
        mask = np.asarray(image.getchannel("A"))
    if photo.lens is not None:
        beyond = lost(photo.lens, image.size, factor)
        gone = beyond if gone is None else beyond | gone
    return Pixels(np.asarray(image.convert("RGB")), mask, gone)


def load_mask(path: Path, file_size: tuple[int, int], factor: int = 1) -> Image.Image:
    """A mask of mode L, white where its photo counts, of the pixels that `decoded` gives.  BadFile.

    file_size: of the photo.  Masks of 0 and 1, as programs write truth values, are stretched.
    """
    mask, own_size, _ = decoded(path, None, factor, math.prod(file_size))
    mask = over_black(mask).convert("L")
    if mask.getextrema()[1] == 1:
        mask = mask.point(lambda value: 255 * value)
    if own_size == file_size:
        return mask
    refuse_other_view(own_size, file_size, f"{path}: the mask")
    return mask.resize(file_size, Image.Resampling.BOX)


def refuse_other_view(own: tuple[int, int], size: tuple[int, int], what: str) -> None:
    """Raises BadFile where something beside a photo has not its shape; sizes: width, height."""
    if not abs(own[0] * size[1] / (own[1] * size[0]) - 1) <= ASPECT:
        raise BadFile(
            f"{what} has {own[0]}x{own[1]} pixels, the photo {size[0]}x{size[1]}; both must show "
            "the same field of view"
        )


def has_alpha_channel(photo: Photo) -> bool:
    """Whether load_photo finds an alpha channel in the photo's file: its header says so."""
    if photo.counts is not None or photo.band:
        return False
    with open_image(photo.path) as image:
        return is_see_through(image)


def is_see_through(image: Image.Image) -> bool:
    """Whether an image that is colours or grey shades of a byte comes with an alpha channel."""
    grey = image.mode in (*GREY_16, FLOATS)
    return not grey and (image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info)


def over_black(image: Image.Image) -> Image.Image:
    """An image without an alpha channel; its colours times the one that it had."""
    if image.mode != "RGBA":
        return image
    return Image.alpha_composite(Image.new("RGBA", image.size, (0, 0, 0, 255)), image).convert(
        "RGB"
    )


def smaller(
    image: Image.Image,
    file_size: tuple[int, int],
    lens: ColmapCamera | None,
    factor: int,
    one_of_many: bool = False,
) -> Image.Image:
    """The image with the sides of its file divided by `factor`, straight where a lens is given.

    image: the whole file, perhaps smaller already by a divisor of the factor.
    """
    done = round(file_size[0] / image.width)  # pixels of the file a pixel
    if lens is None:
        across, down = (max(min(factor, side) // done, 1) for side in file_size)
        size = (max(file_size[0] // factor, 1), max(file_size[1] // factor, 1))
        if (across, down) == (1, 1):
            return image if size == image.size else image.crop((0, 0, *size))
        return image.reduce((across, down), (0, 0, size[0] * across, size[1] * down))
    width, height = pinhole_of(lens).size
    size = (max(width // factor, 1), max(height // factor, 1))
    if factor == 1 and not is_panorama(lens):
        return undistorted(image, lens, size)
    # Twice as many pixels as are wanted, out of about as many: fewer would blur, more cost time.
    more = max(factor // done // 2, 1)
    image, twice = image.reduce(more), (2 * size[0], 2 * size[1])
    one_of_many = one_of_many and math.prod(size) <= LARGEST
    if one_of_many or is_panorama(lens):  # a mesh would draw across a panorama's seam
        return resampled(image, lens, size, factor, done * more, one_of_many)
    return undistorted(image, lens, twice, factor / 2, done * more).reduce(2)


def decoded(
    path: Path,
    counts: tuple[float, float] | None,
    factor: int = 1,
    most: int = 0,
    no_value: NoValue = SAID_NOTHING,
    band: int = 0,
) -> Decoded:
    """An image file as bytes, and which of its pixels hold a value.

    band: as of open_image.

    most: pixels that it may have however few its bytes, where a photo of as many goes with it.
    no_value: what its capture says of them, beside what the file does.
    A JPEG comes smaller by a divisor of `factor`, at most half of it: it is decoded so, which
    costs less and is nearly the mean over the area.
    """
    own = (
        not band and counts is not None and is_radiometric(path)
    )  # its numbers, not the picture's colours
    with loaded(path, 1 if own else factor, most, band) as (image, size):
        if own or counts is not None or image.mode in (*GREY_16, FLOATS):
            numbers = radiometric_celsius(path, size) if own else np.asarray(image, np.float32)
            grey = shares(numbers, FLOATS if own else image.mode, counts, path)
            gone = without_value(image, numbers, no_value)
            if gone is not None:
                grey = np.where(gone, np.float32(0), grey)
            shown = Image.fromarray(np.rint(255 * grey).astype(np.uint8))
            return Decoded(shown, size, None if gone is None else known_mask(gone))
        gone = None
        if (no_value.numbers or stated_no_data(image)) and image.mode in SHADES:
            gone = without_value(image, np.asarray(image), no_value)
        if is_see_through(image):
            shown = image.convert("RGBA")
        else:
            shown = image.convert("L" if image.mode in ("L", "1") else "RGB")
        if gone is None:
            return Decoded(shown, size)
        known = known_mask(gone)
        pixels = np.array(shown)
        pixels[gone] = (0, 0, 0, 255)[: pixels.shape[2]] if pixels.ndim == 3 else 0
        return Decoded(Image.fromarray(pixels), size, known)


def known_mask(gone: np.ndarray) -> Image.Image:
    """Of mode L, 0 where (H, W) bool is set, else 255."""
    return Image.fromarray(np.where(gone, np.uint8(0), np.uint8(255)))


@contextmanager
def loaded(
    path: Path, factor: int = 1, most: int = 0, band: int = 0
) -> Iterator[tuple[Image.Image, tuple[int, int]]]:
    """The image with its pixels read, see `decoded`, and the size of its file.  Raises BadFile."""
    with open_image(path, band) as image:
        if bands := image.info.get("bands"):
            raise BadFile(
                f"{path}: a TIFF of {bands} bands; say with its modality's 'band', 1 to {bands}, "
                "which of them counts"
            )
        charge_pixels(path, image.size, most)
        width, height = image.size
        divisor = next((d for d in (8, 4, 2) if factor % d == 0 and factor >= 2 * d), 1)
        try:
            with quiet():
                if divisor > 1 and image.format == "JPEG":
                    image.draft(None, (width // divisor, height // divisor))
                refuse_scans(image, path)
                image.load()
        except BadFile:
            raise
        except BROKEN as error:
            raise BadFile(f"{path}: the image is cut off ({error}); copy it again") from None
        yield image, (width, height)


def read_pixels(
    path: Path, counts: tuple[float, float] | None = None
) -> tuple[np.ndarray, np.ndarray | None]:
    """rgb (H, W, 3) float32 0..1 and alpha (H, W) or None, with which the colours lie over black.

    counts: numbers of a grey photo that stand for 0 and 1.
    """
    with loaded(path) as (image, size):
        if counts is not None and is_radiometric(path):
            grey = shares(radiometric_celsius(path, size), FLOATS, counts, path)
            return np.repeat(grey[..., None], 3, axis=2), None
        if counts is not None or image.mode in (*GREY_16, FLOATS):
            grey = shares(np.asarray(image, np.float32), image.mode, counts, path)
            return np.repeat(grey[..., None], 3, axis=2), None
        if is_see_through(image):
            rgba = floats(image, "RGBA")
            alpha = rgba[..., 3].copy()
            rgba[..., :3] *= rgba[..., 3:]
            return np.ascontiguousarray(rgba[..., :3]), alpha
        return floats(image, "RGB"), None


def numbers_of(photo: Photo) -> np.ndarray:
    """(H, W) float32 of a grey photo's own numbers, as they are in its file; NaN: none."""
    with loaded(photo.path, band=photo.band) as (image, size):
        own = not photo.band and is_radiometric(photo.path)
        numbers = radiometric_celsius(photo.path, size) if own else np.asarray(image, np.float32)
        gone = without_value(image, numbers, photo.no_value)
        return numbers if gone is None else np.where(gone, np.float32(np.nan), numbers)


def charge_pixels(path: Path, size: tuple[int, int], most: int = 0) -> None:
    """BadFile where a picture has more pixels than its bytes can mean, or than there is memory."""
    bytes_there, pixels, whole = path.stat().st_size, size[0] * size[1], Memory()
    usual = usual_pixels(path, most)
    if pixels > (MOST_PIXELS if whole.asked else usual):
        allow = math.ceil(PIXEL * pixels / GB)
        more = f", or set {VARIABLE}={allow} (GB)" if pixels <= MOST_PIXELS else ""
        raise BadFile(
            f"{path}: {size[0]}x{size[1]} pixels, at most {usual:,} are read out of "
            f"{bytes_there:,} bytes; scale it down, save it again{more}"
        )
    # What it may have is given in pixels: of the account only the machine's bound counts.
    whole.of(path, PIXEL * MOST_PIXELS).charge(PIXEL * pixels, f"{pixels:,} pixels")


def usual_pixels(path: Path, most: int = 0) -> int:
    """How many pixels a picture of so few bytes may have; most: of what it goes with."""
    return min(MOST_PIXELS, max(FREE_PIXELS, PIXELS_A_BYTE * path.stat().st_size, most))


def floats(image: Image.Image, mode: str) -> np.ndarray:
    """(H, W, C) float32 0..1 of a picture in a mode of bytes, some rows at a time."""
    out = np.empty((image.height, image.width, len(mode)), np.float32)
    for start in range(0, image.height, ROWS):
        end = min(start + ROWS, image.height)
        out[start:end] = np.asarray(image.crop((0, start, image.width, end)).convert(mode))
    out /= 255
    return out


def shares(
    grey: np.ndarray, mode: str, counts: tuple[float, float] | None, path: Path
) -> np.ndarray:
    """(H, W) float32 0..1 of a grey photo's numbers; where there is none, anything of it."""
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
