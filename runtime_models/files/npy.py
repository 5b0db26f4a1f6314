"""Arrays of plain numbers out of numpy's .npz: nothing is unpickled, all is charged beforehand."""

import io
import math
import tokenize
import warnings
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO

import numpy as np

from shapeshift.runtime_models.files.memory import Account
from shapeshift.runtime_models.files.zip_files import DAMAGED, read_member
from shapeshift.runtime_models.model import BadFile

BAD_HEADER = (TypeError, SyntaxError, tokenize.TokenError)  # numpy reads it as Python's literal
HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
MOST_SIDES = 8  # dimensions
NUMBERS = "fiu"  # kinds of numpy's: floats and whole numbers


def read_array(
    archive: zipfile.ZipFile, name: str, where: str, memory: Account
) -> np.ndarray | None:
    """The array called `name` of an .npz, read-only; None where there is none.  Raises BadFile.

    `where` is for messages.  The bytes of the array stay charged.
    """
    try:
        entry = archive.getinfo(f"{name}.npy")
    except KeyError:
        return None
    data = read_member(archive, entry, where, memory)
    file = io.BytesIO(data)
    try:
        read_header = HEADERS.get(np.lib.format.read_magic(file))
        if read_header is None:
            raise BadFile(f"{where}: {name} is of an unknown version; write it with numpy.savez.")
        with warnings.catch_warnings():  # of Python 2's headers numpy would say so
            warnings.simplefilter("ignore")
            shape, by_columns, kind = read_header(file)
    except BadFile:
        raise
    except (*DAMAGED, *BAD_HEADER, OverflowError, MemoryError, RecursionError):
        raise BadFile(f"{where}: {name} is no array of numpy; write it again.") from None
    if kind.kind not in NUMBERS or kind.hasobject:
        raise BadFile(f"{where}: {name} holds {kind!s:.40}; plain numbers are wanted.")
    there = len(data) - file.tell()
    usual = len(shape) <= MOST_SIDES and min(shape, default=0) >= 0
    if not usual or math.prod(shape) * kind.itemsize != there:
        raise BadFile(
            f"{where}: {name} states the shape {shape!s:.40}, but {there:,} bytes follow; copy it "
            "again."
        )
    numbers = np.frombuffer(data, kind, offset=file.tell())
    return numbers.reshape(shape, order="F" if by_columns else "C")


def write_arrays(target: str | Path | IO[bytes], arrays: Mapping[str, np.ndarray]) -> None:
    """Arrays by their names as a compressed .npz."""
    save: Callable[..., None] = np.savez_compressed  # numpy takes its keywords for one flag
    save(target, **arrays)
