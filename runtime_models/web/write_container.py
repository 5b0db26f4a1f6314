"""The file that a web page reads: "SHIFTWEB", a table of contents in JSON, and arrays.

Tables are stored as codes between the ends of each column, lowest bytes first: such bytes deflate
better than floats do, and 16 bits of a position are finer than what a screen shows.

Whatever stands in the table of contents has a TypedDict, here, in web_model.py or in page_scene.py:
`python3 tools/web/write_conventions.py` writes their fields down for the page's JavaScript.
"""

import json
import struct
from collections.abc import Mapping
from typing import Any, Literal, NotRequired, TypedDict

import numpy as np

from shapeshift.runtime_models.model import BadFile

MAGIC = b"SHIFTWEB"
FORMAT: Literal["shapeshift web 1"] = "shapeshift web 1"
SectionKind = Literal["f32", "f16", "u16", "u8", "p8", "p16", "p24"]  # p: planes of bytes of codes
TYPES: dict[str, SectionKind] = {
    "float32": "f32", "float16": "f16", "uint16": "u16", "uint8": "u8",
}  # fmt: skip
PLANES: tuple[SectionKind, ...] = ("p8", "p16", "p24")  # by how many bytes a code has
Section = tuple[SectionKind, int, int]  # type, byte offset, count of numbers


class TableEntry(TypedDict):
    """(N, width) numbers as codes 0..most between the ends (2, width) of each column.

    Without `most` the codes are the numbers themselves.
    """

    codes: Section
    ends: Section
    width: int
    most: NotRequired[int]


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

    def add_table(self, what: str, table: np.ndarray, bits: int = 16) -> TableEntry:
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
        section = self._append(PLANES[planes - 1], data, codes.size)
        return {"codes": section, "ends": self.add(ends), "width": width, "most": most}

    def pack(self, scene: Mapping[str, Any]) -> bytes:
        """The whole file, with what the scene says of the arrays; its first word is FORMAT."""
        text = json.dumps(scene, separators=(",", ":"), allow_nan=False)
        head = MAGIC + struct.pack("<I", len(text.encode())) + text.encode()
        return head + bytes(-len(head) % 4) + b"".join(self._parts)

    def _append(self, kind: SectionKind, data: bytes, count: int) -> Section:
        section = (kind, self._length, count)
        self._parts.append(data + bytes(-len(data) % 4))
        self._length += len(self._parts[-1])
        return section
