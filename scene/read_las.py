"""Points of laser scanners, LAS and LAZ, through laspy; large clouds are thinned while read."""

import struct
from pathlib import Path

import numpy as np

from runtime_models.model import BadFile
from scene.json_values import shortened

CHUNK = 500_000  # points in memory at a time
HEAD = struct.Struct("<4s92xII")  # mark, where the points begin, how many records lie before them
UNPACKED = 100  # times its size that a LAZ may unpack to; scanners' are 4 to 15 times
RECORD = 54  # bytes that such a record has at least


def read_las(path: Path, most: int) -> tuple[np.ndarray, int]:
    """(P, 3) float64 metres, in the file's own world, of about `most` points, and how many it has.

    Thinned by taking every nth: scanners write line after line, so the density stays as it was.
    """
    import laspy
    import lazrs

    where = shortened(path)
    if not path.is_file():
        raise BadFile(f"{where}: the file of points is missing; put it there")
    refuse_head(path, where)
    broken = (
        laspy.errors.LaspyException, lazrs.LazrsError, ValueError, OSError, EOFError,
        struct.error, KeyError, IndexError, OverflowError,
    )  # fmt: skip
    try:
        with laspy.open(path, read_evlrs=False) as file:
            count = file.header.point_count
            size, there = file.header.point_format.size, path.stat().st_size
            if count * size > there * (UNPACKED if file.header.are_points_compressed else 1):
                raise BadFile(
                    f"{where}: states {count:,} points of {size} bytes in {there:,} bytes; copy it "
                    "again"
                )
            parts, step, at = [], max(-(-count // most), 1), 0
            for chunk in file.chunk_iterator(CHUNK):
                rows = slice(-at % step, None, step)
                parts.append(np.stack([np.asarray(chunk[c])[rows] for c in "xyz"], axis=1))
                at += len(chunk)
    except broken as error:
        if isinstance(error, BadFile):
            raise
        text = " ".join(str(error).split())
        raise BadFile(f"{where}: no LAS or LAZ that can be read ({text:.80}); copy it") from None
    if not at or at != count:
        raise BadFile(f"{where}: states {count:,} points and has {at:,}; copy it again")
    return np.concatenate(parts).astype(np.float64), count


def refuse_head(path: Path, where: str) -> None:
    """Raises BadFile for what laspy would read for minutes: records that the file cannot hold."""
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
