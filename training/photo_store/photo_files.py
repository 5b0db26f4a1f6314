"""Photos at the size of the training on disk, written one by one, found again by a later run.

photos.bin has the pixels of every photo at a place that follows from the capture, index.bin a
record a photo: what it was made of, and a checksum of its pixels.  A record is written after its
pixels, so what a killed run left is whole or not there; what is broken, or was made of other files,
is made anew.  Files are read and written, not mapped: mapped pages count as memory of this process,
and a full disk would end it by a signal where here it is an error.
"""

import hashlib
import os
import shutil
import struct
import threading
import weakref
import zlib
from io import FileIO
from pathlib import Path

import numpy as np
import PIL

from shapeshift.runtime_models.files.memory import amount
from shapeshift.runtime_models.files.user_cache import cache_folder
from shapeshift.runtime_models.files.whole_file import LOCKS, lock, new_part_folder, remove, sweep
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Photo
from shapeshift.training.photos import LoadedPhoto, PhotoReader

PIXELS, INDEX = "photos.bin", "index.bin"
MAGIC = b"shapeshift photos 1\n".ljust(32, b"\0")
# What it was made of, checksum of the pixels, flags, how many pixels have no value.
RECORD = struct.Struct("<16sIBI7x")
THERE, WEIGHTED, DEEP, MASKED, MAPPED = 1, 2, 4, 8, 16  # flags


class PhotoFiles:
    """The two files, locked as long as they are open.  Reading and writing take turns."""

    def __init__(self, photos: tuple[Photo, ...], reader: PhotoReader, place: Path | None) -> None:
        """place: the folder, which stays for a later run; None, or where another run has it: one
        of our own, which goes with this run.  Raises BadFile, also where the disk has no room.
        """
        self.photos, self.reader = photos, reader
        sizes = [reader.bytes_of(photo) for photo in photos]
        self.starts = np.concatenate([[0], np.cumsum(sizes, dtype=np.int64)]).tolist()
        self.lock = threading.Lock()
        # (checksum, flags, pixels without a value) of this run's photos
        self.known: dict[int, tuple[int, int, int]] = {}
        self.folder, self.own, self.index, handle = open_folder(place)
        self.pixels = open_ours(self.folder / PIXELS)
        self._end = weakref.finalize(
            self, end, self.folder, self.own, self.index, self.pixels, handle
        )
        try:
            self.refuse_full_disk()
            self.pixels.truncate(self.starts[-1])
        except BaseException:
            self.close(keep=False)
            raise

    @property
    def size(self) -> int:
        """What the pixels of all photos take."""
        return int(self.starts[-1])

    def refuse_full_disk(self) -> None:
        """Raises BadFile where the photos do not fit beside what else is there."""
        have = getattr(os.fstat(self.pixels.fileno()), "st_blocks", 0) * 512
        free = shutil.disk_usage(self.folder).free
        if (needed := self.size - have) > free:
            raise BadFile(
                f"{self.folder.parent}: the photos do not fit into memory, and on disk they need "
                f"{amount(needed)} where {amount(free)} are free; make room, or give a larger "
                "--downscale."
            )

    def read(self, number: int) -> LoadedPhoto | None:
        """A photo that lies there whole and was made of the files of now; else None."""
        view, size = self.photos[number].view, self.reader.bytes_of(self.photos[number])
        with self.lock:
            if number not in self.known:
                self.index.seek(len(MAGIC) + number * RECORD.size)
                record = self.index.read(RECORD.size) or b""
                if len(record) < RECORD.size:
                    return None
                stamp, *found = RECORD.unpack(record)
                if not found[1] & THERE or stamp != self.stamp(number):
                    return None
                self.known[number] = found[0], found[1], found[2]
            checksum, flags, unknown = self.known[number]
            self.pixels.seek(self.starts[number])
            data = self.pixels.read(size) or b""
        if len(data) != size or zlib.crc32(data) != checksum:
            with self.lock:
                self.known.pop(number, None)
            return None
        width, height = view.divided(self.reader.factor).size
        ends = [4 * width * height * part for part in (1, 2, 3)]
        parts = np.split(np.frombuffer(data, np.uint8), ends)
        rgba = parts[0].reshape(height, width, 4)
        floats = [part.view(np.float32).reshape(height, width) for part in parts[1:] if len(part)]
        weight = floats.pop(0) if flags & WEIGHTED else None
        depth = floats.pop(0) if flags & DEEP else None
        normals = None
        if flags & MAPPED:
            normals = floats.pop(0).view(np.int8).reshape(height, width, 4)
        photo, masked = self.photos[number], bool(flags & MASKED)
        return LoadedPhoto(
            view.divided(self.reader.factor), photo.modality, rgba, weight, photo.name, depth,
            masked, normals, unknown,
        )  # fmt: skip

    def write(self, number: int, photo: LoadedPhoto, stamp: bytes) -> None:
        """Keeps a photo; stamp: taken before its files were read.  Raises OSError."""
        parts = (photo.rgba, photo.weight, photo.depth, photo.normals)
        arrays = [part for part in parts if part is not None]
        size = self.reader.bytes_of(self.photos[number])
        data = b"".join(np.ascontiguousarray(array).tobytes() for array in arrays).ljust(
            size, b"\0"
        )
        flags = THERE | WEIGHTED * (photo.weight is not None) | DEEP * (photo.depth is not None)
        flags |= MASKED * photo.masked | MAPPED * (photo.normals is not None)
        checksum = zlib.crc32(data)
        with self.lock:
            write_at(self.pixels, self.starts[number], data)
            record = RECORD.pack(stamp, checksum, flags, photo.unknown)
            write_at(self.index, len(MAGIC) + number * RECORD.size, record)
            self.known[number] = checksum, flags, photo.unknown

    def stamp(self, number: int) -> bytes:
        """What a photo is made of: its files by time and size, and all that is done to them."""
        photo, about = self.photos[number], [PIL.__version__, str(self.starts[number])]
        for path in (photo.path, photo.mask, photo.depth, photo.normals):
            if path is not None:
                state = os.stat(path)
                about.append(f"{path.absolute()} {state.st_mtime_ns} {state.st_size}")
        units = photo.depth_unit, photo.float_depth_unit
        of_files = photo.counts, photo.band, photo.no_value, units, photo.lens, photo.normal_axes
        about += [repr(self.reader.way(photo)), repr(of_files)]
        return hashlib.blake2b("\n".join(about).encode(), digest_size=16).digest()

    def close(self, keep: bool) -> None:
        """keep: the folder that was named stays, so that a later run finds the photos."""
        removed = self._end.alive and not (keep or self.own)
        if removed and LOCKS:  # while nobody else can take it up
            remove_named(self.folder)
        self._end()
        if removed:
            remove_named(self.folder)


def open_folder(place: Path | None) -> tuple[Path, bool, FileIO, int | None]:
    """(folder, whether it goes with this run, its index, handle of its lock).  Raises BadFile."""
    try:
        if place is not None and (index := open_named(place)) is not None:
            return place, False, index, None
        parent = cache_folder("photos") if place is None else place.parent
        sweep(parent)
        folder, handle = new_part_folder(parent)
        return folder, True, open_ours(folder / INDEX), handle
    except OSError as error:
        where = place or error.filename
        raise BadFile(f"{where}: photos cannot be kept there ({error.strerror}).") from None


def open_named(place: Path) -> FileIO | None:
    """The index of a folder that a later run may find; None where another run has it now."""
    place.parent.mkdir(parents=True, exist_ok=True)
    if place.is_symlink() or (place.exists() and not (place.is_dir() and is_ours(place))):
        raise BadFile(
            f"{place} is in the way: photos would be kept there, and it is not of this program; "
            "move it, or name another --out."
        )
    place.mkdir(exist_ok=True)
    index = open_ours(place / INDEX)
    if not (alone(index) and os.fstat(index.fileno()).st_nlink):  # or it was just removed
        index.close()
        return None
    if index.read(len(MAGIC)) != MAGIC:
        index.truncate(0)
        write_at(index, 0, MAGIC)
    return index


def is_ours(folder: Path) -> bool:
    """Whether a folder is empty or has nothing but the two files."""
    names = {entry.name for entry in os.scandir(folder)}
    if not names <= {PIXELS, INDEX}:
        return False
    if INDEX not in names:
        return not names
    with open_ours(folder / INDEX) as file:
        return (file.read(len(MAGIC)) or MAGIC) == MAGIC


def open_ours(path: Path) -> FileIO:
    """A file to read and write, made where it is absent; never through a link."""
    flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
    return FileIO(os.open(path, flags, 0o666), "r+b")


def alone(file: FileIO) -> bool:
    """Whether no other run has the file; it is ours until it is closed."""
    if LOCKS:
        return lock(file.fileno())
    import msvcrt

    file.seek(1 << 40)  # a byte that nobody reads
    try:
        getattr(msvcrt, "locking")(file.fileno(), getattr(msvcrt, "LK_NBLCK"), 1)  # noqa: B009
    except OSError:
        return False
    finally:
        file.seek(0)
    return True


def write_at(file: FileIO, start: int, data: bytes) -> None:
    """All of the data.  Raises OSError where the disk is full."""
    file.seek(start)
    left = memoryview(data)
    while left:
        left = left[file.write(left) :]


def end(folder: Path, own: bool, index: FileIO, pixels: FileIO, handle: int | None) -> None:
    """Closes the files; a folder that goes with this run is removed."""
    index.close()
    pixels.close()
    if own:
        remove(folder)
    if handle is not None:
        os.close(handle)


def remove_named(folder: Path) -> None:
    """Removes the two files and the folder if nothing else is in it; what cannot be stays."""
    try:
        for name in (PIXELS, INDEX):
            (folder / name).unlink(missing_ok=True)
        folder.rmdir()
    except OSError:
        pass
