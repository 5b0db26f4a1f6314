"""State dicts as torch.save writes them, made without torch: for tests of what reads them."""

import struct
import zipfile
from pathlib import Path

import numpy as np


def text(word: str) -> bytes:
    data = word.encode()
    return b"X" + struct.pack("<I", len(data)) + data


def number(value: int) -> bytes:
    return b"J" + struct.pack("<i", value)


def numbers(values: tuple[int, ...]) -> bytes:
    return b"(" + b"".join(map(number, values)) + b"t"


EMPTY_ORDERED_DICT = b"ccollections\nOrderedDict\n)R"


def tensor(key: str, array: np.ndarray) -> bytes:
    """The opcodes of one float32 tensor in the storage `key`."""
    strides = tuple(stride // array.itemsize for stride in array.strides)
    storage = text("storage") + b"ctorch\nFloatStorage\n" + text(key) + text("cpu")
    return (
        b"ctorch._utils\n_rebuild_tensor_v2\n(("
        + storage + number(array.size) + b"tQ" + number(0)
        + numbers(array.shape) + numbers(strides) + b"\x89" + EMPTY_ORDERED_DICT + b"tR"
    )  # fmt: skip


def save_tensors(path: Path, tensors: dict[str, np.ndarray]) -> None:
    """A zip with data.pkl and one member for each tensor's numbers."""
    arrays = {name: np.ascontiguousarray(a, "<f4") for name, a in tensors.items()}
    rows = [text(name) + tensor(str(i), a) for i, (name, a) in enumerate(arrays.items())]
    with zipfile.ZipFile(path, "w") as archive:
        pickle = b"\x80\x02" + EMPTY_ORDERED_DICT + b"(" + b"".join(rows) + b"u."
        archive.writestr("archive/data.pkl", pickle)
        archive.writestr("archive/version", "3\n")
        for i, array in enumerate(arrays.values()):
            archive.writestr(f"archive/data/{i}", array.tobytes())
