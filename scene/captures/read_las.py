"""Points of laser scanners, LAS and LAZ, through laspy; large clouds are thinned while read."""

import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.memory import Memory
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.las_run import (
    REFUSED,
    SECONDS,
    SECONDS_A_BYTE,
    UnreadableCloud,
    las_points,
)

# mark, where the points begin, how many records lie before them, which format points have
HEAD = struct.Struct("<4s92xIIB")
PACKED = 0xC0  # bits of the format: LAZ
RECORD = 54  # bytes that such a record has at least
WAIT = 20  # times the processor time of a reading process, where it cannot be limited itself


def read_las(path: Path, most: int) -> tuple[np.ndarray, int]:
    """(P, 3) float64 metres, in the file's own world, of about `most` points, and how many it has.

    LAZ is unpacked by a process of its own.  Raises BadFile.
    """
    where = path_end(path)
    if not path.is_file():
        raise BadFile(f"{where}: the file of points is missing; put it there")
    packed = refuse_head(path, where)
    try:
        return unpacked(path, most) if packed else las_points(path, most)
    except UnreadableCloud as error:
        raise BadFile(f"{where}: {error}; copy it again") from None


def unpacked(path: Path, most: int) -> tuple[np.ndarray, int]:
    """las_points of a LAZ in a process of its own.  Raises UnreadableCloud alone."""
    script = str(Path(__file__).with_name("las_run.py"))
    patience = WAIT * (SECONDS + SECONDS_A_BYTE * path.stat().st_size)
    with tempfile.TemporaryDirectory() as folder:
        wanted, said = Path(folder, "points.npz"), Path(folder, "said")
        command = [sys.executable, "-P", script, str(path.absolute()), str(wanted), str(most)]
        command.append(str(Memory().of(path).left))
        with open(said, "wb") as errors:
            try:
                done = subprocess.run(
                    command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=errors,
                    timeout=patience,
                )  # fmt: skip
            except subprocess.TimeoutExpired:
                raise UnreadableCloud("takes longer to unpack than it can have points") from None
        if done.returncode == REFUSED:
            raise UnreadableCloud(said.read_text(errors="replace").strip().splitlines()[-1])
        if done.returncode or not wanted.is_file():
            raise UnreadableCloud("no LAZ that can be unpacked")
        with np.load(wanted) as file:
            return file["points"], int(file["count"])


def refuse_head(path: Path, where: str) -> bool:
    """Whether the points are packed.  Raises BadFile for what laspy would read for minutes."""
    with open(path, "rb") as file:
        head = file.read(HEAD.size)
    if len(head) < HEAD.size or not head.startswith(b"LASF"):
        raise BadFile(f"{where}: no LAS or LAZ file; copy it again")
    _, begins, records, form = HEAD.unpack(head)
    if not records * RECORD <= begins <= path.stat().st_size:
        raise BadFile(
            f"{where}: states {records:,} records before its points at byte {begins:,}, which the "
            "file cannot hold; copy it again"
        )
    return bool(form & PACKED)
