"""Points out of LAS and LAZ files by laspy, behind the gate.

laszip's decoder ends the process, panics, or decodes for minutes on some damaged files.
"""

import struct
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.gate.refusal import Unreadable

CHUNK = 200_000  # points in memory at a time
CHUNK_BYTES = 8 << 20  # of records in memory at a time: some are 64 kB long
UNPACKED = 100  # times its size that a LAZ may unpack to; scanners' are 4 to 15 times


def las_points(name: str, most: int, chunk_points: int = CHUNK) -> dict:
    """{"points": (P, 3) float64 metres, about `most` of them, "count": how many the file has}.

    Thinned by taking every nth: scanners write line after line, so the density stays as it was.
    Raises Unreadable.
    """
    import laspy
    import lazrs

    path = Path(name)
    broken = (
        laspy.errors.LaspyException, lazrs.LazrsError, ValueError, OSError, EOFError,
        struct.error, KeyError, IndexError, OverflowError,
    )  # fmt: skip
    try:
        with laspy.open(path, read_evlrs=False) as file:
            count = file.header.point_count
            size, there = file.header.point_format.size, path.stat().st_size
            if count * size > there * (UNPACKED if file.header.are_points_compressed else 1):
                raise Unreadable(f"states {count:,} points of {size} bytes in {there:,} bytes")
            parts, step, at = [], max(-(-count // most), 1), 0
            at_once = max(min(chunk_points, CHUNK_BYTES // max(size, 1)), 1)
            for chunk in file.chunk_iterator(at_once):
                rows = slice(-at % step, None, step)
                parts.append(np.stack([np.asarray(chunk[c])[rows] for c in "xyz"], axis=1))
                at += len(chunk)
    except broken as error:
        if isinstance(error, Unreadable):
            raise
        text = " ".join(str(error).split())
        raise Unreadable(f"no LAS or LAZ that can be read ({text:.80})") from None
    if not at or at != count:
        raise Unreadable(f"states {count:,} points and has {at:,}")
    return {"points": np.concatenate(parts).astype(np.float64), "count": count}
