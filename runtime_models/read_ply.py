"""INRIA's 3DGS PLY to plain splats."""

import re
from pathlib import Path

import numpy as np

from runtime_models.model import BadFile
from runtime_models.plain_splats import RawSplats, Reading
from runtime_models.spherical_harmonics import COEFFICIENTS

TYPES = {"float": "<f4", "float32": "<f4", "double": "<f8", "float64": "<f8", "uchar": "u1",
         "uint8": "u1", "char": "i1", "int8": "i1", "short": "<i2", "int16": "<i2", "ushort": "<u2",
         "uint16": "<u2", "int": "<i4", "int32": "<i4", "uint": "<u4", "uint32": "<u4"}  # fmt: skip
DIGITS = re.compile(r"\d{1,15}", re.ASCII)
LARGEST_HEADER = 1 << 16  # bytes
GEOMETRY = ("x", "y", "z", "opacity", "scale_0", "scale_1", "scale_2",
            "rot_0", "rot_1", "rot_2", "rot_3", "f_dc_0", "f_dc_1", "f_dc_2")  # fmt: skip


def read_raw_ply(path: Path, reading: Reading) -> RawSplats:
    """Splats of a binary 3DGS PLY of SH degree 0 to 3.  Raises BadFile."""
    table = read_table(path)
    rest = [name for name in table.dtype.names if name.startswith("f_rest_")]
    count = len(rest) // 3 + 1
    if len(rest) % 3 or count not in COEFFICIENTS:
        raise BadFile(f"{path.name} has {len(rest)} f_rest columns, expected 0, 9, 24 or 45.")
    if set(rest) != {f"f_rest_{i}" for i in range(len(rest))}:
        raise BadFile(f"{path.name}: its {len(rest)} f_rest columns are not numbered from 0 on.")
    sh = np.empty((len(table), count, 3), np.float32)
    sh[:, 0] = columns(table, "f_dc_", 3)
    if rest:  # channel-major: all of red, then green, then blue
        by_channel = columns(table, "f_rest_", len(rest)).reshape(-1, 3, count - 1)
        sh[:, 1:] = by_channel.transpose(0, 2, 1)
    return RawSplats(
        means=np.stack([table[axis] for axis in "xyz"], 1).astype(np.float32, copy=False),
        scales=columns(table, "scale_", 3),
        wxyz=columns(table, "rot_", 4),
        opacity=table["opacity"].astype(np.float32),
        sh=sh,
        file=path.name,
        format="ply",
    )


def columns(table: np.ndarray, prefix: str, count: int) -> np.ndarray:
    """(N, count) float32 of the columns prefix0, prefix1, ...; a view where the file allows."""
    from numpy.lib.recfunctions import structured_to_unstructured

    names = [f"{prefix}{i}" for i in range(count)]
    return structured_to_unstructured(table[names], dtype=np.float32)


def read_table(path: Path) -> np.ndarray:
    """(N,) records of the vertex element, memory-mapped, with every column of GEOMETRY."""
    with path.open("rb") as file:
        head = file.read(LARGEST_HEADER)
    end = head.find(b"end_header")
    start = head.find(b"\n", end) + 1  # after end_header and its \n or \r\n
    if not head.startswith(b"ply") or end < 0 or start == 0:
        raise BadFile(f"{path.name} is no PLY file: its header is missing or never ends.")
    lines = [line.split() for line in head[:end].decode("ascii", "replace").splitlines()]
    if ["format", "binary_little_endian", "1.0"] not in lines:
        raise BadFile(f"{path.name} is not a binary little-endian PLY; convert it to that.")
    elements = [line for line in lines if line[:1] == ["element"]]
    named = [" ".join(element[1:2]) for element in elements]
    if named != ["vertex"] or not DIGITS.fullmatch(" ".join(elements[0][2:])):
        raise BadFile(
            f"{path.name} has the elements {named}, a plain 3DGS PLY has ['vertex'] and how many "
            "there are; a compressed PLY must be converted."
        )
    fields = [line for line in lines if line[:1] == ["property"]]
    if any(len(f) != 3 or f[1] not in TYPES for f in fields):
        raise BadFile(f"{path.name} has a property of a type that splats do not have.")
    names = [f[2] for f in fields]
    if len(set(names)) != len(names):
        raise BadFile(f"{path.name} names a property twice.")
    missing = [name for name in GEOMETRY if name not in names]
    if missing:
        raise BadFile(
            f"{path.name} has no {missing[0]}: a point cloud or another format, not 3DGS splats; "
            "export it as a 3DGS PLY."
        )
    row, count = np.dtype([(f[2], TYPES[f[1]]) for f in fields]), int(elements[0][2])
    found = (path.stat().st_size - start) // row.itemsize
    if count == 0:
        raise BadFile(f"{path.name} holds no splats; export it again.")
    if found < count:
        raise BadFile(
            f"{path.name}: the header promises {count} splats of {row.itemsize} bytes, the "
            f"file holds {found}; it is cut off or its header is wrong."
        )
    return np.memmap(path, row, "r", start, (count,))
