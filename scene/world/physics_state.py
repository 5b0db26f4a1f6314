"""A snapshot of the physics as bytes: our own books as JSON, then the engine's, under one hash."""

import hashlib
import json
from collections.abc import Iterable

import numpy as np

from shapeshift.scene.pose import Pose

MARK = b"shapeshift physics 1\n"
HASH_BYTES = 32


def pack(books: dict, engine: bytes) -> bytes:
    """The mark, the SHA-256 of the rest, the length of the books (8 bytes), books, engine."""
    text = json.dumps(books, separators=(",", ":"), allow_nan=False).encode()
    rest = len(text).to_bytes(8, "little") + text + engine
    return MARK + hashlib.sha256(rest).digest() + rest


def unpack(data: bytes) -> tuple[dict, bytes]:
    """Books and engine of a snapshot whose every bit is as written.  Raises ValueError."""
    start = len(MARK) + HASH_BYTES
    rest = data[start:]
    digest = data[len(MARK) : start]
    if not data.startswith(MARK) or hashlib.sha256(rest).digest() != digest:
        raise ValueError(
            f"{len(data)} bytes are no whole snapshot of this program's physics; take a new one."
        )
    length = int.from_bytes(rest[:8], "little")
    return json.loads(rest[8 : 8 + length]), rest[8 + length :]


def hash_of(rows: Iterable[tuple[int, Pose, np.ndarray, np.ndarray]]) -> str:
    """SHA-256 of objects: id, pose, (3,) m/s and (3,) rad/s of each, to the bit."""
    digest = hashlib.sha256()
    for number, pose, linear, turning in rows:
        row = np.concatenate([[number], pose.position, pose.wxyz, linear, turning])
        digest.update(row.astype("<f8").tobytes())
    return digest.hexdigest()
