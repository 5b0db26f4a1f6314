"""The bytes and arrays of a glTF 2.0 asset: chunks, buffers, views, accessors; all checked.

By json and numpy: pygltflib takes the lengths in the file on trust, decodes a whole data: URI and
follows any path before it looks at a size, which is not for files from strangers.
"""

import base64
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, parse_json
from shapeshift.runtime_models.files.memory import JSON_A_BYTE, Account
from shapeshift.runtime_models.model import BadFile

MAGIC = b"glTF"
GENERATOR = "Shapeshift"  # of files up to 0.4, which were written in our axes: right, up, back
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
MOST_MARKS = 200_000  # of { [ , : in the JSON: bounds the memory that its objects take
TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
LARGEST = {5120: 127, 5121: 255, 5122: 32767, 5123: 65535}  # what stands for 1 when normalised
STRANGE = {"\\", ":", *map(chr, range(0xD800, 0xE000))}  # in no name of a file beside
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class Asset:
    """One glTF file and what lies beside it; `read` gives an accessor's numbers."""

    def __init__(self, path: Path, memory: Account) -> None:
        self.path, self.memory = path, memory
        data = np.memmap(path, np.uint8, "r") if path.stat().st_size else np.zeros(0, np.uint8)
        text, self._binary = split_glb(data, path.name)
        memory.charge(JSON_A_BYTE * len(text), "its JSON")
        self.json = parse_asset(text, path.name)
        self._buffers: dict[int, np.ndarray] = {}
        version = str(self.item(self.json, "asset", dict, {}).get("version", ""))
        if not version.startswith("2."):
            raise BadFile(f"{path.name} is glTF {version or 'without a version'}; 2.0 is read.")

    @property
    def in_our_axes(self) -> bool:
        """Whether it is right, up, back, as we once wrote it, instead of left, up, front."""
        return self.item(self.json, "asset", dict, {}).get("generator") == GENERATOR

    def refuse(self, text: str) -> BadFile:
        return BadFile(f"{self.path.name}: {text}")

    def item(
        self, owner: Mapping[str, Any], name: str, kind: type, otherwise: object = None
    ) -> Any:
        """owner[name], of a type; `otherwise` where it is absent.  Raises BadFile."""
        return Fields(owner, self.path.name).typed(name, kind, otherwise)

    def entry(self, kind: str, index: object) -> dict:
        """The object number `index` of one of the asset's lists.  Raises BadFile."""
        rows = self.item(self.json, kind, list, [])
        known = isinstance(index, int) and not isinstance(index, bool) and 0 <= index < len(rows)
        if not known or not isinstance(rows[index], dict):
            raise self.refuse(f"{str(index)[:40]} of '{kind}' is named, and there is none.")
        return rows[index]

    def view(self, index: int) -> tuple[np.ndarray, int]:
        """The bytes of a buffer view, and its stride (0: closely packed)."""
        view = self.entry("bufferViews", index)
        if "EXT_meshopt_compression" in self.item(view, "extensions", dict, {}):
            raise self.refuse("it is compressed by meshopt; export it without.")
        data = self.buffer(self.item(view, "buffer", int, -1))
        start, length = self.item(view, "byteOffset", int, 0), self.item(view, "byteLength", int, 0)
        if start + length > len(data):
            raise self.refuse(
                f"buffer view {index} ends at byte {start + length} of a buffer of {len(data)}; "
                "it is cut off."
            )
        return data[start : start + length], self.item(view, "byteStride", int, 0)

    def buffer(self, index: int) -> np.ndarray:
        """(bytes,) uint8 of a buffer: the binary chunk, a data: URI or a file beside this one."""
        if index in self._buffers:
            return self._buffers[index]
        entry = self.entry("buffers", index)
        uri, size = self.item(entry, "uri", str), self.item(entry, "byteLength", int, 0)
        if uri is None:
            data = self._binary if index == 0 else np.zeros(0, np.uint8)
        elif uri[:5].lower() == "data:":
            data = self._decode(uri)
        else:
            data = self._beside(uri)
        if size > len(data):
            raise self.refuse(f"buffer {index} has {len(data)} bytes of {size}; it is cut off.")
        self._buffers[index] = data[:size]
        return self._buffers[index]

    def _decode(self, uri: str) -> np.ndarray:
        kind, _, text = uri.partition(",")
        if not kind.endswith(";base64"):
            raise self.refuse("a buffer's data: URI is not in base64.")
        self.memory.charge(2 * len(text), "a buffer's data: URI")
        try:
            return np.frombuffer(base64.b64decode(text, validate=True), np.uint8)
        except ValueError:  # binascii.Error, and letters that are not ASCII
            raise self.refuse("a buffer's data: URI is damaged.") from None

    def _beside(self, uri: str) -> np.ndarray:
        """A file in the folder of this one, or below; nothing else is ever opened."""
        name, folder = unquote(uri), self.path.parent.resolve()
        usual = not name.startswith("/") and not any(c in STRANGE or c < " " for c in name)
        usual &= all(len(part.encode("utf-8", "replace")) < 256 for part in name.split("/"))
        usual &= len(name) < 1000  # what disks take
        target = (folder / name).resolve() if usual else None
        if target is None or not target.is_relative_to(folder):
            raise self.refuse(
                f"a buffer lies at {uri[:60]!r}; only files in the same folder are read."
            )
        if not target.is_file():
            raise self.refuse(f"its buffer {name[:60]!r} is not beside it; copy it there.")
        if not (size := os.stat(target).st_size):
            return np.zeros(0, np.uint8)
        self.memory.widen(size)
        return np.memmap(target, np.uint8, "r")

    def count(self, index: int) -> int:
        """How many elements an accessor promises."""
        return self.item(self.entry("accessors", index), "count", int, 0)

    def read(self, index: int, name: str, width: int) -> np.ndarray:
        """(count, width) of an accessor: a view of the file where it holds floats, else float32.

        Normalised integers are 0..1 or -1..1.  Raises BadFile.
        """
        entry = self.entry("accessors", index)
        if "sparse" in entry or "bufferView" not in entry:
            raise self.refuse(f"{name} is a sparse or an empty accessor; export it in full.")
        kind, code = entry.get("type"), entry.get("componentType")
        if not isinstance(kind, str) or WIDTHS.get(kind) != width:
            raise self.refuse(f"{name} is of {str(kind)[:20]!r}, expected {width} numbers.")
        if not isinstance(code, int) or code not in TYPES:
            raise self.refuse(f"{name} has the component type {str(code)[:20]!r}, which is none.")
        number = np.dtype(TYPES[code])
        data, stride = self.view(entry["bufferView"])
        start, count = self.item(entry, "byteOffset", int, 0), self.count(index)
        size = number.itemsize * width
        if stride and stride < size:
            raise self.refuse(f"{name} has a stride of {stride} bytes for {size}.")
        stride = stride or size
        if count and start + stride * (count - 1) + size > len(data):
            raise self.refuse(
                f"{name} promises {count} elements of {stride} bytes, its buffer view has "
                f"{len(data)}; it is cut off or a number in it is wrong."
            )
        table = np.ndarray((count, width), number, data, start, (stride, number.itemsize))
        if not self.item(entry, "normalized", bool, False) or code not in LARGEST:
            return table.astype(np.float32, copy=False)
        return np.maximum(table.astype(np.float32) / LARGEST[code], -1)


def split_glb(data: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
    """The bytes of the JSON and of the binary chunk of a .glb; of a .gltf all is JSON."""
    if data[:4].tobytes() != MAGIC:
        return data, np.zeros(0, np.uint8)
    if len(data) < 20:
        raise BadFile(f"{name} ends within its header; it is cut off.")
    _, version, length = np.frombuffer(data[:12].tobytes(), "<u4")
    if version != 2:
        raise BadFile(f"{name} is binary glTF {version}; 2 is read.")
    if length > len(data):
        raise BadFile(f"{name} has {len(data)} bytes, its header says {length}; it is cut off.")
    found: dict[int, np.ndarray] = {}
    place = 12
    while place + 8 <= length and len(found) < 2:
        size, kind = (int(n) for n in np.frombuffer(data[place : place + 8].tobytes(), "<u4"))
        if place + 8 + size > length:
            raise BadFile(f"{name} has a chunk of {size} bytes beyond its end; it is cut off.")
        found.setdefault(kind, data[place + 8 : place + 8 + size])
        place += 8 + size
    if JSON_CHUNK not in found:
        raise BadFile(f"{name} has no JSON chunk; it is damaged.")
    return found[JSON_CHUNK], found.get(BINARY_CHUNK, np.zeros(0, np.uint8))


def parse_asset(data: np.ndarray, name: str) -> Mapping[str, Any]:
    """The JSON's object.  Raises BadFile, also for what would take too much memory or depth."""
    try:
        text = str(data.data, "utf-8-sig")
        if sum(map(text.count, "{[,:")) > MOST_MARKS:
            raise BadFile(f"{name} has more than {MOST_MARKS:,} entries in its JSON: no scene.")
    except UnicodeDecodeError:
        raise BadFile(f"{name} is not JSON, and no text at all; export it again.") from None
    return Fields(parse_json(text, name), name, "it is no glTF asset").data
