"""AliceVision's and Meshroom's cameras.sfm or sfm.json (StructureFromMotion, ConvertSfMFormat).

Its numbers are texts.  What each version means: src/aliceVision/sfmDataIO/jsonIO.cpp.
"""

import math
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, is_number, read_json
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.foreign.foreign_frames import (
    Gathered,
    PhotoIndex,
    brown_lens,
    checked_lens,
    checked_size,
    world_from,
)
from shapeshift.scene.captures.scans.posed_frames import PosedFrames

MOST_BYTES = 1 << 30
MOST_ROWS = 1 << 24
# Versions of the file from which on
OFFSETS = (1, 2, 1)  # the principal point is told from the photo's middle
TWO_FOCALS = (1, 2, 0)  # focal lengths are two
FILM = (1, 2, 2)  # or millimetres across a sensor, and the two lengths' ratio
RATIO = (1, 2, 5)  # or the ratio of a pixel's sides
DISTORTIONS = (1, 2, 8)  # the distortion has a word of its own
DOWN = (1, 2, 11)  # the millimetres are those of the focal length down
# What its words mean here: number of radial numbers, or the kind.
RADIAL = {"radialk1": 1, "radial1": 1, "radialk3": 3, "radial3": 3, "brown": 3, "pinhole": 0,
          "none": 0, "": 0}  # fmt: skip
FISHEYE = ("fisheye", "fisheye4")
NO = ("0", "false", False)


def alicevision_frames(path: Path, photos: PhotoIndex) -> PosedFrames:
    """Poses: the camera's centre, and rotation camera from world column by column, OpenCV axes.

    Raises BadFile.
    """
    said = Fields(read_json(path, most_bytes=MOST_BYTES), str(path))
    version = tuple(int(n) for n in numbers(said, "version", 3, (1.0, 0.0, 0.0)))
    out = Gathered(path, "Meshroom", photos)
    lenses = {
        str(row.value("intrinsicId")): lens_of(row, version)
        for row in said.rows("intrinsics", MOST_ROWS, "intrinsic", 0)
    }
    poses = {}
    for row in said.rows("poses", MOST_ROWS, "pose", 0):
        place = row.object("pose").object("transform")
        rotation = np.array(numbers(place, "rotation", 9)).reshape(3, 3).T
        poses[str(row.value("poseId"))] = world_from(
            rotation, np.array(numbers(place, "center", 3))
        )
    rigs = rigs_of(said)
    for row in said.rows("views", MOST_ROWS, "view", 0):
        name = row.text("path")
        pose = poses.get(str(row.value("poseId", row.value("viewId", ""))))
        lens = lenses.get(str(row.value("intrinsicId", "")))
        if pose is not None and row.has("rigId") and row.value("isPoseIndependant", "1") in NO:
            pose = in_rig(pose, rigs.get((str(row.value("rigId")), str(row.value("subPoseId", 0)))))
        if pose is None:
            out.leave(name, "have no pose")
        elif lens is None:
            out.leave(name, "have a lens that is not read here (anamorphic, 3DE, fisheye1)")
        else:
            out.add(name, pose, lens)
    add_points(out, said)
    return out.finished()


def rigs_of(said: Fields) -> dict[tuple[str, str], np.ndarray]:
    """World from camera poses within a rig, by the rig's number and the place in it."""
    out = {}
    for rig in said.rows("rigs", MOST_ROWS, "rig", 0):
        for number, place in enumerate(rig.rows("subPoses", MOST_ROWS, "sub-pose", 0)):
            pose = place.object("pose")
            rotation = np.array(numbers(pose, "rotation", 9)).reshape(3, 3).T
            centre = np.array(numbers(pose, "center", 3))
            out[str(rig.value("rigId")), str(number)] = world_from(rotation, centre)
    return out


def in_rig(world_from_rig: np.ndarray, rig_from_camera: np.ndarray | None) -> np.ndarray | None:
    return None if rig_from_camera is None else world_from_rig @ rig_from_camera


def numbers(
    fields: Fields, key: str, count: int, default: tuple[float, ...] | None = None
) -> tuple[float, ...]:
    """So many, written as texts or as numbers; one alone need not be in a list."""
    value = fields.value(key, default)
    values = value if isinstance(value, list | tuple) else [value]
    try:
        found = tuple(float(v) for v in values if isinstance(v, str) or is_number(v))
    except (ValueError, OverflowError):
        found = ()
    if len(found) != len(values) or len(found) != count or not all(map(math.isfinite, found)):
        raise fields.error(key, f"{count} finite numbers")
    return found


def number(fields: Fields, key: str, default: float | None = None) -> float:
    return numbers(fields, key, 1, None if default is None else (default,))[0]


def lens_of(row: Fields, version: tuple[int, ...]) -> ColmapCamera | None:
    """None of lenses that are not read."""
    width, height = size = checked_size(number(row, "width"), number(row, "height"), row.where)
    kind = row.text("type", "").lower()
    if kind == "equirectangular":
        return ColmapCamera.panorama(size)
    bends = row.text("distortionType", "") if version >= DISTORTIONS else kind
    bends = bends.lower()
    if kind == "equidistant" or (bends not in RADIAL and bends not in FISHEYE):
        return None
    if version >= DISTORTIONS and row.text("undistortionType", "none").lower() not in ("none", ""):
        return None
    fx, fy = focal_lengths(row, version, size)
    cx, cy = numbers(row, "principalPoint", 2)
    if version >= OFFSETS:
        cx, cy = cx + width / 2, cy + height / 2
    listed = row.value("distortionParams", [])
    count = len(listed) if isinstance(listed, list) else 0
    each = numbers(row, "distortionParams", count) if count else ()
    pinhole = (fx, fy, cx, cy)
    if bends in FISHEYE:
        k = (*each, 0.0, 0.0, 0.0, 0.0)[:4]
        return checked_lens("OPENCV_FISHEYE", size, (*pinhole, *k), row.where)
    radial = each[: RADIAL[bends]]
    tangential = (*each[3:], 0.0, 0.0)[:2] if bends == "brown" else (0.0, 0.0)
    return brown_lens(size, pinhole, radial, tangential, row.where)


def focal_lengths(
    row: Fields, version: tuple[int, ...], size: tuple[int, int]
) -> tuple[float, float]:
    """Pixels across and down, as the file's version has them."""
    if version >= FILM or (row.has("focalLength") and not row.has("pxFocalLength")):
        film = number(row, "sensorWidth", 36.0)
        across = number(row, "focalLength") / (film or math.nan) * size[0]
        ratio = number(row, "pixelRatio", 1.0)
        if not (math.isfinite(across) and ratio > 0):
            raise BadFile(f"{row.where}: 'sensorWidth' or 'pixelRatio' is 0; export it again")
        if version >= DOWN:
            return across / ratio, across
        return across, across / ratio if version < RATIO else across * ratio
    if version >= TWO_FOCALS:
        both = row.value("pxFocalLength")
        count = len(both) if isinstance(both, list) else 1
        found = numbers(row, "pxFocalLength", min(count, 2))
        return found[0], found[-1]
    f = number(row, "pxFocalLength")
    return f, f


def add_points(out: Gathered, said: Fields) -> None:
    rows = said.value("structure", None)
    if not isinstance(rows, list) or not rows:
        return
    try:
        out.points = np.array([row["X"] for row in rows], np.float64).reshape(-1, 3)
        if all("color" in row for row in rows):
            out.colors = np.array([row["color"] for row in rows], np.float64).reshape(-1, 3) / 255
    except (TypeError, ValueError, KeyError, OverflowError):
        raise BadFile(f"{said.where}: a point of 'structure' has no three numbers 'X'") from None
