"""Points out of LAS and LAZ files, and a process of its own for the latter: see read_las.py.

`python -P las_run.py IN.laz OUT.npz MOST BYTES`: laszip's decoder ends the process, panics, or
decodes for minutes on some damaged files; none of this may happen to the program.
"""

import os
import struct
import sys
from pathlib import Path

import numpy as np

CHUNK = 200_000  # points in memory at a time
CHUNK_BYTES = 8 << 20  # of records in memory at a time: some are 64 kB long
UNPACKED = 100  # times its size that a LAZ may unpack to; scanners' are 4 to 15 times
UNKNOWN = 2 << 30  # bytes that a process has taken, where the system does not tell
REFUSED = 2  # exit code where the last line of standard error says what is wrong
# Seconds of processor time that the process may take, and more for each byte of the file
SECONDS, SECONDS_A_BYTE = 5, 1e-6


class UnreadableCloud(ValueError):
    """What is wrong with a file, without its name."""


def las_points(path: Path, most: int, chunk_points: int = CHUNK) -> tuple[np.ndarray, int]:
    """(P, 3) float64 metres of about `most` points, and how many the file has.

    Thinned by taking every nth: scanners write line after line, so the density stays as it was.
    Raises UnreadableCloud.
    """
    import laspy
    import lazrs

    broken = (
        laspy.errors.LaspyException, lazrs.LazrsError, ValueError, OSError, EOFError,
        struct.error, KeyError, IndexError, OverflowError, MemoryError,
    )  # fmt: skip
    try:
        with laspy.open(path, read_evlrs=False) as file:
            count = file.header.point_count
            size, there = file.header.point_format.size, path.stat().st_size
            if count * size > there * (UNPACKED if file.header.are_points_compressed else 1):
                raise UnreadableCloud(f"states {count:,} points of {size} bytes in {there:,} bytes")
            parts, step, at = [], max(-(-count // most), 1), 0
            at_once = max(min(chunk_points, CHUNK_BYTES // max(size, 1)), 1)
            for chunk in file.chunk_iterator(at_once):
                rows = slice(-at % step, None, step)
                parts.append(np.stack([np.asarray(chunk[c])[rows] for c in "xyz"], axis=1))
                at += len(chunk)
    except broken as error:
        if isinstance(error, UnreadableCloud):
            raise
        text = " ".join(str(error).split())
        raise UnreadableCloud(f"no LAS or LAZ that can be read ({text:.80})") from None
    if not at or at != count:
        raise UnreadableCloud(f"states {count:,} points and has {at:,}")
    return np.concatenate(parts).astype(np.float64), count


def limit(size: int, memory: int) -> None:
    """Where the system can do so: not more time and memory than a file of so many bytes needs."""
    import lazrs  # noqa: F401

    try:
        import resource
    except ImportError:
        return
    try:
        taken = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        taken = UNKNOWN
    seconds = round(SECONDS + SECONDS_A_BYTE * size)
    for what, most in (
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_AS, taken + memory),
    ):
        hard = resource.getrlimit(what)[1]
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(what, (most, hard))


def main(given: str, wanted: str, most: str, memory: str) -> None:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # each thread would reserve memory
    limit(os.path.getsize(given), int(memory))
    try:
        points, count = las_points(Path(given), int(most))
    except UnreadableCloud as error:
        sys.stderr.write(f"\n{error}\n")
        sys.exit(REFUSED)
    np.savez(wanted, points=points, count=count)


if __name__ == "__main__":
    main(*sys.argv[1:])
