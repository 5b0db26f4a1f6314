"""Cameras in JSON of three programs that find them: OpenSfM, OpenMVG and AliceVision.

OpenSfM's reconstruction.json, and the folders of OpenDroneMap, which hold one or its shots:
lengths on the photo are parts of its longer side, from its middle (doc/source/geometry.rst); the
world has z up, metres where there was GPS.
"""

import math
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, is_number, read_json
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture_rules import LARGEST_NUMBER
from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.foreign.foreign_frames import (
    Z_UP,
    Gathered,
    PhotoIndex,
    brown_lens,
    camera_inverse,
    checked_lens,
    checked_size,
    world_from,
)
from shapeshift.scene.captures.scans.posed_frames import PosedFrames

MOST_BYTES = 1 << 30
NO_LENS = "have a lens that is not read here"
ROUND = ("perspective", "simple_radial", "radial")  # and how the others are called
PANORAMAS = ("spherical", "equirectangular")
SHOTS = "odm_report/shots.geojson"  # of OpenDroneMap


def opensfm_frames(path: Path, photos: PhotoIndex) -> PosedFrames:
    """The largest of its reconstructions; poses are an axis times an angle and a translation, from
    world to camera with OpenCV axes.  Raises BadFile.
    """
    parts = read_json(path, most_bytes=MOST_BYTES)
    if not (isinstance(parts, list) and parts and all(isinstance(p, dict) for p in parts)):
        raise BadFile(f"{path} holds no list of reconstructions; run OpenSfM's reconstruct again")
    sizes = [len(p["shots"]) if isinstance(p.get("shots"), dict) else 0 for p in parts]
    said = Fields(parts[int(np.argmax(sizes))], str(path))
    out = Gathered(path, "OpenSfM", photos, Z_UP)
    if len(parts) > 1:
        out.doubts.append(
            f"It holds {len(parts)} reconstructions, which have no common place; the largest is "
            f"used, {max(sizes)} of {sum(sizes)} photos."
        )
    cameras = said.object("cameras")
    lenses = {name: opensfm_lens(cameras.object(name)) for name in cameras.data}
    shots = said.object("shots")
    for name in shots.data:
        shot = shots.object(name)
        lens = lenses.get(shot.text("camera", ""))
        pose = camera_inverse(rotation_of(shot), shot.numbers("translation", 3))
        out.add(name, pose, lens) if lens else out.leave(name, NO_LENS)
    add_opensfm_points(out, said)
    return out.finished()


def odm_frames(path: Path, photos: PhotoIndex) -> PosedFrames:
    """OpenDroneMap's shots.geojson with cameras.json: the camera's place, and the turn from world
    to camera.  Raises BadFile.
    """
    said = Fields(read_json(path, most_bytes=MOST_BYTES), str(path))
    table = next((p / "cameras.json" for p in (path.parent.parent, path.parent)
                  if (p / "cameras.json").is_file()), None)  # fmt: skip
    if table is None:
        raise BadFile(
            f"{path}: cameras.json, which has its lenses, is missing; copy the whole folder"
        )
    cameras = Fields(read_json(table, most_bytes=MOST_BYTES), str(table))
    lenses = [opensfm_lens(cameras.object(name)) for name in cameras.data]
    out = Gathered(path, "OpenDroneMap", photos, Z_UP)
    for row in said.rows("features", 1 << 24, "feature", 0):
        shot = row.object("properties")
        name = shot.text("filename")
        size = (shot.value("width", 0), shot.value("height", 0))
        alike = [x for x in lenses if x is not None and x.size == size]
        near = [x for x in alike if is_near(x, shot)]
        lens = next(iter(near or alike), None) if len(lenses) > 1 else lenses[0] if lenses else None
        pose = world_from(rotation_of(shot), np.array(shot.numbers("translation", 3)))
        out.add(name, pose, lens) if lens else out.leave(name, NO_LENS)
    return out.finished()


def is_near(lens: ColmapCamera, shot: Fields) -> bool:
    """Whether a shot's focal length is the lens's."""
    focal = shot.value("focal", None)
    return isinstance(focal, float) and abs(focal * max(lens.size) - lens.focal[0]) < 1e-3


def rotation_of(shot: Fields) -> np.ndarray:
    """(3, 3) of an axis times an angle in radians."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(shot.numbers("rotation", 3)).as_matrix()


def opensfm_lens(said: Fields) -> ColmapCamera | None:
    """None of lenses that are not read."""
    size = checked_size(said.value("width"), said.value("height"), said.where)
    kind, scale = said.text("projection_type", "perspective"), max(size)
    if kind in PANORAMAS:
        return ColmapCamera.panorama(size)

    def number(key: str) -> float:
        return said.number(key, 0.0)

    f = number("focal") or number("focal_x")
    fx, fy = scale * (number("focal_x") or f), scale * (number("focal_y") or f)
    centre = (size[0] / 2 + scale * number("c_x"), size[1] / 2 + scale * number("c_y"))
    k = [number(f"k{i}") for i in range(1, 7)]
    p = (number("p1"), number("p2"))
    pinhole = (fx, fy, *centre)
    if kind in ROUND:
        return brown_lens(size, pinhole, k[:2], (0.0, 0.0), said.where)
    if kind == "brown":
        return brown_lens(size, pinhole, k[:3], p, said.where)
    if kind in ("fisheye", "fisheye_opencv"):
        return checked_lens("OPENCV_FISHEYE", size, (*pinhole, *k[:4]), said.where)
    if kind in ("fisheye62", "fisheye624"):
        s = [number(f"s{i}") for i in range(4)]
        params = (*pinhole, *k, p[1], p[0], *s)
        return checked_lens("RAD_TAN_THIN_PRISM_FISHEYE", size, params, said.where)
    return None


def add_opensfm_points(out: Gathered, said: Fields) -> None:
    points = said.value("points", None)
    if not isinstance(points, dict) or not points:
        return
    try:
        rows = list(points.values())
        out.points = np.array([row["coordinates"] for row in rows], np.float64).reshape(-1, 3)
        out.colors = np.array([row["color"] for row in rows], np.float64).reshape(-1, 3) / 255
    except (TypeError, ValueError, KeyError, OverflowError):
        raise BadFile(f"{said.where}: a point has no three coordinates and color") from None


# OpenMVG's sfm_data.json: views, intrinsics and extrinsics as cereal writes them.

MOST_ROWS = 1 << 24
BENDS = {"disto_k1": 1, "disto_k3": 3, "disto_t2": 5, "fisheye": 4}  # and how many numbers


def openmvg_frames(path: Path, photos: PhotoIndex) -> PosedFrames:
    """Poses: rotation camera from world, rows, OpenCV axes, and the camera's centre.

    Raises BadFile.
    """
    said = Fields(read_json(path, most_bytes=MOST_BYTES), str(path))
    out = Gathered(path, "OpenMVG", photos)
    names: dict[int, str] = {}  # of polymorphic types: only the first of a kind says its name
    lenses: dict[str, ColmapCamera | None] = {}
    for row in said.rows("intrinsics", MOST_ROWS, "intrinsic", 0):
        lenses[str(row.value("key", None))] = openmvg_lens(row, names)
    poses = {}
    for row in said.rows("extrinsics", MOST_ROWS, "extrinsic", 0):
        pose = row.object("value")
        rotation = rows_of(pose, "rotation", 3)
        poses[str(row.value("key", None))] = world_from(rotation, pose.numbers("center", 3))
    for row in said.rows("views", MOST_ROWS, "view", 0):
        view = row.object("value").object("ptr_wrapper").object("data")
        name = "/".join(filter(None, (view.text("local_path", ""), view.text("filename"))))
        found = poses.get(str(view.value("id_pose", None)))
        lens = lenses.get(str(view.value("id_intrinsic", None)))
        if found is None:
            out.leave(name, "have no pose")
        elif lens is None:
            out.leave(name, "have no lens that is read here")
        else:
            out.add(name, found, lens)
    add_openmvg_points(out, said)
    return out.finished()


def rows_of(fields: Fields, key: str, count: int) -> np.ndarray:
    """(count, count) a matrix of rows.  Raises BadFile."""
    rows = fields.typed(key, list)
    if not (isinstance(rows, list) and len(rows) == count):
        raise fields.error(key, f"{count} rows of {count} numbers")
    return np.array([Fields({key: row}, fields.where).numbers(key, count) for row in rows])


def openmvg_lens(row: Fields, names: dict[int, str]) -> ColmapCamera | None:
    value = row.object("value")
    number = value.value("polymorphic_id", 0)
    number = number & ~(1 << 31) if isinstance(number, int) else 0
    kind = names[number] = value.text("polymorphic_name", names.get(number, ""))
    data = value.object("ptr_wrapper").object("data")
    base = data
    while base.has("value0") and "width" not in base.data:  # an older form nests what is common
        base = base.object("value0")
    size = checked_size(base.value("width"), base.value("height"), row.where)
    if kind == "spherical":
        return ColmapCamera.panorama(size)
    f = base.number("focal_length")
    pinhole = (f, f, *base.numbers("principal_point", 2))
    key = next((key for key in BENDS if data.has(key)), "")
    if not key:
        return brown_lens(size, pinhole, (), (0.0, 0.0), row.where)
    numbers = data.numbers(key, BENDS[key], most=LARGEST_NUMBER)
    if key == "fisheye":
        return checked_lens("OPENCV_FISHEYE", size, (*pinhole, *numbers), row.where)
    tangential = numbers[3:] or (0.0, 0.0)
    return brown_lens(size, pinhole, numbers[:3], tangential, row.where)


def add_openmvg_points(out: Gathered, said: Fields) -> None:
    rows = said.value("structure", None)
    if not isinstance(rows, list) or not rows:
        return
    try:
        out.points = np.array([row["value"]["X"] for row in rows], np.float64).reshape(-1, 3)
    except (TypeError, ValueError, KeyError, OverflowError):
        raise BadFile(f"{said.where}: a point of 'structure' has no three numbers 'X'") from None


# AliceVision's and Meshroom's cameras.sfm or sfm.json (StructureFromMotion, ConvertSfMFormat).
#
# Its numbers are texts.  What each version means: src/aliceVision/sfmDataIO/jsonIO.cpp.
#
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
        str(row.value("intrinsicId")): alicevision_lens(row, version)
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
    add_alicevision_points(out, said)
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


def alicevision_lens(row: Fields, version: tuple[int, ...]) -> ColmapCamera | None:
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


def add_alicevision_points(out: Gathered, said: Fields) -> None:
    rows = said.value("structure", None)
    if not isinstance(rows, list) or not rows:
        return
    try:
        out.points = np.array([row["X"] for row in rows], np.float64).reshape(-1, 3)
        if all("color" in row for row in rows):
            out.colors = np.array([row["color"] for row in rows], np.float64).reshape(-1, 3) / 255
    except (TypeError, ValueError, KeyError, OverflowError):
        raise BadFile(f"{said.where}: a point of 'structure' has no three numbers 'X'") from None
