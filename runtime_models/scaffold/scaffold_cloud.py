"""The anchors of a Scaffold-GS or Octree-GS cloud, as their scene/gaussian_model.py writes them.

x y z, f_offset_* (all x of an anchor's splats, then all y, then all z), f_anchor_feat_*, scale_0..5
(logarithms: 0..2 multiply the offsets, 3..5 bound the splats' scales); Octree-GS: level,
extra_level and, in the first two rows of info, the coarsest cell's size and the standard distance.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import RawIOBase
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.blocks import BLOCK, each_block
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.shapes import column_names, column_offset
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.ply.ply_file import PlyHeader, read_header
from shapeshift.runtime_models.splats.ply.read_ply import read_fully

PLACE = ("x", "y", "z")
SCALES = tuple(f"scale_{i}" for i in range(6))
PREFIXES = ("f_offset_", "f_anchor_feat_")


@dataclass(frozen=True)
class Cloud:
    """What a cloud says, in the file's axes; every row of it, judged by `good`."""

    header: PlyHeader
    anchors: np.ndarray  # (A, 3) float32 metres
    features: np.ndarray  # (A, F)
    offsets: np.ndarray  # (A, k, 3) metres
    scales: np.ndarray  # (A, 3) metres
    levels: np.ndarray  # (A, 3) level, extra_level, info; (0, 3) where there are none
    good: np.ndarray  # (A,) bool: all of it is finite

    def kept(self) -> tuple[np.ndarray, ...]:
        """anchors, features, offsets, scales, levels of the good rows; no copies where all are."""
        arrays = (self.anchors, self.features, self.offsets, self.scales, self.levels)
        if self.good.all():
            return arrays
        return tuple(array[self.good] if len(array) else array for array in arrays)


def read_cloud(path: Path, reading: Reading) -> Cloud:
    """All rows of a binary cloud, block by block: it is never in memory as a whole.

    Raises BadFile.
    """
    header = read_header(path)
    vertex, begins = header.find("vertex")
    if header.encoding == "ascii":
        raise BadFile(f"{path.name} is an ASCII PLY; export it as a binary one.")
    vertex.require((*PLACE, *SCALES), path.name)
    k, width = count_columns(column_names(vertex.layout), path.name)
    count, row = vertex.count, vertex.layout
    floats = 3 + width + 3 * k + 3 + 3  # of an anchor
    reading.within(path).account.charge(2 * 4 * count * floats, f"{count:,} anchors")
    cloud = Cloud(
        header,
        np.empty((count, 3), np.float32),
        np.empty((count, width), np.float32),
        np.empty((count, k, 3), np.float32),
        np.empty((count, 3), np.float32),
        np.zeros((count if "level" in column_names(row) else 0, 3), np.float32),
        np.empty(count, bool),
    )

    @contextmanager
    def opened() -> Iterator[tuple[RawIOBase, np.ndarray]]:
        with path.open("rb", buffering=0) as file:
            yield file, np.empty(BLOCK, row)

    def work(rows: slice, own: tuple[RawIOBase, np.ndarray]) -> None:
        file, table = own[0], own[1][: rows.stop - rows.start]
        file.seek(begins + rows.start * row.itemsize)
        if read_fully(file, table.view(np.uint8).data) < table.nbytes:
            raise BadFile(f"{path.name} became shorter while it was read; is it still written?")
        fill(cloud, rows, table)

    def progress(part: float) -> None:
        reading.report(f"reading {path.name}", part)

    each_block(count, work, progress, opened)
    return cloud


def count_columns(names: tuple[str, ...], file: str) -> tuple[int, int]:
    """Splats an anchor and features of a cloud, by its columns.  Raises BadFile."""
    counts = []
    for prefix in PREFIXES:
        mine = {n for n in names if n.startswith(prefix)}
        if not mine or mine != {f"{prefix}{i}" for i in range(len(mine))}:
            raise BadFile(f"{file}: its {len(mine)} columns {prefix}* are not numbered from 0 on.")
        counts.append(len(mine))
    if counts[0] % 3:
        raise BadFile(f"{file} has {counts[0]} columns f_offset_*, expected three a splat.")
    return counts[0] // 3, counts[1]


def fill(cloud: Cloud, rows: slice, table: np.ndarray) -> None:
    """Puts records of the file into some rows, offsets and scales in metres."""
    k, width = cloud.offsets.shape[1], cloud.features.shape[1]
    names = column_names(table.dtype)
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is judged below
        cloud.anchors[rows] = gather(table, PLACE)
        cloud.features[rows] = gather(table, [f"f_anchor_feat_{i}" for i in range(width)])
        scales = np.exp(gather(table, SCALES))
        cloud.scales[rows] = scales[:, 3:]
        by_channel = gather(table, [f"f_offset_{i}" for i in range(3 * k)]).reshape(-1, 3, k)
        by_channel *= scales[:, :3, None]
        cloud.offsets[rows] = by_channel.transpose(0, 2, 1)
        for i, name in enumerate(("level", "extra_level", "info") if len(cloud.levels) else ()):
            if name in names:
                cloud.levels[rows, i] = table[name]
    finite = [np.isfinite(a[rows]).reshape(len(table), -1).all(axis=1) for a in (
        cloud.anchors, cloud.features, cloud.offsets, cloud.scales)]  # fmt: skip
    cloud.good[rows] = np.logical_and.reduce(finite)


def gather(table: np.ndarray, names: list[str] | tuple[str, ...]) -> np.ndarray:
    """(n, len(names)) float32 of some columns."""
    kinds = table.dtype
    if all(kinds[name] == np.dtype("<f4") for name in column_names(kinds)):
        places = [column_offset(kinds, name) // 4 for name in names]
        return np.take(table.view("<f4").reshape(len(table), -1), places, axis=1)
    out = np.empty((len(table), len(names)), np.float32)
    for i, name in enumerate(names):
        out[:, i] = table[name]
    return out
