"""Points of laser scanners, LAS and LAZ, through laspy; large clouds are thinned while read."""

import struct
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.memory import Memory
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.gate.gate import ask
from shapeshift.runtime_models.model import BadFile

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
