"""Values through a pipe: JSON, with arrays and bytes behind it as they lie in memory."""

import json
import math
import struct
from typing import Any, BinaryIO

import numpy as np

HEAD = struct.Struct("<QQ")  # bytes of the JSON, bytes of all that follows it
MOST_JSON = 64 << 20  # bytes
KINDS = "biufSU"  # numbers and texts: no objects
BLOB = "@"  # the key of what stands for an array or bytes


def send(pipe: BinaryIO, value: Any) -> None:
    """A value of JSON's types, arrays and bytes among them.  Raises OSError, TypeError."""
    blobs: list[memoryview] = []
    text = json.dumps(standing(value, blobs)).encode()
    pipe.write(HEAD.pack(len(text), sum(len(blob) for blob in blobs)) + text)
    for blob in blobs:
        pipe.write(blob)
    pipe.flush()


def standing(part: Any, blobs: list[memoryview]) -> Any:
    """What stands for a value in JSON; its arrays and bytes are put behind the others."""
    # A function of its own: one inside `send` would be a ring of garbage that holds the arrays.
    if isinstance(part, dict):
        return {str(key): standing(each, blobs) for key, each in part.items()}
    if isinstance(part, list | tuple):
        return [standing(each, blobs) for each in part]
    if isinstance(part, bytes):
        blobs.append(memoryview(part))
        return {BLOB: len(part)}
    if isinstance(part, np.ndarray):
        if part.dtype.kind not in KINDS:
            raise TypeError(f"an array of {part.dtype} goes through no pipe")
        flat = np.ascontiguousarray(part).reshape(-1)
        blobs.append(flat.view(np.uint8).data if part.size else memoryview(b""))
        return {BLOB: part.nbytes, "of": part.dtype.str, "shape": part.shape}
    return part.item() if isinstance(part, np.generic) else part


def receive(pipe: BinaryIO, most: int) -> Any:
    """The next value, whose arrays have at most so many bytes.

    Raises EOFError; ValueError, TypeError, KeyError, RecursionError where it is no such value.
    """
    length, rest = HEAD.unpack(exactly(pipe, HEAD.size))
    if not (length <= MOST_JSON and rest <= most):
        raise ValueError(f"{length:,} and {rest:,} bytes are more than was asked for")
    left = [rest]
    value = whole(json.loads(exactly(pipe, length)), pipe, left)
    if left[0]:
        raise ValueError("its sizes do not add up")
    return value


def whole(part: Any, pipe: BinaryIO, left: list[int]) -> Any:
    """The value of what stands for it, arrays and bytes read in the order in which they were sent.

    left: [bytes of them that are still to come].
    """
    if isinstance(part, list):
        return [whole(each, pipe, left) for each in part]
    if not isinstance(part, dict):
        return part
    if BLOB not in part:
        return {key: whole(each, pipe, left) for key, each in part.items()}
    if not 0 <= (size := part[BLOB]) <= left[0]:
        raise ValueError("its sizes do not add up")
    left[0] -= size
    return array(pipe, part, size) if "of" in part else exactly(pipe, size)


def array(pipe: BinaryIO, facts: dict, size: int) -> np.ndarray:
    """The array of so many bytes that comes next, read where it stays."""
    kind, shape = np.dtype(facts["of"]), tuple(facts["shape"])
    # Else no bytes could stand for an array of any size.
    if kind.kind not in KINDS or math.prod(shape) * max(kind.itemsize, 1) != size:
        raise ValueError(f"{size:,} bytes for an array {shape} of {kind}")
    made = np.empty(shape, kind)
    flat: Any = made.reshape(-1).view(np.uint8) if size else b""
    view, at = memoryview(flat), 0
    while at < size:
        count = pipe.readinto(view[at:])  # type: ignore[attr-defined]
        if not count:
            raise EOFError("the other end is gone")
        at += count
    return made


def exactly(pipe: BinaryIO, size: int) -> bytes:
    """So many bytes of a buffered pipe.  Raises EOFError where the other end is gone before."""
    data = pipe.read(size)
    if len(data) != size:
        raise EOFError("the other end is gone")
    return data
