"""The files of a SOG: out of its folder or its zip, never more of them than its splats need."""

import os
import stat
import zipfile
from pathlib import Path
from typing import IO

import numpy as np
from PIL import _webp

from shapeshift.runtime_models.files.json_fields import Fields, parse_json
from shapeshift.runtime_models.files.memory import JSON_A_BYTE, Account
from shapeshift.runtime_models.files.zip_files import DAMAGED, KNOWN, opened_zip
from shapeshift.runtime_models.model import BadFile

META = "meta.json"
EXPORT_AGAIN = "export it again"  # what to do about a wrong value
LARGEST_META = 4 << 20  # bytes; real ones have some kilobytes
LONGEST_NAME = 255  # bytes, of a file or a folder on disks
SMALL = 1 << 16  # bytes that any file may have
DECODED = 12  # bytes a pixel that a decoder and its copies take besides the pixels that come out


# A WebP's size and pixels, by the decoder that Pillow brings, without Pillow's picture around it:
# through that three copies are made, and a file of 32,768 splats takes 0.75 ms for each of its
# pictures, not 0.45.  That a picture has the same pixels is tested.


def webp_size(data: bytes) -> tuple[int, int]:
    """Pixels across and down by a WebP's first bytes, (0, 0) where it is none.

    Pillow says the same, but warns of large pictures before it is asked whether one is wanted.
    """
    kind, bits = data[12:16], int.from_bytes(data[21:25], "little")
    if data[:4] != b"RIFF" or data[8:12] != b"WEBP" or len(data) < 30:
        return 0, 0
    if kind == b"VP8L":  # lossless: 14 bits each, less 1
        return (bits & 16383) + 1, (bits >> 14 & 16383) + 1
    if kind == b"VP8X":  # extended: 24 bits each, less 1
        width, height = (int.from_bytes(data[at : at + 3], "little") + 1 for at in (24, 27))
        return width, height
    width, height = (int.from_bytes(data[at : at + 2], "little") & 16383 for at in (26, 28))
    return width, height  # lossy


def webp_pixels(data: bytes) -> np.ndarray | None:
    """(H, W, 4) uint8, read only, of the first picture in it; None where it is damaged."""
    width, height = webp_size(data)
    try:
        found = _webp.WebPAnimDecoder(data).get_next()
    except (OSError, RuntimeError, ValueError, MemoryError):
        return None
    if found is None or len(found[0]) != 4 * width * height:
        return None
    return np.frombuffer(found[0], np.uint8).reshape(height, width, 4)


class SogFiles:
    """A SOG's folder (or its meta.json) or zip; names that would leave it are refused."""

    def __init__(self, path: Path, memory: Account) -> None:
        self.path, self.name = path, path.name  # the name is for messages
        self.memory, self.held = memory, 0  # bytes of pictures that are charged
        self.folder = path if path.is_dir() else path.parent if path.name == META else None
        if path.name == META:
            self.name = f"{path.parent.name}/{META}"

    def meta(self) -> Fields:
        """What meta.json says.  Raises BadFile."""
        data = self.read(META, LARGEST_META)
        self.memory.charge(JSON_A_BYTE * len(data), f"its {META}")
        where = f"{self.name}: its {META}"
        return Fields(parse_json(data, where), where, EXPORT_AGAIN)

    def image(self, name: str, least: int, most: int) -> np.ndarray:
        """(H, W, 4) uint8 of a WebP with `least` to `most` pixels, charged.  Raises BadFile."""
        data = self.read(name, 5 * most + SMALL)  # more than uncoded pixels take
        width, height = webp_size(data)
        if not least <= width * height <= most:
            raise BadFile(
                f"{self.name}: {name[:60]!r} has {width} x {height} pixels, expected {least:,} to "
                f"{most:,}; it is no WebP or not of this scene, export it again."
            )
        pixels = width * height
        self.memory.charge(4 * pixels, f"the picture {name[:60]!r}")
        self.held += 4 * pixels
        with self.memory.lend(DECODED * pixels + len(data), f"decoding {name[:60]!r}"):
            if (decoded := webp_pixels(data)) is not None:
                return decoded
        raise BadFile(f"{self.name}: {name[:60]!r} is no WebP that can be read; copy it again.")

    def read(self, name: str, limit: int) -> bytes:
        """One file.  Raises BadFile: a name outside, no such file, more than `limit` bytes."""
        if self.folder is not None:
            file = file_inside(self.folder, name, self.name)
            with file.open("rb") as stream:
                return self._bounded(stream, name, limit, os.fstat(stream.fileno()).st_size)
        check_name(name, self.name)
        with opened_zip(self.path, self.name, self.memory) as archive:
            entry = find_entry(archive, name)
            if entry is None or entry.compress_type not in KNOWN:
                raise BadFile(f"{self.name} does not hold {name[:60]!r} just once; copy it.")
            try:
                with archive.open(entry) as stream:
                    return self._bounded(stream, name, limit, entry.file_size)
            except BadFile:
                raise
            except DAMAGED:
                raise BadFile(f"{self.name}: {name[:60]!r} cannot be unpacked; copy it.") from None

    def _bounded(self, stream: IO[bytes], name: str, limit: int, stated: int) -> bytes:
        if stated <= limit:
            with self.memory.lend(stated, f"{name[:60]!r}"):
                if len(data := stream.read(stated + 1)) <= stated:
                    return data
        raise BadFile(
            f"{self.name}: {name[:60]!r} has more than the {limit:,} bytes that its splats need."
        )


def check_name(name: str, said_by: str) -> None:
    """Raises BadFile where a name, as a file states it, leads out of its folder."""
    parts = name.split("/")
    outside = any(part in ("", ".", "..") for part in parts)
    outside |= any(len(part.encode("utf-8", "replace")) > LONGEST_NAME for part in parts)
    if outside or not name.isprintable() or len(parts) > 8 or set(name) & set("\\:\0"):
        raise BadFile(f"{said_by} names the file {name[:60]!r}, which is none of its own.")


def file_inside(folder: Path, name: str, said_by: str) -> Path:
    """The file of that name in the folder or below.  Raises BadFile: outside, or none there."""
    check_name(name, said_by)
    file = folder / name
    if is_file_without_links(folder, name):  # a tenth of the time that all of it takes
        return file
    if not file.resolve().is_relative_to(folder.resolve()):  # a link that leads outside
        raise BadFile(f"{said_by} names the file {name[:60]!r}, which is none of its own.")
    if not file.is_file():
        raise BadFile(f"{said_by} lacks {name[:60]!r}; copy the whole folder.")
    return file


def is_file_without_links(folder: Path, name: str) -> bool:
    """Whether there is a file of that name, and no link on the way to it from the folder."""
    place, mode = str(folder), 0
    try:
        for part in name.split("/"):
            place = os.path.join(place, part)
            found = os.lstat(place)
            mode = found.st_mode
            # A junction of Windows is a directory with a tag.
            if stat.S_ISLNK(mode) or getattr(found, "st_reparse_tag", False):
                return False
    except OSError:
        return False
    return stat.S_ISREG(mode)


def find_entry(archive: zipfile.ZipFile, name: str) -> zipfile.ZipInfo | None:
    """The one file of that name beside meta.json: at the top, or in the one folder at the top."""
    entries = archive.infolist()
    tops = {e.filename.removesuffix(META) for e in entries if is_meta(e.filename)}
    top = "" if "" in tops or len(tops) != 1 else tops.pop()
    found = [e for e in entries if e.filename == top + name]
    return found[0] if len(found) == 1 else None


def is_meta(name: str) -> bool:
    """Whether that is meta.json at the top of a zip or in a folder at its top."""
    return name == META or (name.endswith("/" + META) and name.count("/") == 1)
