"""Archives as torch.save writes them, made by hand: good ones and ones no torch would write."""

import io
import zipfile
from pathlib import Path

import numpy as np

KINDS = {"f4": "FloatStorage", "f8": "DoubleStorage", "f2": "HalfStorage", "i8": "LongStorage"}


def text(value: str) -> bytes:
    data = value.encode()
    return b"X" + len(data).to_bytes(4, "little") + data


def number(value: int) -> bytes:
    data = value.to_bytes(value.bit_length() // 8 + 1, "little", signed=True)
    return b"\x8a" + bytes([len(data)]) + data


def name(module: str, word: str) -> bytes:
    return f"c{module}\n{word}\n".encode()


def numbers(values) -> bytes:
    return b"(" + b"".join(number(int(v)) for v in values) + b"t"


def tensor(
    key: str, count: int, size, stride, offset: int = 0, kind: str = "FloatStorage"
) -> bytes:
    """The opcodes that leave one tensor on the stack."""
    storage = b"(" + text("storage") + name("torch", kind) + text(key) + text("cpu")
    given = b"(" + storage + number(count) + b"tQ" + number(offset) + numbers(size)
    return name("torch._utils", "_rebuild_tensor_v2") + given + numbers(stride) + HOOKS + b"tR"


HOOKS = b"\x89" + name("collections", "OrderedDict") + b")R"


def program(body: bytes) -> bytes:
    """A whole pickle that leaves what `body` does."""
    return b"\x80\x02" + body + b"."


def dictionary(items: dict[str, bytes]) -> bytes:
    return b"}(" + b"".join(text(key) + value for key, value in items.items()) + b"u"


def archive(index: bytes, storages: dict[str, bytes], top: str = "archive") -> bytes:
    """The zip around an index and its storages."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as file:
        file.writestr(f"{top}/data.pkl", index)
        file.writestr(f"{top}/byteorder", b"little")
        for key, numbers_ in storages.items():
            file.writestr(f"{top}/data/{key}", numbers_)
        file.writestr(f"{top}/version", b"3\n")
    return data.getvalue()


def write_tensors(path: Path, arrays: dict[str, np.ndarray]) -> Path:
    """A state dict of plain arrays, as torch.save writes it."""
    items, storages = {}, {}
    for i, (label, array) in enumerate(arrays.items()):
        array = np.ascontiguousarray(array)
        strides = [step // array.itemsize for step in array.strides]
        kind = KINDS[array.dtype.str[1:]]
        items[label] = tensor(str(i), array.size, array.shape, strides, kind=kind)
        storages[str(i)] = array.tobytes()
    path.write_bytes(archive(program(dictionary(items)), storages))
    return path
