"""Coloured points that come with a capture: points.npz, or a PLY cloud as nerfstudio writes it."""

import zipfile
from pathlib import Path

import numpy as np

from runtime_models.model import BadFile

PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip


def read_points(path: Path) -> tuple[np.ndarray, np.ndarray | None]:
    """(P, 3) float64 positions and (P, 3) float32 colours 0..1 or None, in the file's own world."""
    if not path.is_file():
        raise BadFile(f"{path}: the file of points is missing; put it there or drop its entry")
    xyz, rgb = read_ply(path) if path.suffix.lower() == ".ply" else read_npz(path)
    if xyz.ndim != 2 or xyz.shape[1] != 3:
        raise BadFile(f"{path}: points have shape {xyz.shape}; (P, 3) is wanted")
    if not np.isfinite(xyz).all():
        raise BadFile(
            f"{path}: {(~np.isfinite(xyz)).sum()} coordinates are NaN or Inf; remove them"
        )
    if rgb is not None and rgb.shape != xyz.shape:
        raise BadFile(f"{path}: colours {rgb.shape} do not fit points {xyz.shape}")
    if rgb is not None:
        rgb = rgb.astype(np.float32) / (255 if rgb.dtype == np.uint8 else 1)
    return xyz.astype(np.float64), rgb


def read_npz(path: Path) -> tuple[np.ndarray, np.ndarray | None]:
    try:
        with np.load(path) as arrays:
            if "xyz" not in arrays:
                raise BadFile(f"{path}: holds {sorted(arrays)}; an array 'xyz' (P, 3) is wanted")
            return arrays["xyz"], arrays["rgb"] if "rgb" in arrays else None
    except (zipfile.BadZipFile, EOFError, OSError) as error:
        raise BadFile(f"{path}: the npz cannot be read ({error}); copy it again") from None


def read_ply(path: Path) -> tuple[np.ndarray, np.ndarray | None]:
    """The vertices of an ASCII or binary little-endian PLY whose first element is `vertex`."""
    data = path.read_bytes()
    head, mark, body = data.partition(b"end_header\n")
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    elements = [i for i, line in enumerate(lines) if line[:1] == ["element"]]
    if not mark or lines[0] != ["ply"] or not elements or lines[elements[0]][1] != "vertex":
        raise BadFile(f"{path}: not a PLY that starts with vertices; write the points as npz")
    count = int(lines[elements[0]][2])
    stop = elements[1] if len(elements) > 1 else len(lines)
    fields = [line[1:] for line in lines[elements[0] + 1 : stop] if line[:1] == ["property"]]
    if any(kind not in PLY_TYPES for kind, *_ in fields):
        raise BadFile(f"{path}: the vertices hold lists; write plain x y z red green blue")
    row = np.dtype([(name, "<" + PLY_TYPES[kind]) for kind, name in fields])
    if ["format", "ascii", "1.0"] in lines:
        table = [tuple(line.split()) for line in body.decode("ascii").splitlines()[:count]]
        vertices = np.array(table, [(n, "f8") for n in row.names])
    elif ["format", "binary_little_endian", "1.0"] in lines and len(body) >= count * row.itemsize:
        vertices = np.frombuffer(body, row, count)
    else:
        raise BadFile(f"{path}: cut off, or not ASCII or little-endian; write it again")
    if not {"x", "y", "z"} <= set(row.names):
        raise BadFile(f"{path}: the vertices have {row.names}; x, y and z are wanted")
    rgb = None
    if {"red", "green", "blue"} <= set(row.names):
        rgb = np.stack([vertices[c].astype(np.uint8) for c in ("red", "green", "blue")], axis=1)
    return np.stack([vertices[c].astype(np.float64) for c in "xyz"], axis=1), rgb
