"""A COLMAP model for its cameras alone, text or binary; neither photos nor points are needed."""

import math
import os
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import (
    CameraList,
    CameraReading,
    data_from_ours,
    ours_from_world,
    pinhole_view,
    read_name,
)
from shapeshift.scene.captures.colmap.rig_frames import TABLES as RIG_TABLES
from shapeshift.scene.captures.colmap.rig_frames import refused_poses, refused_text
from shapeshift.scene.captures.colmap_tables import (
    CAMERA,
    COUNT,
    IMAGE,
    LENS_NUMBERS,
    TABLES,
    ColmapCamera,
    Posed,
    read_tables,
)
from shapeshift.scene.pose import Pose, View

UNIT = 1e-2  # by which a quaternion's length differs from 1 in rounded text files, at most


def read_colmap_cameras(folder: Path, ending: str, reading: CameraReading) -> CameraList:
    """The views of all images in their numbers' order, turned as 3DGS's splats are; BadFile."""
    lenses, posed = read_tables(folder, ending)
    turn = ours_from_world(reading)
    views = []
    for image in posed:
        view = view_of(
            image, lenses[image.lens], turn, f"{folder / f'images{ending}'}: {image.name}"
        )
        views.append(view.resized(reading.size) if reading.size else view)
    notes = other_lengths(posed) + refused_poses(folder, ending, posed)
    notes += refused_text(folder, ending, posed)
    if any(lenses[image.lens].bends for image in posed):
        notes += (
            f"{folder}: the lenses' distortion is left out; the views are those of pinholes.",
        )
    kind = "binary" if ending == ".bin" else "text"
    return CameraList(
        tuple(views), tuple(read_name(i.name) for i in posed), f"COLMAP {kind}", notes
    )


def view_of(image: Posed, lens: ColmapCamera, turn: np.ndarray, where: str) -> View:
    world_from_camera = turn @ camera_pose(image, where)
    return pinhole_view(world_from_camera, lens.focal, lens.centre, lens.size, where)


def camera_pose(image: Posed, where: str) -> np.ndarray:
    """(4, 4) camera to world, OpenCV axes, COLMAP's world.  Raises BadFile."""
    if not (0 < image.length < math.inf and np.isfinite(image.place).all()):
        raise BadFile(f"{where}: its pose is no rotation and place; run the mapper again.")
    return np.linalg.inv(image.camera_from_world())


def other_lengths(posed: Sequence[Posed]) -> tuple[str, ...]:
    """A sentence where quaternions have other lengths than 1: other programs may read such poses
    otherwise."""
    other = [image for image in posed if not abs(image.length - 1) <= UNIT]
    if not other:
        return ()
    return (
        f"{len(other)} of {len(posed)} quaternions have another length than 1, for example "
        f"{other[0].length:.3g} of {path_end(other[0].name)}; they are divided by it.",
    )


# A COLMAP model, text or binary, of PINHOLE cameras and posed images without points.

PINHOLE = "PINHOLE"
HEADS = {
    "cameras": "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n",
    "images": "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n"
    "# POINTS2D[] as (X, Y, POINT3D_ID)\n",
    "points3D": "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n",
}


def stale_tables(folder: Path, ending: str) -> list[Path]:
    """What lies in `folder` of another model and would contradict one that is written there.

    COLMAP takes the poses of rigs and frames, not those of images; of text and binary it takes,
    as we do, what is binary.
    """
    other = {".bin": ".txt", ".txt": ".bin"}[ending]
    names = [f"{table}{other}" for table in TABLES]
    names += [f"{table}{each}" for table in RIG_TABLES for each in (ending, other)]
    return [path for name in names if os.path.lexists(path := folder / name)]


def write_colmap_cameras(cameras: CameraList, folder: Path, ending: str) -> list[Path]:
    """Writes cameras, images and points3D (.bin or .txt) into `folder`, which is there, and removes
    what of an older model contradicts them."""
    lenses, posed = tables_of(cameras)
    make = {".bin": (camera_bytes, image_bytes), ".txt": (camera_text, image_text)}[ending]
    tables = {"cameras": make[0](lenses), "images": make[1](posed)}
    tables["points3D"] = COUNT.pack(0) if ending == ".bin" else HEADS["points3D"].encode()
    paths = []
    for name, data in tables.items():
        paths.append(folder / (name + ending))
        write_whole(paths[-1], data)
    for path in stale_tables(folder, ending):
        path.unlink()
    return paths


def tables_of(cameras: CameraList) -> tuple[dict[int, ColmapCamera], list[Posed]]:
    """COLMAP's rows: equal lenses once, numbers from 1 in the views' order."""
    lenses: dict[ColmapCamera, int] = {}
    posed, turn = [], data_from_ours()
    for i, (view, name) in enumerate(zip(cameras.views, cameras.names, strict=True)):
        camera_from_ours, fx, fy, cx, cy = view.pinhole()
        size = (int(view.size[0]), int(view.size[1]))
        lens = ColmapCamera(PINHOLE, size, (float(fx), float(fy), float(cx), float(cy)))
        number = lenses.setdefault(lens, len(lenses) + 1)
        pose = Pose.from_matrix(camera_from_ours @ np.linalg.inv(turn))
        name = name or f"{i:05d}.png"
        posed.append(Posed(i + 1, name, tuple(pose.wxyz), tuple(pose.position), number))
    return {number: lens for lens, number in lenses.items()}, posed


def camera_bytes(lenses: dict[int, ColmapCamera]) -> bytes:
    rows = [
        CAMERA.pack(number, LENS_NUMBERS[lens.model], *lens.size)
        + struct.pack(f"<{len(lens.params)}d", *lens.params)
        for number, lens in lenses.items()
    ]
    return COUNT.pack(len(rows)) + b"".join(rows)


def image_bytes(posed: list[Posed]) -> bytes:
    rows = [
        IMAGE.pack(i.number, *i.wxyz, *i.place, i.lens) + i.name.encode() + b"\0" + COUNT.pack(0)
        for i in posed
    ]
    return COUNT.pack(len(rows)) + b"".join(rows)


def camera_text(lenses: dict[int, ColmapCamera]) -> bytes:
    rows = [
        " ".join([str(number), lens.model, *map(str, lens.size), *map(repr, lens.params)])
        for number, lens in lenses.items()
    ]
    return (HEADS["cameras"] + "\n".join(rows) + "\n").encode()


def image_text(posed: list[Posed]) -> bytes:
    """Two lines an image, the second, of its points, empty."""
    rows = []
    for i in posed:
        pose = [repr(float(v)) for v in (*i.wxyz, *i.place)]
        rows.append(" ".join([str(i.number), *pose, str(i.lens), i.name]) + "\n\n")
    return (HEADS["images"] + "".join(rows)).encode()
