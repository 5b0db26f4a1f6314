"""Label maps: which object each pixel of a photo shows, as an 8-bit grey PNG.

0 is the background, 1 to 254 are objects' labels, 255 says nothing about the pixel.
"""

import io
import math
from pathlib import Path

import numpy as np
from PIL import Image

from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.photo import loaded

MOST_LABEL = 254
SILENT = 255  # this pixel says nothing
PNG_MARK = b"\x89PNG\r\n\x1a\n"
GREY = 0  # PNG's colour type
KINDS = {2: "RGB", 3: "a palette", 4: "grey with alpha", 6: "RGB with alpha"}  # the others
ASPECT_SLACK = 1.0  # pixels by which a side may differ from the one that the aspect asks for
CURE = "save it as an 8-bit greyscale PNG whose values are the labels"


def read_label_map(
    path: Path, size: tuple[int, int], most: int = MOST_LABEL, silent: bool = True
) -> np.ndarray:
    """(H, W) uint8 labels of a photo of `size` (width, height) pixels.

    A map of another size and the same aspect is resized by nearest neighbour, never blended.
    most: the largest label; silent: whether 255 may stand for pixels that say nothing.
    Raises BadFile, one sentence.
    """
    labels = read_grey(path, math.prod(size))
    refuse_labels(labels, path, most, silent)
    return resized(labels, size, path)


def read_mask(path: Path, size: tuple[int, int], label: int | None = None) -> np.ndarray:
    """(H, W) bool: where a PNG of another program shows the object.

    label: the value that stands for it.  Without one the PNG has two values, and the higher one
    is the object.  Raises BadFile, also where no pixel is it.
    """
    grey = read_grey(path, math.prod(size))
    if label is None:
        values = np.unique(grey)
        if len(values) > 2:
            raise BadFile(
                f"{path}: the mask has {len(values)} values, {named(values)}; say with "
                "'mask_label' which of them is the object, or save it in black and white."
            )
        mask = grey > 0 if len(values) == 1 else grey == values[-1]
    else:
        mask = grey == label
    if not mask.any():
        what = "no pixel is white" if label is None else f"no pixel has the label {label}"
        raise BadFile(f"{path}: {what}; give a mask that shows the object.")
    if mask.all():
        raise BadFile(f"{path}: every pixel is the object; give a mask that shows its outline.")
    return resized(mask, size, path)


def read_grey(path: Path, most: int) -> np.ndarray:
    """(H, W) uint8 of an 8-bit grey PNG, as the values stand there.  Raises BadFile.

    most: pixels that it may have however few its bytes are: labels pack a thousandfold.
    """
    refuse_other_pngs(path)
    with loaded(path, most=most) as (image, _):
        if image.mode != "L":
            raise BadFile(f"{path}: its pixels are {image.mode}; {CURE}.")
        return np.array(image, np.uint8)


def refuse_other_pngs(path: Path) -> None:
    """By the header: Pillow stretches the values of PNGs with 2 or 4 bits a pixel."""
    if not path.is_file():
        raise BadFile(f"{path}: the label map is missing; put it there.")
    with path.open("rb") as file:
        head = file.read(26)
    if len(head) < 26 or not head.startswith(PNG_MARK) or head[12:16] != b"IHDR":
        raise BadFile(f"{path}: not a PNG; {CURE}.")
    bits, kind = head[24], head[25]
    if kind != GREY:
        raise BadFile(f"{path}: its colours are {KINDS.get(kind, 'unknown')}; {CURE}.")
    if bits != 8:
        raise BadFile(f"{path}: it has {bits} bits a pixel; {CURE}.")


def refuse_labels(labels: np.ndarray, path: Path, most: int, silent: bool) -> None:
    counts = np.bincount(labels.ravel(), minlength=256)
    if silent:
        counts[SILENT] = 0
    if (wrong := np.flatnonzero(counts[most + 1 :]) + most + 1).size:
        meant = f"0 is the background, 1 to {most} are objects"
        meant += ", 255 says nothing" if silent else ""
        raise BadFile(f"{path}: it has the label {wrong[0]}; {meant}.")


def resized(labels: np.ndarray, size: tuple[int, int], path: Path) -> np.ndarray:
    """(H, W) of the same kind in `size`, each pixel that of the nearest centre.  Raises BadFile."""
    (width, height), (rows, columns) = size, labels.shape
    if (columns, rows) == (width, height):
        return labels
    scale = max(width / columns, height / rows)
    # One side decides the scale, the other may be off by the rounding to whole pixels.
    off = max(abs(columns * scale - width), abs(rows * scale - height))
    if not off <= max(ASPECT_SLACK, scale * ASPECT_SLACK):
        raise BadFile(
            f"{path}: it has {columns}x{rows} pixels, its photo {width}x{height}; make the map as "
            "large as the photo."
        )
    row = ((np.arange(height) + 0.5) * rows / height).astype(int)
    column = ((np.arange(width) + 0.5) * columns / width).astype(int)
    return labels[row[:, None], column]


def write_label_map(labels: np.ndarray, path: Path) -> None:
    """(H, W) uint8 as a grey PNG, whole or not at all."""
    assert labels.dtype == np.uint8 and labels.ndim == 2
    data = io.BytesIO()
    Image.fromarray(labels).save(data, "PNG")
    write_whole(path, data.getvalue())


def named(values: np.ndarray) -> str:
    """A few of them for a message."""
    return ", ".join(map(str, values[:5])) + (", ..." if len(values) > 5 else "")
