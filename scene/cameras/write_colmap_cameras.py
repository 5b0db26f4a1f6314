"""A COLMAP model, text or binary, of PINHOLE cameras and posed images without points."""

import os
import struct
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.scene.cameras.camera_list import CameraList, data_from_ours
from shapeshift.scene.captures.colmap.rig_frames import TABLES as RIG_TABLES
from shapeshift.scene.captures.colmap_tables import (
    CAMERA,
    COUNT,
    IMAGE,
    LENS_NUMBERS,
    TABLES,
    ColmapCamera,
    Posed,
)
from shapeshift.scene.pose import Pose

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
