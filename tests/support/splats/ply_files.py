"""PLY files of splats for tests, written and read value by value: the slow twin of the reader."""

import struct
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.ply.ply_file import read_header

CODES = {"float": "f", "double": "d", "uchar": "B", "short": "h", "int": "i"}


def some_splats(
    count=20, coefficients=16, seed=0, sizes=(0.01, 1), opacities=(0.01, 0.99), color=1.0, **kind
) -> PlainSplats:
    """Random ones within these bounds; color: the standard deviation of the harmonics."""
    rng = np.random.default_rng(seed)
    wxyz = rng.normal(size=(count, 4))
    arrays = (
        rng.normal(size=(count, 3)),
        rng.uniform(*sizes, (count, 3)),
        wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True),
        rng.uniform(*opacities, count),
        color * rng.normal(size=(count, coefficients, 3)),
    )
    return PlainSplats(*(a.astype(np.float32) for a in arrays), **kind)


def names_of(coefficients: int) -> list[str]:
    """The columns of a 3DGS file of M coefficients, in INRIA's order."""
    names = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"]
    names += [f"f_rest_{i}" for i in range(3 * (coefficients - 1))]
    return [*names, "opacity", *(f"scale_{i}" for i in range(3)), *(f"rot_{i}" for i in range(4))]


def random_rows(count: int, names: list[str], seed: int = 0) -> list[dict[str, float]]:
    """One dictionary a splat, of float32 values; normals are zero."""
    values = np.random.default_rng(seed).normal(size=(count, len(names))).astype(np.float32)
    for i, name in enumerate(names):
        if name in ("nx", "ny", "nz"):
            values[:, i] = 0
    return [dict(zip(names, row.tolist(), strict=True)) for row in values]


def write_rows(
    path: Path, rows: list[dict], kinds: dict[str, str] | None = None,
    encoding: str = "binary_little_endian", comments: tuple[str, ...] = (), after: str = "",
) -> Path:  # fmt: skip
    """Writes the rows; kinds: PLY's type of a column, float unless it says otherwise.

    after: header lines behind the last property, as further elements are.
    """
    names = list(rows[0])
    kinds = {name: "float" for name in names} | (kinds or {})
    lines = ["ply", f"format {encoding} 1.0", *(f"comment {text}" for text in comments)]
    lines += [f"element vertex {len(rows)}"]
    lines += [f"property {kinds[name]} {name}" for name in names]
    head = "\n".join([*lines, *([after] if after else []), "end_header", ""]).encode()
    if encoding == "ascii":
        texts = [" ".join(repr(row[name]) for name in names) for row in rows]
        path.write_bytes(head + "\n".join(texts).encode())
    else:
        order = ">" if encoding == "binary_big_endian" else "<"
        code = order + "".join(CODES[kinds[name]] for name in names)
        body = b"".join(struct.pack(code, *(row[name] for name in names)) for row in rows)
        path.write_bytes(head + body)
    return path


def sh_of(row: dict, coefficients: int) -> list[list[float]]:
    """(M, 3) of one row: all of red first in the file, then green, then blue."""
    rest = coefficients - 1
    first = [[row["f_dc_0"], row["f_dc_1"], row["f_dc_2"]]]
    return first + [[row[f"f_rest_{c * rest + j}"] for c in range(3)] for j in range(rest)]


def read_table(path: Path, needed: tuple[str, ...], name: str = "vertex") -> np.ndarray:
    """(N,) records of an element of a binary file, memory-mapped, with every column of `needed`.

    Raises BadFile.
    """
    header = read_header(path)
    if header.encoding == "ascii":
        raise BadFile(f"{path.name} is an ASCII PLY; convert it to a binary one.")
    element, begins = header.find(name)
    element.require(needed, path.name)
    return np.memmap(path, element.layout, "r", begins, (element.count,))
