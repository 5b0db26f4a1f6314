"""OpenSfM's reconstruction.json, and the folders of OpenDroneMap, which hold one or its shots.

Lengths on the photo are parts of its longer side, from its middle (doc/source/geometry.rst); the
world has z up, metres where there was GPS.
"""

from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.runtime_models.model import BadFile
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
    lenses = {name: lens_of(cameras.object(name)) for name in cameras.data}
    shots = said.object("shots")
    for name in shots.data:
        shot = shots.object(name)
        lens = lenses.get(shot.text("camera", ""))
        pose = camera_inverse(rotation_of(shot), shot.numbers("translation", 3))
        out.add(name, pose, lens) if lens else out.leave(name, NO_LENS)
    add_points(out, said)
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
    lenses = [lens_of(cameras.object(name)) for name in cameras.data]
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


def lens_of(said: Fields) -> ColmapCamera | None:
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


def add_points(out: Gathered, said: Fields) -> None:
    points = said.value("points", None)
    if not isinstance(points, dict) or not points:
        return
    try:
        rows = list(points.values())
        out.points = np.array([row["coordinates"] for row in rows], np.float64).reshape(-1, 3)
        out.colors = np.array([row["color"] for row in rows], np.float64).reshape(-1, 3) / 255
    except (TypeError, ValueError, KeyError, OverflowError):
        raise BadFile(f"{said.where}: a point has no three coordinates and color") from None
