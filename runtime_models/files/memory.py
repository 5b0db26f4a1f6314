"""What a file may take of memory while it is read: one account a file, charged beforehand.

A file of n bytes may take A_BYTE * n; what goes beyond that, of all files of one opening together,
may be FREE, and everything together a part of this machine's memory.  What lies in a container (a
zip in a zip, a gzip stream, a picture) counts for the file that it lies in, and so does every copy
of it and every conversion.  --memory, or the variable, says another amount, which then is the only
bound: docs/formats.md, "Memory".
"""

import math
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from shapeshift.runtime_models.model import BadFile

A_BYTE = 64  # of memory for each byte of a file; those of real scenes become 1 to 30
FREE = 64 << 20  # bytes
PART = 0.75  # of this machine's memory
UNKNOWN = 8 << 30  # bytes of a machine that does not tell
VARIABLE = "SHAPESHIFT_MEMORY"  # GB, where there is no --memory
GB = 1e9
BELIEVED = 4  # times this machine's memory: a file that asks for more is wrong, not large
MOST_GB = 1_000_000  # that a message names
JSON_A_BYTE = 32  # of memory for each byte of JSON: "{}," becomes a dictionary of 64 and its place
DIRECTORY_A_BYTE = 24  # of a zip's directory: 46 bytes and a name become an object of 1 kB
MOST_FILES = 10_000  # of a folder that are counted
CONTROL_GROUP = Path("/sys/fs/cgroup/memory.max")  # of Linux: what a container may take


class Memory:
    """What all files of one opening may take together."""

    def __init__(self, gigabytes: float = 0.0) -> None:
        asked = gigabytes or from_variable()
        self.asked = asked > 0  # then it is the only bound
        self.most = int(asked * GB) if self.asked else int(PART * machine_memory())
        self.taken = 0  # bytes
        self.beyond = 0  # bytes over what the sizes of the files explain
        self.lock = threading.Lock()

    def of(self, path: Path, size: int | None = None) -> "Account":
        """The account of a file, or of a folder that stands for one; `size` where it is known."""
        return Account(self, path.name or str(path), size_of(path) if size is None else size)


class Account:
    """What one file takes; charge() comes before the memory is asked for."""

    def __init__(self, whole: Memory, file: str, size: int, a_byte: float = A_BYTE) -> None:
        self.whole, self.file, self.size, self.a_byte = whole, file, size, a_byte
        self.taken = 0

    def __reduce__(self) -> tuple:
        """What travels to another process was read already, and takes nothing of a file there."""
        return unlimited, ()

    def of(self, path: Path, size: int | None = None) -> "Account":
        """Itself: what lies within a file counts for it, under whatever name it is read."""
        return self

    @property
    def explained(self) -> int:
        """Bytes that the sizes of its files explain."""
        return int(self.a_byte * self.size)

    @property
    def left(self) -> int:
        """Bytes that may still be taken."""
        free = self.whole.most - self.whole.taken
        if self.whole.asked:
            return free
        explained = max(self.explained - self.taken, 0)
        return min(free, explained + FREE - self.whole.beyond)

    def widen(self, size: int) -> None:
        """Another file of so many bytes belongs to this one."""
        self.size += size

    def charge(self, count: int, what: str) -> None:
        """Takes `count` bytes for good.  Raises BadFile; `what` is for its message."""
        whole = self.whole
        with whole.lock:
            explained = self.explained
            beyond = max(self.taken + count - explained, 0) - max(self.taken - explained, 0)
            if not (whole.asked or whole.beyond + beyond <= FREE):
                of_its_own = f"its {self.size:,} bytes may take {amount(explained + FREE)}"
                raise self._refusal(self.taken + count, what, of_its_own)
            if not whole.taken + count <= whole.most:
                of_all = f"files may take {amount(whole.most)}"
                raise self._refusal(whole.taken + count, what, of_all)
            self.taken += count
            whole.taken += count
            whole.beyond += beyond

    def release(self, count: int) -> None:
        """Gives back what was charged."""
        with self.whole.lock:
            explained = self.explained
            self.whole.beyond -= max(self.taken - explained, 0)
            self.taken -= count
            self.whole.taken -= count
            self.whole.beyond += max(self.taken - explained, 0)

    @contextmanager
    def lend(self, count: int, what: str) -> Iterator[None]:
        """Takes `count` bytes for as long as the context lasts.  Raises BadFile."""
        self.charge(count, what)
        try:
            yield
        finally:
            self.release(count)

    def _refusal(self, needed: float, what: str, may: str) -> BadFile:
        if needed <= BELIEVED * machine_memory():
            allow = math.ceil(needed / GB * 1.1)
            advice = (
                f"if it is meant to be so, --memory {allow} or {VARIABLE}={allow} (GB) allows it"
            )
        else:
            advice = "a number in it is wrong, or it is for a larger machine"
        return BadFile(
            f"{self.file}: with {what} it would take {amount(needed)} of memory, {may}; {advice}."
        )


def read_json_file(path: Path) -> bytes:
    """The bytes of a JSON file, charged with what its objects take.  Raises BadFile, also where
    there are none."""
    refuse_empty(path)
    return read_text_file(path, "its JSON")


def refuse_empty(path: Path) -> None:
    if not path.stat().st_size:
        raise BadFile(f"{path} is empty: it has 0 bytes; copy or export it again.")


def read_text_file(path: Path, what: str = "its lines") -> bytes:
    """The bytes of a text file, charged with what its objects take.  Raises BadFile."""
    Memory().of(path).charge(JSON_A_BYTE * path.stat().st_size, what)
    return path.read_bytes()


def amount(count: float) -> str:
    """Bytes for a message."""
    if count >= MOST_GB * GB:
        return f"over {MOST_GB:,} GB"
    return f"{count / GB:,.1f} GB" if count >= GB else f"{math.ceil(count / 1e6):,} MB"


def unlimited() -> Account:
    """An account for what this program has made itself."""
    account = Account(Memory(1.0), "", 0)
    account.whole.most = sys.maxsize
    return account


def size_of(path: Path) -> int:
    """Bytes of a file, or of the files in a folder and in the folders in it."""
    if not path.is_dir():
        return path.stat().st_size
    total, left = 0, MOST_FILES
    for folder in (path, *(inner for inner in path.iterdir() if inner.is_dir())):
        for file in folder.iterdir():
            if left and file.is_file() and not file.is_symlink():
                total, left = total + file.stat().st_size, left - 1
    return total


def from_variable() -> float:
    """GB that the variable names, 0 where it is not there.  Raises BadFile for no number."""
    text = os.environ.get(VARIABLE, "")
    try:
        asked = float(text or 0)
    except ValueError:
        asked = -1.0
    if not 0 <= asked < math.inf:
        raise BadFile(f"{VARIABLE} is {text[:40]!r}; a number of GB is wanted.")
    return asked


def machine_memory() -> int:
    """Bytes that this machine has, or that the container may take; UNKNOWN where none tells."""
    if sys.platform == "win32":
        return windows_memory()
    try:
        whole = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (ValueError, OSError):
        return UNKNOWN
    try:
        whole = min(whole, int(CONTROL_GROUP.read_text()))
    except (OSError, ValueError):  # none, or the word "max"
        pass
    return whole if whole > 0 else UNKNOWN


def windows_memory() -> int:
    """The same of Windows."""
    import ctypes

    class Status(ctypes.Structure):
        _fields_ = [("length", ctypes.c_ulong), ("load", ctypes.c_ulong),
                    *((name, ctypes.c_ulonglong) for name in "abcdefg")]  # fmt: skip

    status = Status(length=ctypes.sizeof(Status))
    windows = getattr(ctypes, "windll")  # noqa: B009  only there
    known = windows.kernel32.GlobalMemoryStatusEx(ctypes.byref(status))
    return status.a if known and status.a else UNKNOWN
