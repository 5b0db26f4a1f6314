"""Normal maps: what a frame says of them, and the directions in the size that is asked for."""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields
from shapeshift.runtime_models.files.memory import Memory
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.depth_photo import (
    LOOKED_AT,
    at_pixels,
    mapped_numbers,
    named_beside,
)
from shapeshift.scene.captures.photo import (
    BROKEN,
    MOST_PIXELS,
    charge_pixels,
    open_image,
    quiet,
    refuse_other_view,
)

NAMES = ("normal_path", "normal_file_path")
AXES = "normal_convention"  # of the camera: opengl (y up, z towards it), opencv (y down, z forward)
FLIPPED = {"opengl": (1, 1, 1), "opencv": (1, -1, -1)}  # to eye axes
MODES = ("RGB", "RGBA")
LENGTH = (0.5, 1.5)  # of a direction: what is shorter or longer stands for none
NUMBER = 36  # bytes of memory a direction of a .npy
FACING = 0.9  # share of directions that has to look at the camera: all that it sees does


def normals_of(
    entry: Mapping, folder: Path, size: tuple[int, int], where: str
) -> tuple[Path | None, str]:
    """The normal map of a frame, if it names one that is there, and the axes it is in."""
    fields = Fields(entry, where)
    axes = fields.text(AXES, "opengl")
    if axes not in FLIPPED:
        raise fields.error(AXES, " or ".join(FLIPPED))
    path = named_beside(fields, NAMES, folder)
    if path is not None:
        refuse_other_view(normals_size(path), size, f"{where}: the normal map")
    return path, axes


def normals_size(path: Path) -> tuple[int, int]:
    """(width, height) of a normal map by its header; BadFile where it is none."""
    if path.suffix.lower() == ".npy":
        height, width, _ = _array(path).shape
        return width, height
    with open_image(path) as image:
        if image.mode not in MODES:
            raise BadFile(
                f"{path_end(path)}: a normal map is a picture in colours, or a .npy of (H, W, 3) "
                f"numbers; this one is {image.mode}"
            )
        return image.size


def load_normals(photo: Photo, factor: int | None = None) -> np.ndarray:
    """(H, W, 4) int8 of a photo that has a normal map: 127 times the direction, eye axes, and 1;
    all 0 where none is known.

    factor: as in load_photo, at each of whose pixels it then lies; None: as it is in its file.
    """
    path = photo.normals
    assert path is not None, "asked of photos that have one"
    if path.suffix.lower() == ".npy":
        values = np.array(_array(path), np.float32)
    else:
        values = _colors(path, math.prod(photo.file_size)).astype(np.float32) / 127.5 - 1
    if factor is not None:
        values = at_pixels(values, photo, factor)
    with np.errstate(over="ignore", invalid="ignore"):
        length = np.sqrt(np.square(values).sum(axis=2, keepdims=True))
        known = (length >= LENGTH[0]) & (length <= LENGTH[1])  # NaN is not
        toward_eye = np.array(FLIPPED[photo.normal_axes], np.float32)
        steps = values / np.where(known, length, 1) * toward_eye * 127
    steps = np.where(known, np.rint(steps), 0)
    return np.concatenate([steps, known], axis=2).astype(np.int8)


def refuse_other_axes(capture: Capture, where: str) -> None:
    """Raises BadFile where surfaces look away from the cameras that see them: other axes.

    Looks at a few photos.  Axes that are mirrored alone may look at the camera still.
    """
    mapped = [photo for photo in capture.photos if photo.normals is not None]
    facing, count = 0, 0
    for photo in mapped[:: max(-(-len(mapped) // LOOKED_AT), 1)]:
        normals = load_normals(photo, 1)
        height, width = normals.shape[:2]
        _, fx, fy, cx, cy = photo.view.pinhole()
        x = (np.arange(width, dtype=np.float32) + 0.5 - cx) / fx
        y = (np.arange(height, dtype=np.float32)[:, None] + 0.5 - cy) / fy
        away = x * normals[..., 0] - y * normals[..., 1] - normals[..., 2].astype(np.float32)
        facing += int((away < 0).sum())
        count += int(normals[..., 3].sum())
    if not facing >= FACING * count:
        raise BadFile(
            f"{where}: {100 - 100 * facing / count:.0f} % of the directions in the normal maps "
            f"look away from the camera; they have to be in the camera's own axes: x right, y up, "
            f"z towards the camera, or y down and z forward with '{AXES}': 'opencv'"
        )


def _colors(path: Path, most: int) -> np.ndarray:
    """(H, W, 3) bytes; black where it is transparent.  most: pixels of the photo."""
    with open_image(path) as image:
        charge_pixels(path, image.size, most)
        try:
            with quiet():
                image.load()
        except BROKEN as error:
            raise BadFile(f"{path_end(path)}: cut off ({error}); copy it again") from None
        values = np.array(image, np.uint8)
    if values.shape[2] == 4:
        values[values[..., 3] < 128] = 0
    return values[..., :3]


def _array(path: Path) -> np.ndarray:
    """A view of the (H, W, 3) numbers of a .npy file: nothing is read yet."""
    values, where = mapped_numbers(path), path_end(path)
    good = values.ndim == 3 and values.shape[2] == 3 and values.dtype.kind == "f"
    if not (good and 0 < values.size <= 3 * MOST_PIXELS):
        raise BadFile(
            f"{where}: a normal map is (H, W, 3) floats, this is {values.shape!s:.40} of "
            f"{values.dtype}"
        )
    count = values.size // 3
    Memory().of(path).charge(NUMBER * count, f"{count:,} directions")
    return values
