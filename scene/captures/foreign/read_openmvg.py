"""OpenMVG's sfm_data.json: views, intrinsics and extrinsics as cereal writes them."""

from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture_rules import LARGEST_NUMBER
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
        lenses[str(row.value("key", None))] = lens_of(row, names)
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
    add_points(out, said)
    return out.finished()


def rows_of(fields: Fields, key: str, count: int) -> np.ndarray:
    """(count, count) a matrix of rows.  Raises BadFile."""
    rows = fields.typed(key, list)
    if not (isinstance(rows, list) and len(rows) == count):
        raise fields.error(key, f"{count} rows of {count} numbers")
    return np.array([Fields({key: row}, fields.where).numbers(key, count) for row in rows])


def lens_of(row: Fields, names: dict[int, str]) -> ColmapCamera | None:
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


def add_points(out: Gathered, said: Fields) -> None:
    rows = said.value("structure", None)
    if not isinstance(rows, list) or not rows:
        return
    try:
        out.points = np.array([row["value"]["X"] for row in rows], np.float64).reshape(-1, 3)
    except (TypeError, ValueError, KeyError, OverflowError):
        raise BadFile(f"{said.where}: a point of 'structure' has no three numbers 'X'") from None
