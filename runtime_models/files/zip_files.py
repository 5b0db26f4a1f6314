"""Zips from strangers: their directory and each member charged before it is read."""

import io
import lzma
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from shapeshift.runtime_models.files.memory import DIRECTORY_A_BYTE, Account, Memory
from shapeshift.runtime_models.model import BadFile

# What the standard library raises on a damaged zip, by itself or through its decompressors.
DAMAGED = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, EOFError, OSError,
    NotImplementedError, RuntimeError, ValueError,
)  # fmt: skip
KNOWN = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # unpacking the others stops at no limit
END, END_MARK = struct.Struct("<4s4H2LH"), b"PK\5\6"
END_64, END_64_MARK = struct.Struct("<4sQ2H2L4Q"), b"PK\6\6"
LOCATOR_MARK = b"PK\6\7"  # 20 bytes that say where the record of 64 bits is
TAIL = (1 << 16) + END.size + 20 + END_64.size  # bytes in which a directory ends
BIG = 0xFFFFFFFF  # in the place of a size: it stands in the record of 64 bits


def is_zip(path: Path) -> bool:
    """Whether the file ends as a zip of one disk does: zipfile raises at one of several."""
    try:
        return zipfile.is_zipfile(path)
    except DAMAGED:
        return False


@contextmanager
def opened_zip(source: Path | bytes, where: str, memory: Account) -> Iterator[zipfile.ZipFile]:
    """The archive in a file or in memory; `where` is for messages.  Raises BadFile."""
    with memory.lend(DIRECTORY_A_BYTE * directory_size(source), "the list of its members"):
        try:
            archive = zipfile.ZipFile(source if isinstance(source, Path) else io.BytesIO(source))
        except DAMAGED:
            raise BadFile(f"{where} is no zip, or it is cut off; copy it again.") from None
        with archive:
            yield archive


def directory_size(source: Path | bytes) -> int:
    """Bytes of the list of members, as the end of the file says; 0 where it says nothing.

    zipfile reads so many, whatever the list holds.
    """
    if isinstance(source, bytes):
        tail, size = source[-TAIL:], len(source)
    else:
        size = source.stat().st_size
        with source.open("rb") as file:
            file.seek(max(size - TAIL, 0))
            tail = file.read(TAIL)
    elsewhere = LOCATOR_MARK in tail and END_64_MARK not in tail
    stated = [size if elsewhere else 0]
    for mark, form, place in ((END_MARK, END, 5), (END_64_MARK, END_64, 8)):
        at = tail.find(mark)
        while at >= 0:  # which of them counts is for zipfile to say
            if at + form.size <= len(tail):
                stated.append(form.unpack_from(tail, at)[place])
            at = tail.find(mark, at + 1)
    return max(min(count, size) for count in stated if count != BIG)


def read_member(
    archive: zipfile.ZipFile, entry: zipfile.ZipInfo, where: str, memory: Account
) -> bytes:
    """All bytes of a member; the CRC is checked.  Raises BadFile, never unpacks more than stated.

    They are charged for good: who drops them releases them.
    """
    name = entry.filename[:80]
    if entry.compress_type not in KNOWN:
        raise BadFile(f"{where}: {name!r} is packed in a way that is not read; zip it again.")
    memory.charge(entry.file_size, f"{name!r}")
    try:
        with archive.open(entry) as stream:  # archive.read would unpack 2 GB, then cut
            data = stream.read(entry.file_size + 1)
    except DAMAGED:
        raise BadFile(f"{where}: {name!r} cannot be unpacked; copy or export it again.") from None
    if len(data) != entry.file_size:
        raise BadFile(f"{where}: {name!r} has not the size that is stated; copy it again.")
    return data


def member_names(path: Path) -> list[str]:
    """The names in a zip; [] where it is none that can be read, or asks for too much memory."""
    try:
        with opened_zip(path, path.name, Memory().of(path)) as archive:
            return archive.namelist()
    except BadFile:  # its reader says what is wrong with it
        return []
