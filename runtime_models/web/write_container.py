"""The file that a web page reads: "SHIFTWEB", a table of contents in JSON, and arrays.

Tables are stored as codes between the ends of each column, lowest bytes first: such bytes deflate
better than floats do, and 16 bits of a position are finer than what a screen shows.
"""

import json
import struct
from typing import Literal

import numpy as np

from shapeshift.runtime_models.model import BadFile

MAGIC = b"SHIFTWEB"
FORMAT = "shapeshift web 1"
TYPES = {"float32": "f32", "float16": "f16", "uint16": "u16", "uint8": "u8"}
Section = list  # [type, byte offset, count]


class Container:
    """Arrays one after the other, each named by its type, byte offset and count."""

    def __init__(self, exact: bool = False) -> None:
        self.exact = exact  # tables as float32 instead of codes
        self._parts: list[bytes] = []
        self._length = 0

    def add(self, array: np.ndarray, kind: Literal["float32", "uint8"] = "float32") -> Section:
        """An array as it is."""
        data = np.ascontiguousarray(array, np.dtype(kind).newbyteorder("<"))
        return self._append(TYPES[kind], data.tobytes(), data.size)

    def add_table(self, what: str, table: np.ndarray, bits: int = 16) -> dict:
        """(N, C) numbers as codes of so many bits, at most 24.  BadFile where one is not finite."""
        table = np.asarray(table, np.float64)
        if not np.isfinite(table).all():
            raise BadFile(f"{what} of the scene are not all finite; `info` and `lint` say which.")
        low, high = table.min(axis=0, initial=np.inf), table.max(axis=0, initial=-np.inf)
        ends = np.stack([low, high]).astype(np.float32)  # (2, C)
        width = table.shape[1]
        if self.exact:
            return {"codes": self.add(table), "ends": self.add(ends), "width": width}
        most = 2**bits - 1
        low, high = ends.astype(np.float64)
        scale = np.divide(most, high - low, out=np.zeros(width), where=high > low)
        codes = np.clip(np.rint((table - low) * scale), 0, most).astype(np.uint32)
        planes = -(-bits // 8)
        data = b"".join(((codes >> 8 * p) & 255).astype(np.uint8).tobytes() for p in range(planes))
        section = self._append(f"p{8 * planes}", data, codes.size)
        return {"codes": section, "ends": self.add(ends), "width": width, "most": most}

    def pack(self, scene: dict) -> bytes:
        """The whole file, with what the scene says of the arrays."""
        text = json.dumps({"format": FORMAT, **scene}, separators=(",", ":"), allow_nan=False)
        head = MAGIC + struct.pack("<I", len(text.encode())) + text.encode()
        return head + bytes(-len(head) % 4) + b"".join(self._parts)

    def _append(self, kind: str, data: bytes, count: int) -> Section:
        section = [kind, self._length, count]
        self._parts.append(data + bytes(-len(data) % 4))
        self._length += len(self._parts[-1])
        return section
