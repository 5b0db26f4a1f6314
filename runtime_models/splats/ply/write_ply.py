"""Plain splats to INRIA's 3DGS PLY, in COLMAP's axes: the inverse of read_ply."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.blocks import BLOCK
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.shapes import column_names
from shapeshift.runtime_models.splats.operations.rotate_splats import HALF_TURN, rotator
from shapeshift.runtime_models.splats.plain_splats import PlainSplats

TYPES = {"f4": "float", "f8": "double", "u1": "uchar", "i1": "char", "u2": "ushort", "i2": "short",
         "u4": "uint", "i4": "int"}  # fmt: skip
NEAREST = {"b1": "u1", "f2": "f4", "i8": "f8", "u8": "f8"}  # of types that PLY does not have
NORMAL = ("nx", "ny", "nz")


def write_ply(splats: PlainSplats, path: str | Path) -> None:
    """Atomic, a block at a time; the origin is put back, labels and extra columns come last.

    Where the origin is not zero x y z are doubles, so that nothing is lost.  An opacity of 0 or 1
    is an infinite logit, a scale of 0 an infinite logarithm: they come back as they were.
    """
    row, extra = row_of(splats), columns_of(splats)
    lines = ["ply", "format binary_little_endian 1.0"]
    lines += ["comment antialiased 1"] if splats.antialiased else []
    lines += [f"element vertex {len(splats.means)}", *properties(row)]
    header = "\n".join([*lines, "end_header", ""]).encode("ascii")
    write_whole(Path(path), records(splats, row, extra, header))


def columns_of(splats: PlainSplats) -> dict[str, np.ndarray]:
    """What else a splat has, by names that a header can hold and that are not taken."""
    columns = {} if splats.labels is None else {"label": splats.labels}
    for name, column in splats.extra.items():
        name = re.sub(r"[^!-~]", "_", name) or "_"  # a word of visible ASCII
        while name in columns or is_own(name):
            name += "_"
        columns[name] = column
    return columns


def is_own(name: str) -> bool:
    """Whether the splats themselves have a column of this name."""
    return bool(re.fullmatch(r"[xyz]|opacity|(f_dc|f_rest|scale|rot)_[0-9]+", name))


def row_of(splats: PlainSplats) -> np.dtype:
    """The record of one splat: groups of columns, in the order of the file."""
    fields = [
        ("place", "<f8" if any(splats.origin) else "<f4", 3),
        ("normal", "<f4", 3),
        ("f_dc", "<f4", 3),
        ("f_rest", "<f4", (3, splats.sh.shape[1] - 1)),  # channel-major
        ("opacity", "<f4"),
        ("scale", "<f4", 3),
        ("rot", "<f4", 4),
    ]
    for name, column in columns_of(splats).items():
        kind = column.dtype.str[1:]
        if name not in NORMAL:
            fields.append((f"extra {name}", "<" + NEAREST.get(kind, kind)))
    return np.dtype(fields)


def properties(row: np.dtype) -> list[str]:
    """The header's lines of a record."""
    names = {"place": list("xyz"), "normal": list(NORMAL), "opacity": ["opacity"]}
    lines = []
    for group in column_names(row):
        kind = row[group].base
        count = row[group].itemsize // kind.itemsize
        if group.startswith("extra "):
            own = [group.removeprefix("extra ")]
        else:
            own = names.get(group, [f"{group}_{i}" for i in range(count)])
        lines += [f"property {TYPES[kind.str[1:]]} {name}" for name in own]
    return lines


def records(
    splats: PlainSplats, row: np.dtype, extra: dict[str, np.ndarray], header: bytes
) -> Iterator[bytes]:
    """The bytes of the file, part after part."""
    yield header
    rotate_rows = rotator(HALF_TURN, splats.sh.shape[1])  # its own inverse
    origin = np.array(splats.origin) * HALF_TURN.diagonal()  # metres, in the file's axes
    for first in range(0, len(splats.means), BLOCK):
        rows = slice(first, first + BLOCK)
        means, wxyz, sh = (
            splats.means[rows].copy(),
            splats.wxyz[rows].copy(),
            splats.sh[rows].copy(),
        )
        rotate_rows(means, wxyz, sh)
        table = np.zeros(len(means), row)
        table["place"] = means + origin if origin.any() else means
        table["f_dc"], table["f_rest"] = sh[:, 0], sh[:, 1:].transpose(0, 2, 1)
        opacity = np.clip(splats.opacity[rows].astype(np.float64), 0, 1)
        with np.errstate(divide="ignore"):
            table["opacity"] = np.log(opacity) - np.log1p(-opacity)
            table["scale"] = np.log(np.maximum(splats.scales[rows], 0, dtype=np.float64))
        table["rot"] = -wxyz  # the same turn; two halves make -1, and so the file's own numbers
        for name, column in extra.items():
            if name in NORMAL:
                table["normal"][:, NORMAL.index(name)] = column[rows]
            else:
                table[f"extra {name}"] = column[rows]
        yield table.tobytes()
