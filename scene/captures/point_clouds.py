"""Points of laser scanners, LAS and LAZ, through laspy; large clouds are thinned while read."""

import os
import struct
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.memory import Account, Memory
from shapeshift.runtime_models.files.npy import read_array
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.files.zip_files import opened_zip
from shapeshift.runtime_models.gate.gate import ask
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.shapes import column_names
from shapeshift.runtime_models.splats.ply.ply_file import read_header
from shapeshift.runtime_models.splats.ply.read_points_ply import read_records, shades_of
from shapeshift.scene.captures.capture_rules import FARTHEST

# mark, where the points begin, how many records lie before them
HEAD = struct.Struct("<4s92xII")
RECORD = 54  # bytes that such a record has at least


def read_las(path: Path, most: int) -> tuple[np.ndarray, int]:
    """(P, 3) float64 metres, in the file's own world, of about `most` points, and how many it has.

    Read behind the gate, las_run.py.  Raises BadFile.
    """
    where = path_end(path)
    if not path.is_file():
        raise BadFile(f"{where}: the file of points is missing; put it there")
    refuse_head(path, where)
    found = ask("points", path, [str(path.absolute()), most], memory=Memory().of(path).left)
    return found["points"], int(found["count"])


def refuse_head(path: Path, where: str) -> None:
    """Raises BadFile for what laspy would read for minutes."""
    with open(path, "rb") as file:
        head = file.read(HEAD.size)
    if len(head) < HEAD.size or not head.startswith(b"LASF"):
        raise BadFile(f"{where}: no LAS or LAZ file; copy it again")
    _, begins, records = HEAD.unpack(head)
    if not records * RECORD <= begins <= path.stat().st_size:
        raise BadFile(
            f"{where}: states {records:,} records before its points at byte {begins:,}, which the "
            "file cannot hold; copy it again"
        )


# Coloured points that come with a capture: points.npz, or a PLY cloud as nerfstudio writes it.

POINT = 96  # bytes of a point on the way: two copies of its place, its colour


def read_points(path: Path) -> tuple[np.ndarray, np.ndarray | None]:
    """(P, 3) float64 positions and (P, 3) float32 colours 0..1 or None, in the file's own world."""
    where = path_end(path)
    if not os.path.isfile(path):  # unlike Path.is_file it takes any text for a name
        raise BadFile(f"{where}: the file of points is missing; put it there or drop its entry")
    read = read_ply if path.suffix.lower() == ".ply" else read_npz
    xyz, rgb = read(path, where, Memory().of(path))
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


def read_npz(path: Path, where: str, memory: Account) -> tuple[np.ndarray, np.ndarray | None]:
    with opened_zip(path, where, memory) as archive:
        names = archive.namelist()
        xyz = read_array(archive, "xyz", where, memory)
        if xyz is None:
            held = path_end(", ".join(names[:20]))
            raise BadFile(f"{where}: lacks the array 'xyz' (P, 3), holds {held or 'nothing'}")
        memory.charge(POINT * len(xyz) if xyz.ndim else 0, "its points")
        return xyz, read_array(archive, "rgb", where, memory)


def read_ply(path: Path, where: str, memory: Account) -> tuple[np.ndarray, np.ndarray | None]:
    """The vertices of a PLY, binary or ASCII; all that its header promises is there."""
    header = read_header(path)
    vertex, begins = header.find("vertex")
    lacking = [axis for axis in "xyz" if axis not in column_names(vertex.layout)]
    if lacking:
        raise BadFile(f"{where}: its vertices have no {lacking[0]}; x, y and z are wanted")
    memory.charge((POINT + vertex.layout.itemsize) * vertex.count, f"{vertex.count:,} points")
    table = read_records(path, header, vertex, begins)
    with np.errstate(over="ignore", invalid="ignore"):  # what is no number is refused by the caller
        return np.stack([table[axis].astype(np.float64) for axis in "xyz"], 1), shades_of(table)
