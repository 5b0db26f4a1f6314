"""The files of a package, out of a folder or a zip; sizes are checked before anything is read."""

import lzma
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

from runtime_models.model import BadFile

FORMAT = "shapeshift 1"
MANIFEST = "scene.json"
ANCHORS = "anchors.npz"
WHOLE = f"a package is {MANIFEST}, {ANCHORS} and five ONNX files"

LARGEST = {MANIFEST: 16 << 20, ANCHORS: 4 << 30}  # bytes, unpacked
LARGEST_NETWORK = 256 << 20  # bytes; five of 64 MB would draw one frame a minute
ALWAYS_FREE = 32 << 20  # bytes that anything may unpack to
MOST_RATIO = 20  # unpacked over packed beyond that; trained numbers pack 1.2 times

# What the standard library raises on a damaged zip, by itself or through its decompressors.
DAMAGED = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, EOFError, OSError,
    NotImplementedError, RuntimeError, ValueError,
)  # fmt: skip


def open_package(path: Path) -> Callable[[str], bytes]:
    """read(name) -> bytes of one file of the package at `path`.  Both raise BadFile."""
    if path.is_dir():
        return lambda name: read_from_folder(path, name)
    if not zipfile.is_zipfile(path):
        raise BadFile(f"{path} is not a package: it is no zip, or it is cut off; copy it again.")
    return lambda name: read_from_zip(path, name)


def refuse_large(path: Path, name: str, size: int) -> None:
    limit = LARGEST.get(name, LARGEST_NETWORK)
    if size > limit:
        raise BadFile(f"{path}: {name} has {size:,} bytes, at most {limit:,} are read.")


def refuse_bomb(what: str, size: int, packed: int) -> None:
    """BadFile where `packed` bytes are to become more than numbers of a scene ever do."""
    if size > max(ALWAYS_FREE, MOST_RATIO * packed):
        raise BadFile(
            f"{what} would unpack from {packed:,} to {size:,} bytes, over {MOST_RATIO} times as "
            "many; it is not taken for numbers of a scene."
        )


def read_from_folder(path: Path, name: str) -> bytes:
    file = path / name
    if not file.is_file():
        raise BadFile(f"{path} lacks {name}; {WHOLE}.")
    refuse_large(path, name, file.stat().st_size)
    return file.read_bytes()


def read_from_zip(path: Path, name: str) -> bytes:
    """Nothing is unpacked to disk; the stated size bounds what is read, and the CRC is checked."""
    try:
        with zipfile.ZipFile(path) as archive:
            entry = find_entry(archive, path, name)
            refuse_large(path, name, entry.file_size)
            packed = min(entry.compress_size, path.stat().st_size)
            refuse_bomb(f"{path}: {name}", entry.file_size, packed)
            with archive.open(entry) as stream:  # archive.read would unpack 2 GB, then cut
                return stream.read(entry.file_size + 1)
    except BadFile:
        raise
    except DAMAGED:
        raise BadFile(f"{path}: {name} cannot be unpacked; copy or export it again.") from None


def find_entry(archive: zipfile.ZipFile, path: Path, name: str) -> zipfile.ZipInfo:
    """At the top, or in the one folder that holds a manifest: zipping a folder keeps its name."""
    entries = archive.infolist()
    tops = {e.filename[: -len(MANIFEST)] for e in entries if e.filename.endswith(MANIFEST)}
    tops = {top for top in tops if top == "" or (top.count("/") == 1 and top.endswith("/"))}
    top = "" if "" in tops or len(tops) != 1 else tops.pop()
    found = [e for e in entries if e.filename == top + name]
    if not found:
        raise BadFile(f"{path} lacks {name}; {WHOLE}.")
    if len(found) > 1:
        raise BadFile(f"{path} holds {name} {len(found)} times; write it again.")
    return found[0]
