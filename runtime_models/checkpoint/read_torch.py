"""Tensors out of torch's files (TorchScript archives, state dicts) without torch or its unpickler.

Layout: a zip that stores TOP/data.pkl, whose tensors point into TOP/data/KEY, one member a storage.
"""

import math
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.checkpoint.tensor_pickle import (
    MOST_OPCODES,
    Storage,
    Tensor,
    index_of,
)
from shapeshift.runtime_models.files.memory import Account, Memory
from shapeshift.runtime_models.files.zip_files import (
    DAMAGED,
    is_zip,
    opened_zip,
)
from shapeshift.runtime_models.model import BadFile

INDEX = "data.pkl"
LARGEST_INDEX = 16 << 20  # bytes
INDEX_A_BYTE = 256  # bytes of memory: an opcode of one byte may become a dictionary
MOST_DIMENSIONS = 8
LONGEST = 1 << 31  # of a tensor that holds nothing
OLD_MAGIC = b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19."  # torch.save before 1.6


def read_tensors(
    path: Path, memory: Account | None = None, wanted: Callable[[str], bool] | None = None
) -> dict[str, np.ndarray]:
    """Every tensor of a file by torch.jit.save or torch.save by its dotted name ("0.weight").

    As read_script, without the modules; `wanted` says by name which ones are read.  Raises BadFile.
    """
    return read_script(path, memory, wanted)[0]


def read_script(
    path: Path, memory: Account | None = None, wanted: Callable[[str], bool] | None = None
) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Tensors and modules ("1": "ReLU"; a state dict names none) of a file, by dotted names.

    Read-only arrays, float32 where the file holds bfloat16, else of the file's own type.  Whatever
    else the file names is refused, and nothing in it is ever called.  Raises BadFile.
    """
    memory = memory or Memory().of(path)
    if not is_zip(path):
        raise BadFile(_no_archive(path))
    with opened_zip(path, path.name, memory) as archive:
        members = _Members(archive, path, memory)
        data = members.read(INDEX, LARGEST_INDEX)
        with memory.lend(INDEX_A_BYTE * min(len(data), MOST_OPCODES), "its index of tensors"):
            index = index_of(data, path.name)
        tensors = {n: t for n, t in index.tensors.items() if wanted is None or wanted(n)}
        order = members.read("byteorder", 64) if members.has("byteorder") else b"little"
        if order != b"little":
            raise BadFile(f"{path.name} has its numbers in {order!r} order; save it on a PC.")
        storages = {t.storage.key: t.storage for t in tensors.values()}
        kept = {key: members.numbers(storage) for key, storage in storages.items()}
    if not index.tensors:
        raise BadFile(f"{path.name} holds no tensor; wanted are networks saved by torch.")
    for name, tensor in tensors.items():
        if tensor.storage != storages[tensor.storage.key]:
            raise BadFile(f"{path.name}: {name} reads a storage as two types; save it again.")
    views = {name: _view(t, kept[t.storage.key], name, path) for name, t in tensors.items()}
    return views, index.modules


def _no_archive(path: Path) -> str:
    with path.open("rb") as file:
        head = file.read(len(OLD_MAGIC))
    if head.startswith(b"\x80"):
        return (
            f"{path.name} is a bare pickle, as torch.save wrote it before version 1.6, which is "
            "not read; load it with torch and save it again."
        )
    return f"{path.name} is no archive of torch, or it is cut off; copy or save it again."


class _Members:
    """The members of an archive by name, below its one top folder.  Names are never paths."""

    def __init__(self, archive: zipfile.ZipFile, path: Path, memory: Account) -> None:
        self._archive, self._path, self._memory = archive, path, memory
        entries = archive.infolist()
        tops = [e.filename[: -len(INDEX)] for e in entries if e.filename.endswith(INDEX)]
        tops = [top for top in tops if top == "" or (top.endswith("/") and top.count("/") == 1)]
        if len(tops) != 1:
            raise BadFile(
                f"{path.name} is a zip with {len(tops)} indexes of tensors ({INDEX}), expected "
                "one; wanted is a file by torch.jit.save or torch.save."
            )
        self._top = tops[0]
        self._entries = {e.filename: e for e in entries}

    def has(self, name: str) -> bool:
        return self._top + name in self._entries

    def read(self, name: str, most: int) -> bytes:
        """The bytes of a member, at most `most`; torch stores all that is read here as it is."""
        entry, file = self._entries.get(self._top + name), self._path.name
        if entry is None:
            raise BadFile(f"{file} lacks {name[:80]!r}; it is cut off, save it again.")
        size = entry.file_size
        if entry.compress_type != zipfile.ZIP_STORED or entry.compress_size != size:
            raise BadFile(
                f"{file}: {name[:80]!r} is compressed, which torch never does; save it again."
            )
        if size > min(most, self._path.stat().st_size):
            raise BadFile(
                f"{file}: {name[:80]!r} is said to have {size:,} bytes, which is more than it may "
                "or than the file has; save it again."
            )
        self._memory.charge(size, f"{name[:80]!r}")
        try:
            return self._archive.read(entry)
        except DAMAGED:
            raise BadFile(f"{file}: {name[:80]!r} cannot be read; save it again.") from None

    def numbers(self, storage: Storage) -> np.ndarray:
        """(count,) of one storage, as many as it has promised."""
        brain_float = storage.item == "bf16"
        dtype = np.dtype("<u2" if brain_float else storage.item)
        wanted = storage.count * dtype.itemsize
        data = self.read(f"data/{storage.key}", wanted)
        if len(data) != wanted:
            raise BadFile(
                f"{self._path.name}: a tensor wants {wanted:,} bytes, {len(data):,} are stored; "
                "it is cut off, save it again."
            )
        found = np.frombuffer(data, dtype)
        self._memory.charge(4 * wanted if brain_float else 0, "numbers of two bytes")
        return (found.astype("<u4") << 16).view("<f4") if brain_float else found


def _view(tensor: Tensor, numbers: np.ndarray, name: str, path: Path) -> np.ndarray:
    """The tensor in its storage, which holds all of it."""
    size, count = tensor.size, math.prod(tensor.size)
    last = tensor.offset + sum(
        (n - 1) * step for n, step in zip(size, tensor.stride, strict=True) if n
    )
    inside = count <= len(numbers) and (count == 0 or last < len(numbers))
    if not inside or len(size) > MOST_DIMENSIONS or max(size, default=0) > LONGEST:
        raise BadFile(
            f"{path.name}: tensor {name} of {list(size)[:8]} numbers reaches beyond its storage of "
            f"{len(numbers):,}; the file is damaged, save it again."
        )
    if count == 0:
        return np.zeros(size, numbers.dtype)
    steps = [step * numbers.itemsize for step in tensor.stride]
    start = numbers[tensor.offset :]
    return np.lib.stride_tricks.as_strided(start, size, steps, writeable=False)
