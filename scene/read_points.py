"""Coloured points that come with a capture: points.npz, or a PLY cloud as nerfstudio writes it."""

import io
import math
import os
import zipfile
from pathlib import Path

import numpy as np

from runtime_models.model import BadFile
from runtime_models.package_files import DAMAGED, refuse_bomb
from runtime_models.ply_file import read_header
from runtime_models.read_package import BAD_HEADER
from runtime_models.read_points_ply import read_records, shades_of
from scene.capture_rules import FARTHEST
from scene.json_values import shortened

LIMITED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # unpacking the others stops at no limit
HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


def read_points(path: Path) -> tuple[np.ndarray, np.ndarray | None]:
    """(P, 3) float64 positions and (P, 3) float32 colours 0..1 or None, in the file's own world."""
    where = shortened(path)
    if not os.path.isfile(path):  # unlike Path.is_file it takes any text for a name
        raise BadFile(f"{where}: the file of points is missing; put it there or drop its entry")
    xyz, rgb = read_ply(path, where) if path.suffix.lower() == ".ply" else read_npz(path, where)
    if xyz.ndim != 2 or xyz.shape[1] != 3:
        raise BadFile(f"{where}: points have shape {xyz.shape!s:.40}; (P, 3) is wanted")
    wrong = ~(np.abs(xyz) <= FARTHEST)
    if wrong.any():
        raise BadFile(
            f"{where}: {wrong.sum()} coordinates are NaN, Inf or over {FARTHEST:g} m; remove them"
        )
    if rgb is not None and rgb.shape != xyz.shape:
        raise BadFile(f"{where}: colours {rgb.shape!s:.40} do not fit points {xyz.shape}")
    if rgb is not None:
        rgb = rgb / np.float32(255) if rgb.dtype == np.uint8 else rgb
        if not ((rgb >= 0) & (rgb <= 1)).all():
            raise BadFile(f"{where}: colours go beyond 0 to 1; give bytes, or numbers in 0 to 1")
        rgb = rgb.astype(np.float32)
    return xyz.astype(np.float64), rgb


def read_npz(path: Path, where: str) -> tuple[np.ndarray, np.ndarray | None]:
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
            if "xyz.npy" not in names:
                held = shortened(", ".join(names))
                raise BadFile(f"{where}: lacks the array 'xyz' (P, 3), holds {held or 'nothing'}")
            xyz = read_array(archive, "xyz.npy", where)
            return xyz, read_array(archive, "rgb.npy", where) if "rgb.npy" in names else None
    except BadFile:
        raise
    except (*DAMAGED, *BAD_HEADER) as error:
        raise BadFile(f"{where}: the npz cannot be read ({error!s:.80}); copy it again") from None


def read_array(archive: zipfile.ZipFile, name: str, where: str) -> np.ndarray:
    """An array of plain numbers, as many as its header states.  Nothing is unpickled."""
    entry = archive.getinfo(name)
    packed = min(entry.compress_size, os.path.getsize(archive.filename))
    refuse_bomb(f"{where}: {name}", entry.file_size, packed)
    if entry.compress_type not in LIMITED:
        raise BadFile(f"{where}: {name} is packed in an unusual way; write it with numpy.savez")
    with archive.open(entry) as stream:  # archive.read would unpack 2 GB, then cut
        data = stream.read(entry.file_size + 1)
    file = io.BytesIO(data)
    read_header_of = HEADERS.get(np.lib.format.read_magic(file))
    if read_header_of is None:
        raise BadFile(f"{where}: {name} is of an unknown version; write it with numpy.savez")
    shape, by_columns, kind = read_header_of(file)
    if kind.kind not in "fiu":
        raise BadFile(f"{where}: {name} holds {kind!s:.40}; plain numbers are wanted")
    there = len(data) - file.tell()
    if min(shape, default=0) < 0 or math.prod(shape) * kind.itemsize != there:
        raise BadFile(
            f"{where}: {name} states the shape {shape!s:.40}, but {there:,} bytes follow; copy it "
            "again"
        )
    numbers = np.frombuffer(data, kind, offset=file.tell())
    return numbers.reshape(shape, order="F" if by_columns else "C")


def read_ply(path: Path, where: str) -> tuple[np.ndarray, np.ndarray | None]:
    """The vertices of a PLY, binary or ASCII; all that its header promises is there."""
    header = read_header(path)
    vertex, begins = header.find("vertex")
    lacking = [axis for axis in "xyz" if axis not in vertex.row.names]
    if lacking:
        raise BadFile(f"{where}: its vertices have no {lacking[0]}; x, y and z are wanted")
    table = read_records(path, header, vertex, begins)
    with np.errstate(over="ignore", invalid="ignore"):  # what is no number is refused by the caller
        return np.stack([table[axis].astype(np.float64) for axis in "xyz"], 1), shades_of(table)
