"""Depth photos: what a frame says of them, and their metres in the size that is asked for."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields
from shapeshift.runtime_models.files.memory import Memory
from shapeshift.runtime_models.files.npy import BAD_HEADER
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.photo_view import subject_distance
from shapeshift.scene.capture_files import find_file
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.photo import (
    BROKEN,
    MOST_PIXELS,
    charge_pixels,
    open_image,
    quiet,
    refuse_other_view,
)
from shapeshift.scene.captures.radiometric.no_value import FLOATS, GREY_16, without_value
from shapeshift.scene.captures.undistort import pixels_of, straight_pixels

NAMES = ("depth_path", "depth_file_path")  # ours and instant-ngp's; nerfstudio's
FLOAT_UNIT = "depth_unit_scale_factor"  # nerfstudio's, of floats as well
UNITS = ("depth_unit", "integer_depth_scale", FLOAT_UNIT)  # ours; instant-ngp's
MILLIMETRES = 0.001  # metres a step where nothing is said
IN_MILLIMETRES = "Its depth photos of floats are in millimetres, by how far away their subject is."
LOOKED_AT, FEW_POINTS = 3, 30  # photos, points: to tell whether a unit can be right
OTHER_UNIT = 8  # times: more than this the points of a scene do not lie behind what is seen
DEPTH = 12  # bytes of memory a number of a .npy
FARTHEST = 1e6  # metres: beyond that nothing was measured
METRES = f"a length above 0 and up to {FARTHEST:g} metres"


def with_depth(photo: Photo, entry: Mapping, folder: Path, where: str) -> Photo:
    """The photo with its frame's depth photo, if that names one that is there, and its units."""
    fields = Fields(entry, where)
    key = next(filter(fields.has, UNITS), None)
    for stated in filter(fields.has, UNITS):
        if not fields.number(stated, wanted=METRES, high=FARTHEST) > 0:
            raise fields.error(stated, METRES)
    unit = fields.number(key) if key else MILLIMETRES
    of_floats = fields.number(FLOAT_UNIT) if fields.has(FLOAT_UNIT) else 1.0
    path = named_beside(fields, NAMES, folder)
    if path is not None:
        refuse_other_view(depth_size(path), photo.file_size, f"{where}: the depth photo")
    return replace(photo, depth=path, depth_unit=unit, float_depth_unit=of_floats)


def named_beside(fields: Fields, names: Sequence[str], folder: Path) -> Path | None:
    """The file that a frame names, by the first of some names that it has, if it is there."""
    name = next((text for key in names if (text := fields.text(key, ""))), "")
    path = find_file(folder, name, ("",)).path if name else None
    return path if path and os.path.isfile(path) else None  # Path.is_file does not take any text


def depth_size(path: Path) -> tuple[int, int]:
    """(width, height) of a depth photo by its header; BadFile where it is none."""
    if path.suffix.lower() == ".npy":
        height, width = _array(path).shape
        return width, height
    with open_image(path) as image:
        if image.mode not in (*GREY_16, FLOATS):
            raise BadFile(
                f"{path_end(path)}: a depth photo is greyscale of 16 bits or of floats, or a .npy; "
                f"this one is {image.mode}"
            )
        return image.size


def load_depth(photo: Photo, factor: int | None = None) -> np.ndarray:
    """(H, W) float32 metres along the view of a photo that has depth; 0 where none is known.

    factor: as in load_photo, at each of whose pixels it then lies; None: as it is in its file.
    """
    path = photo.depth
    assert path is not None, "asked of photos that have one"
    if path.suffix.lower() == ".npy":
        found = _array(path)
        values, floats = np.array(found, np.float32), found.dtype.kind == "f"
    else:
        values, floats = _pixels(path, math.prod(photo.file_size))
    values *= np.float32(photo.float_depth_unit if floats else photo.depth_unit)
    known = (values > 0) & (values <= FARTHEST)  # NaN is not
    values[~known] = 0
    return values if factor is None else at_pixels(values, photo, factor)


def at_pixels(values: np.ndarray, photo: Photo, factor: int) -> np.ndarray:
    """What of (H, W, ...) lies at the centre of each pixel of the photo as training sees it.

    0 where nothing does.  Means would put points between an object and what is behind it.
    """
    width, height = photo.view.divided(factor).size
    x, y = ((np.arange(side) + 0.5) * factor for side in (width, height))
    if photo.lens is not None:
        places = straight_pixels(photo.lens, x, y)
        across, below = (places / photo.file_size * values.shape[1::-1]).transpose(2, 0, 1)
        inside = (across >= 0) & (below >= 0)
        inside &= (across < values.shape[1]) & (below < values.shape[0])
        column, row = (np.where(inside, at, 0).astype(int) for at in (across, below))
        found = values[row, column]
        found[~inside] = 0
        return found
    rows, columns = (
        np.minimum((at * old / side).astype(int), old - 1)
        for at, old, side in zip((y, x), values.shape[:2], photo.view.size[::-1], strict=True)
    )
    return values[np.ix_(rows, columns)]


def in_millimetres(capture: Capture, entries: Sequence[Mapping]) -> Capture:
    """The capture, with its depth of floats taken for millimetres where nobody states a unit and
    points, or else where the cameras look, lie a thousandth as deep: as nerfstudio has them.
    """
    deep = [photo for photo in capture.photos if photo.depth is not None and holds_floats(photo)]
    if not deep or any(entry.get(FLOAT_UNIT) is not None for entry in entries):
        return capture
    some = deep[:: -(-len(deep) // LOOKED_AT)]
    ratios = np.zeros(0)
    if capture.points is not None:
        ratios = np.concatenate([_over_points(photo, capture.points) for photo in some])
    if (
        len(ratios) < FEW_POINTS
        and (away := subject_distance([photo.view for photo in capture.photos])) > 0
    ):
        ratios = np.concatenate([values[values > 0] for values in map(load_depth, some)]) / away
    if len(ratios) < FEW_POINTS:
        return capture
    if not 1000 / OTHER_UNIT < float(np.median(ratios)) < 1000 * OTHER_UNIT:
        return capture
    photos = tuple(
        replace(photo, float_depth_unit=MILLIMETRES) if photo.depth is not None else photo
        for photo in capture.photos
    )
    return replace(capture, photos=photos, doubts=(*capture.doubts, IN_MILLIMETRES))


def holds_floats(photo: Photo) -> bool:
    assert photo.depth is not None, "asked of photos that have one"
    if photo.depth.suffix.lower() == ".npy":
        return _array(photo.depth).dtype.kind == "f"
    with open_image(photo.depth) as image:
        return image.mode == FLOATS


def refuse_other_units(capture: Capture, where: str) -> None:
    """Raises BadFile where depth photos are some other unit than the points that they show.

    Looks at a few photos; without points, or where too few lie in the picture, nothing is said.
    Points may lie behind what a photo shows, so only what no scene explains is refused.
    """
    with_depth = [photo for photo in capture.photos if photo.depth is not None]
    if capture.points is None or not with_depth:
        return
    some = with_depth[:: -(-len(with_depth) // LOOKED_AT)]
    ratios = np.concatenate([_over_points(photo, capture.points) for photo in some])
    if len(ratios) < FEW_POINTS:
        return
    ratio = float(np.median(ratios))
    if not 1 / OTHER_UNIT < ratio < OTHER_UNIT:
        unit = f"{10.0 ** -np.round(np.log10(ratio)):g}"
        raise BadFile(
            f"{where}: the depth photos are {ratio:.3g} times as deep as the points that they "
            f"show; multiply 'depth_unit' (or the numbers of a .npy) by about {unit}"
        )


def _over_points(photo: Photo, points: np.ndarray) -> np.ndarray:
    """What a depth photo says over how deep the points in the picture lie."""
    depth, view = load_depth(photo), photo.view
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    x, y, z = (points @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]).T
    ahead = z > view.near
    x, y, z = x[ahead], y[ahead], z[ahead]
    height, width = depth.shape
    if photo.lens is None:
        places = np.stack([fx * x / z + cx, fy * y / z + cy], axis=1)
    else:
        places = np.nan_to_num(pixels_of(photo.lens, np.stack([x / z, y / z], axis=1)), nan=-1)
    column, row = (places / photo.file_size * (width, height)).T
    inside = (column >= 0) & (row >= 0) & (column < width) & (row < height)
    seen = depth[row[inside].astype(int), column[inside].astype(int)]
    return (seen / z[inside])[seen > 0]


def _pixels(path: Path, most: int) -> tuple[np.ndarray, bool]:
    """(H, W) float32 of an image, and whether it holds floats; of 16 bits 65535 stands for all
    that is too far, and becomes 0.

    most: pixels of the photo that it goes with.
    """
    with open_image(path) as image:
        charge_pixels(path, image.size, most)
        try:
            with quiet():
                image.load()
        except BROKEN as error:
            raise BadFile(f"{path_end(path)}: cut off ({error}); copy it again") from None
        values, floats = np.array(image, np.float32), image.mode == FLOATS
        gone = without_value(image, np.asarray(image))
    if gone is not None:
        values[gone] = 0
    if not floats:
        values[values >= 65535] = 0
    return values, floats


def mapped_numbers(path: Path) -> np.ndarray:
    """A view of the numbers of a .npy file, whatever their shape: nothing is read yet."""
    try:
        return np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, OSError, OverflowError, EOFError, *BAD_HEADER):
        raise BadFile(f"{path_end(path)}: no .npy of plain numbers; save it again") from None


def _array(path: Path) -> np.ndarray:
    """A view of the (H, W) numbers of a .npy file: nothing is read yet."""
    values = mapped_numbers(path)
    where = path_end(path)
    if values.ndim == 3 and 1 in (values.shape[0], values.shape[2]):  # with an axis of channels
        values = values[0] if values.shape[0] == 1 else values[..., 0]
    if values.ndim != 2 or values.dtype.kind not in "fui" or not 0 < values.size <= MOST_PIXELS:
        raise BadFile(
            f"{where}: a depth photo is (H, W) numbers, this is {values.shape!s:.40} of "
            f"{values.dtype}"
        )
    Memory().of(path).charge(DEPTH * values.size, f"{values.size:,} numbers")
    return values
