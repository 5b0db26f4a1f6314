"""Pixels of a photo that hold no value: which they are, and photos made smaller without them."""

import math
import re
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from PIL import Image

FLOATS = "F"  # how PIL names floating-point greyscale
GREY_16 = ("I;16", "I;16B", "I;16L", "I")  # how PIL names 16-bit greyscale
SHADES = ("L", "LA", "P", "RGB", "RGBA")  # modes of bytes that a no-data number can be told in
GDAL_NODATA = 42113  # tag of TIFF
# Nothing that is measured is as large, or the product of two would be none of float32: programs
# write the ends of float32 for no data, with the tag or without.
LARGEST = 1e30
ROUNDING = 5e-7  # of a number that is written as text, read back and kept as float32
FEW_DIGITS = 1e-4  # the same of one beyond LARGEST, such as -3.4e38
KNOWN = 128  # of 255: a pixel that was made smaller is known where half of its area is
NUMBERS_OF_A_TAG = 16  # at most; GDAL writes one


class NoValue(NamedTuple):
    """What a capture says of numbers in the photos of a modality that are no values."""

    numbers: tuple[float, ...] = ()  # that stand for none; NaN and Inf do in any case
    valid_range: tuple[float, float] | None = None  # what is below or above was not measured


SAID_NOTHING = NoValue()


def stated_no_data(image: Image.Image) -> tuple[float, ...]:
    """The numbers that stand for no value by the header of an image file.

    GDAL's tag of a TIFF, a text; the transparent grey of a PNG of 16 bits, which GDAL reads so.
    """
    if image.mode in GREY_16 and image.format == "PNG":
        grey = image.info.get("transparency")
        return (float(grey),) if isinstance(grey, int | float) else ()
    text = getattr(image, "tag_v2", {}).get(GDAL_NODATA)
    if isinstance(text, bytes):
        text = text.decode("ascii", "replace")
    if not isinstance(text, str):
        return ()
    found = []
    for word in re.split(r"[\s,;\0]+", text)[: NUMBERS_OF_A_TAG + 2]:
        try:
            found.append(float(word))
        except ValueError:
            continue
    return tuple(found)


def may_lack_values(image: Image.Image) -> bool:
    """Whether pixels may hold no value, by the header alone."""
    return image.mode == FLOATS or bool(stated_no_data(image))


def without_value(
    image: Image.Image, numbers: np.ndarray, said: NoValue = SAID_NOTHING
) -> np.ndarray | None:
    """(H, W) bool which pixels hold no value; None: all hold one.

    image: the opened file; numbers: its pixels, (H, W) or (H, W, C), of which all C have to be so.
    """
    no_data = (*said.numbers, *stated_no_data(image))
    out: np.ndarray | None = None
    if numbers.dtype.kind == "f" and image.mode not in GREY_16:
        known = np.abs(numbers) <= LARGEST  # NaN and Inf are not
        out = None if known.all() else ~known
    for number in no_data:
        if not math.isfinite(number):
            continue
        near = FEW_DIGITS if abs(number) > LARGEST else ROUNDING
        gone = np.abs(numbers - np.float64(number)) <= near * abs(number)
        out = gone if out is None else out | gone
    if said.valid_range is not None:
        low, high = said.valid_range
        gone = ~((numbers >= low) & (numbers <= high))
        out = gone if out is None else out | gone
    if out is not None and out.ndim == 3:
        out = np.asarray(out.all(axis=2))
    return out if out is not None and out.any() else None


def smaller_with_gaps(
    image: Image.Image, known: Image.Image, smaller: Callable[[Image.Image], Image.Image]
) -> tuple[Image.Image, np.ndarray]:
    """An image after `smaller`, which takes means, and (H, W) bool which pixels are unknown then.

    known: of mode L, 0 where the image has no value, and there is 0 itself.  Each pixel is the mean
    of what is known in its area.  It is unknown itself where that is less than half: so as much of
    a photo is known as before, and no pixel stands for a place that is mostly beside it.  What is
    unknown has the colour of what is known around it, whatever the file holds there.
    """
    share = np.asarray(smaller(known))
    image = smaller(image)
    pixels, mode = np.array(image), image.mode
    unknown = share < KNOWN
    partly = ~unknown & (share < 255)
    colors = pixels[..., :3] if pixels.ndim == 3 else pixels[..., None]  # a view
    if partly.any():
        whole = colors[partly] * (255 / share[partly].astype(np.float32))[:, None]
        colors[partly] = np.rint(np.minimum(whole, 255))
    if unknown.any():
        colors[unknown] = np.rint(filled(colors.astype(np.float32), unknown)[unknown])
    return Image.fromarray(pixels, mode), unknown


def filled(values: np.ndarray, unknown: np.ndarray) -> np.ndarray:
    """(H, W, C) float32 whose unknown pixels have means of what is known around them; 0: nothing.

    From pictures of half the size, and of these again, as far as it takes.
    """
    if not unknown.any():
        return values
    if unknown.all():
        return np.zeros_like(values)
    height, width, channels = values.shape
    odd = (0, height % 2), (0, width % 2)
    known = np.pad(~unknown, odd)
    shape = known.shape[0] // 2, 2, known.shape[1] // 2, 2
    values = np.where(unknown[..., None], np.float32(0), values)
    sums = np.pad(values, (*odd, (0, 0))).reshape(*shape, channels).sum(axis=(1, 3))
    counts = known.reshape(shape).sum(axis=(1, 3))
    coarse = filled(sums / np.maximum(counts, 1)[..., None].astype(np.float32), counts == 0)
    coarse = coarse.repeat(2, axis=0).repeat(2, axis=1)[:height, :width]
    return np.where(unknown[..., None], coarse, values)


def resized_numbers(numbers: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(H, W) float32 bilinear in another size (W, H); NaN stays NaN and spreads over no neighbour.

    A pixel has a value where half of what it is made of has.
    """
    how = Image.Resampling.BILINEAR
    known = np.isfinite(numbers)
    if known.all():
        return np.asarray(Image.fromarray(numbers).resize(size, how), np.float32)
    parts = (np.where(known, numbers, np.float32(0)), known.astype(np.float32))
    total, share = (np.asarray(Image.fromarray(part).resize(size, how)) for part in parts)
    return np.where(share >= 0.5, total / np.maximum(share, 0.5), np.nan).astype(np.float32)
