"""A file that only grows: entries with version, length and checksum, locked while it is open.

An entry is one line, `VERSION LENGTH CRC32 JSON`.  What a killed writer has not finished is a torn
tail, which is left out; a bad entry with good ones after it is damage.
"""

import json
import os
import re
import secrets
import threading
import zlib
from itertools import count
from pathlib import Path
from typing import Any

from shapeshift.runtime_models.files.json_fields import parse_json
from shapeshift.runtime_models.files.whole_file import make_folders
from shapeshift.runtime_models.model import BadFile

VERSION = 1
ENDING = ".journal"
ASIDE = "aside"  # folder of those that cannot be read
LONGEST_HEAD = 1 << 20  # bytes
MOST_BYTES = 256 << 20  # that are read of one
HEAD = re.compile(rb"(\d{1,6}) (\d{1,9}) ([0-9a-f]{8}) ")
TORN_HEAD = re.compile(
    rb"(\d{1,6}( (\d{1,9}( ([0-9a-f]{8}( .*)?|[0-9a-f]{0,7}))?)?)?|\0+)", re.DOTALL
)
NEXT = re.compile(rb"\n(?=\d)")
FAR = 1 << 40  # byte that stands for the whole file where bytes are locked


def entry_line(entry: dict[str, Any]) -> bytes:
    """One entry as it stands in the file.  ValueError for numbers that JSON has not."""
    text = json.dumps(entry, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()
    return b"%d %d %08x " % (VERSION, len(text), zlib.crc32(text)) + text + b"\n"


def entry_at(data: bytes, at: int) -> tuple[int, bytes | None]:
    """Where the entry at that byte ends, and its text; None where none is whole there.

    Raises BadFile for one of another version.
    """
    head = HEAD.match(data, at)
    if head is None:
        return at, None
    start, size = head.end(), int(head[2])
    text, end = data[start : start + size], start + size + 1
    if len(text) != size or data[end - 1 : end] != b"\n" or zlib.crc32(text) != int(head[3], 16):
        return at, None
    if int(head[1]) != VERSION:
        raise BadFile(f"it is of version {int(head[1])}, this program reads {VERSION}")
    return end, text


def read_entries(data: bytes) -> tuple[list[dict[str, Any]], int]:
    """All whole entries, and how many bytes at the end are torn.

    Raises BadFile, a sentence without its end, for another version and for what is damaged.
    """
    found, at = [], 0
    while at < len(data):
        end, text = entry_at(data, at)
        if text is None:
            if at == 0 and not TORN_HEAD.fullmatch(data):
                raise BadFile("it is no journal")
            if any(entry_at(data, line.end())[1] for line in NEXT.finditer(data, at)):
                raise BadFile(f"it is damaged at byte {at:,}")
            break
        entry = parse_json(text, "an entry")
        if not isinstance(entry, dict):
            raise BadFile(f"its entry at byte {at:,} is none")
        found.append(entry)
        at = end
    return found, len(data) - at


def claim(handle: int) -> bool:
    """Whether the file is ours alone as long as it is open; True, too, where nothing is locked."""
    try:
        if os.name == "nt":
            import msvcrt

            os.lseek(handle, FAR, os.SEEK_SET)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    except OSError:
        return os.name != "nt"
    return True


class JournalFile:
    """An open one; nobody else has it meanwhile."""

    def __init__(self, path: Path, handle: int) -> None:
        self.path, self._handle = path, handle
        self._size = os.fstat(handle).st_size
        self._due = threading.Event()
        self._open = threading.Lock()  # held while the disk is waited for
        self._flusher: threading.Thread | None = None

    @staticmethod
    def begin(folder: Path, stem: str) -> "JournalFile":
        """A new one under the first name that is free: STEM, STEM-2, ...  Raises OSError."""
        make_folders(folder.parent, folder.name, 0o700)
        flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_APPEND | getattr(os, "O_BINARY", 0)
        for number in count(1):
            path = folder / f"{stem}{f'-{number}' if number > 1 else ''}{ENDING}"
            try:
                handle = os.open(path, flags | getattr(os, "O_NOFOLLOW", 0), 0o600)
            except FileExistsError:
                continue
            claim(handle)
            if os.fstat(handle).st_nlink:  # else another window took it for an empty one of nobody
                return JournalFile(path, handle)
            os.close(handle)
        raise AssertionError("numbers do not end")

    @staticmethod
    def take_up(path: Path) -> "JournalFile | None":
        """One of a window that is gone; None while its window lives, or where it is no file."""
        flags = os.O_RDWR | os.O_APPEND | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)
        try:
            handle = os.open(path, flags | getattr(os, "O_NOFOLLOW", 0))
        except OSError:
            return None
        if path.is_file() and claim(handle) and os.fstat(handle).st_nlink:
            return JournalFile(path, handle)
        os.close(handle)
        return None

    @property
    def size(self) -> int:
        """Bytes."""
        return self._size

    @property
    def modified_s(self) -> float:
        """When it was written last, seconds since 1970."""
        return os.fstat(self._handle).st_mtime

    def read(self) -> tuple[list[dict[str, Any]], int]:
        """As read_entries.  Raises BadFile and OSError."""
        if self._size > MOST_BYTES:
            raise BadFile(f"it has {self._size:,} bytes; at most {MOST_BYTES:,} are read")
        os.lseek(self._handle, 0, os.SEEK_SET)
        with open(self._handle, "rb", closefd=False) as file:
            return read_entries(file.read(MOST_BYTES + 1))

    def head(self) -> dict[str, Any]:
        """Its first entry; {} where that cannot be read."""
        os.lseek(self._handle, 0, os.SEEK_SET)
        try:
            line = os.read(self._handle, LONGEST_HEAD).split(b"\n", 1)[0]
            return next(iter(read_entries(line + b"\n")[0]), {})
        except (BadFile, OSError):
            return {}

    def append(self, lines: bytes) -> None:
        """Whole entries; what cannot be written whole leaves the file as it was.  Raises OSError,
        also where somebody has taken the file away.
        """
        if not os.fstat(self._handle).st_nlink:
            raise FileNotFoundError(2, os.strerror(2), str(self.path))
        rest = memoryview(lines)
        try:
            while rest:
                rest = rest[os.write(self._handle, rest) :]
        except OSError:
            os.ftruncate(self._handle, self._size)
            raise
        self._size += len(lines)
        if self._flusher is None:
            self._flusher = threading.Thread(target=self._flush, name="journal", daemon=True)
            self._flusher.start()
        self._due.set()

    def _flush(self) -> None:
        """Brings what was written to the disk, beside the window."""
        while True:
            self._due.wait()
            self._due.clear()
            with self._open:
                if self._handle < 0:
                    return
                try:
                    os.fsync(self._handle)
                except OSError:
                    pass  # the next entry says so

    def close(self) -> None:
        """It stays where it is, for the next start."""
        with self._open:
            if self._handle >= 0:
                os.close(self._handle)
            self._handle = -1
        self._due.set()

    def remove(self) -> None:
        """All in it is saved, or refused."""
        try:
            ours = os.path.samestat(os.fstat(self._handle), self.path.stat())
            if os.name == "nt":
                self.close()
            if ours:  # else somebody took it away, and a newer one has its name
                self.path.unlink()
        except OSError:
            pass  # gone already, or read-only: then it is offered once more
        self.close()

    def set_aside(self) -> Path:
        """Out of the way, to be looked at by people; where it is then."""
        folder = self.path.parent / ASIDE
        place = folder / f"{self.path.stem}-{secrets.token_hex(3)}{ENDING}"
        if os.name == "nt":
            self.close()
        try:
            folder.mkdir(exist_ok=True)
            os.replace(self.path, place)
        except OSError:
            place = self.path
        self.close()
        return place


def journals_of(folder: Path, stem: str = "") -> list[Path]:
    """Those that lie there, of one stem or of all, oldest name first."""
    pattern = re.compile((re.escape(stem) if stem else r".*") + r"(-\d+)?" + re.escape(ENDING))
    try:
        return sorted(path for path in folder.iterdir() if pattern.fullmatch(path.name))
    except OSError:
        return []
