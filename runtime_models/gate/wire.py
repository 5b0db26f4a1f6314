"""Values through a pipe: JSON, with arrays and bytes behind it as they lie in memory."""

import json
import struct
from typing import Any, BinaryIO

import numpy as np

HEAD = struct.Struct("<QQ")  # bytes of the JSON, bytes of all that follows it
MOST_JSON = 64 << 20  # bytes
KINDS = "biufSU"  # numbers and texts: no objects
BLOB = "@"  # the key of what stands for an array or bytes


def send(pipe: BinaryIO, value: Any) -> None:
    """A value of JSON's types, arrays and bytes among them.  Raises OSError, TypeError."""
    blobs: list[np.ndarray] = []

    def standing(part: Any) -> Any:
        if isinstance(part, dict):
            return {str(key): standing(each) for key, each in part.items()}
        if isinstance(part, list | tuple):
            return [standing(each) for each in part]
        if isinstance(part, bytes):
            blobs.append(np.frombuffer(part, np.uint8))
            return {BLOB: len(blobs) - 1, "bytes": True}
        if isinstance(part, np.ndarray):
            if part.dtype.kind not in KINDS:
                raise TypeError(f"an array of {part.dtype} goes through no pipe")
            blobs.append(np.ascontiguousarray(part).reshape(part.shape))
            return {BLOB: len(blobs) - 1, "of": part.dtype.str, "shape": part.shape}
        return part.item() if isinstance(part, np.generic) else part

    text = json.dumps({"value": standing(value), "sizes": [blob.nbytes for blob in blobs]}).encode()
    pipe.write(HEAD.pack(len(text), sum(blob.nbytes for blob in blobs)) + text)
    for blob in blobs:
        pipe.write(blob.reshape(-1).view(np.uint8).data if blob.size else b"")
    pipe.flush()


def receive(pipe: BinaryIO, most: int) -> Any:
    """The next value, whose arrays have at most so many bytes.  Raises EOFError, ValueError."""
    length, rest = HEAD.unpack(exactly(pipe, HEAD.size))
    if not (length <= MOST_JSON and rest <= most):
        raise ValueError(f"{length:,} and {rest:,} bytes are more than was asked for")
    message = json.loads(bytes(exactly(pipe, length)))
    sizes = message["sizes"]
    if sum(sizes) != rest or min(sizes, default=0) < 0:
        raise ValueError("its sizes do not add up")
    blobs = [exactly(pipe, size) for size in sizes]

    def whole(part: Any) -> Any:
        if isinstance(part, list):
            return [whole(each) for each in part]
        if not isinstance(part, dict):
            return part
        if BLOB not in part:
            return {key: whole(each) for key, each in part.items()}
        blob = blobs[part[BLOB]]
        if "bytes" in part:
            return bytes(blob)
        kind = np.dtype(part["of"])
        if kind.kind not in KINDS:
            raise ValueError(f"an array of {kind}")
        if not blob:
            return np.zeros(part["shape"], kind)
        return np.frombuffer(blob, kind).reshape(part["shape"])

    return whole(message["value"])


def exactly(pipe: BinaryIO, size: int) -> bytearray:
    """So many bytes, writable.  Raises EOFError where the other end is gone before."""
    data = bytearray(size)
    view, at = memoryview(data), 0
    while at < size:
        count = pipe.readinto(view[at:])  # type: ignore[attr-defined]
        if not count:
            raise EOFError("the other end is gone")
        at += count
    return data
