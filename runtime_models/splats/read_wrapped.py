"""One known file that is packed once more: gzip (.ply.gz), or a zip that holds no other.

It is unpacked into a temporary folder, which goes with the reading; its bytes and all that is made
of them count for the outer file.
"""

import gzip
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path, PurePosixPath

from shapeshift.runtime_models.files.memory import Account
from shapeshift.runtime_models.files.whole_file import temporary_folder
from shapeshift.runtime_models.files.zip_files import DAMAGED, KNOWN, member_names, opened_zip
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.package.package_files import MANIFEST
from shapeshift.runtime_models.splats.plain_splats import RawSplats, Reading
from shapeshift.runtime_models.splats.whole_formats import Format, head_of, whole_formats

GZIP = b"\x1f\x8b"
PIECE = 1 << 20  # bytes that are unpacked at a time
NOT_MEANT = ("__MACOSX",)  # folders that systems add
DEFAULT_NAME = "scene"  # of what lies in a .gz that has no other ending


def is_gzip(head: bytes, path: Path) -> bool:
    return head[:2] == GZIP


def is_zip_of_one(head: bytes, path: Path) -> bool:
    """A package, which is a zip with a scene.json, is none, whatever else lies in it."""
    if head[:2] != b"PK" or not path.is_file() or MANIFEST in member_names(path):
        return False
    return len(known_in(path)) == 1


def known_in(path: Path) -> list[str]:
    """The members of a zip that are of a known format by their names."""
    endings = tuple(e for form in whole_formats() for e in form.endings)
    return [
        name
        for name in member_names(path)
        if name.lower().endswith(endings)
        and not PurePosixPath(name).name.startswith(".")
        and PurePosixPath(name).parts[0] not in NOT_MEANT
    ]


def read_raw_gzip(path: Path, reading: Reading) -> RawSplats:
    """The file in a gzip stream, known by its content or by the name without .gz.  BadFile."""
    reading = reading.within(path)
    name = path.stem if path.suffix.lower() == ".gz" else path.name
    return unpacked_and_read(path, name or DEFAULT_NAME, gzip_pieces(path), reading)


def read_raw_zip_of_one(path: Path, reading: Reading) -> RawSplats:
    """The one known file in a zip.  Raises BadFile."""
    reading = reading.within(path)
    (name,) = known_in(path)
    with opened_zip(path, path.name, reading.account) as archive:
        entry = archive.getinfo(name)
        if entry.compress_type not in KNOWN:
            raise BadFile(f"{path.name}: {name[:80]!r} is packed in a way that is not read.")
        last = PurePosixPath(name).name
        return unpacked_and_read(path, last, zip_pieces(archive, entry, path), reading)


def gzip_pieces(path: Path) -> Iterator[bytes]:
    try:
        with gzip.open(path) as stream:
            while piece := stream.read(PIECE):
                yield piece
    except (OSError, EOFError, zlib.error):
        raise BadFile(f"{path.name}: its gzip stream is cut off or broken; copy it.") from None


def zip_pieces(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, path: Path) -> Iterator[bytes]:
    try:
        with archive.open(entry) as stream:
            while piece := stream.read(PIECE):
                yield piece
    except DAMAGED:
        name = entry.filename[:80]
        raise BadFile(f"{path.name}: {name!r} cannot be unpacked; copy it again.") from None


def unpacked_and_read(
    path: Path, name: str, pieces: Iterator[bytes], reading: Reading
) -> RawSplats:
    """What a file of these bytes holds; the account of the outer one is in `reading`."""
    with temporary_folder() as folder:
        inner = folder / plain_name(name)
        write_charged(inner, pieces, reading.account)
        form = form_of(inner)
        if form is None:
            raise BadFile(f"{path.name} holds {name[:60]!r}, which is no file of splats.")
        raw = form.read(inner, replace(reading, outer=path))
    return replace(raw, file=f"{path.name}: {inner.name}", format=f"{raw.format}, packed")


def form_of(path: Path) -> Format | None:
    """The format of what was packed; None: it has none, or is packed once more."""
    head = head_of(path)
    form = next((form for form in whole_formats() if form.fits(head, path)), None)
    if form is not None and form.has_mark is None:  # by its name alone
        return None if is_zip_of_one(head, path) or is_gzip(head, path) else form
    return form


def plain_name(name: str) -> str:
    """A name that every disk takes, of the same ending."""
    kept = "".join(c if c.isalnum() or c in "._- " else "_" for c in name)[-100:]
    return kept.lstrip(". ") or DEFAULT_NAME


def write_charged(path: Path, pieces: Iterator[bytes], memory: Account) -> None:
    """Temporary folders may lie in memory: what is put there is charged, piece by piece."""
    with path.open("wb") as file:
        for piece in pieces:
            memory.charge(len(piece), "what it unpacks to")
            file.write(piece)
