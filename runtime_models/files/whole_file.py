"""Writing so that a reader sees the old file or the new one, never a part; never through a link.

What is written lies in the same folder under a name of ours until it is whole, and is locked as
long as its writer lives: what a killed writer left is removed by the next one in that folder.
"""

import ctypes
import errno
import os
import re
import secrets
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, BinaryIO

PART = re.compile(r"\.shapeshift-[0-9a-f]{16}\.part")  # names of what is not whole yet
DEVICES = ("/dev/std", "/dev/fd/", "/proc/")  # what they lead to is never replaced
DEAD_S = 86400.0  # where folders cannot be locked: so old is a part that nobody writes any more
MODE = 0o777  # bits that an earlier file hands on
LOCKS = os.name != "nt"  # Windows refuses to delete a file that is open instead

_swept: set[Path] = set()  # folders that this process has looked through


def write_whole(path: Path, data: bytes | Iterable[bytes | memoryview]) -> None:
    """The bytes, which may come in parts, in place of `path`."""
    with whole_file(path) as file:
        file.writelines([data] if isinstance(data, bytes | bytearray | memoryview) else data)


@contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """A new file that takes the place of `path` when the block ends well, and vanishes otherwise.

    It has the rights of the file before, or those of the umask.  A link is replaced, not followed;
    into a device or a pipe goes what is written, at once.  An OSError names `path`.
    """
    path = Path(path)
    with naming(path):
        if is_stream(path):
            with open(path, "wb") as file:
                yield file
            return
        sweep(path.parent)
        part, handle = new_part(path.parent)
        try:
            with open(handle, "wb") as file:
                yield file
                file.flush()
                take_over_rights(path, handle)
                if LOCKS:  # still locked: nobody else takes it for litter
                    os.replace(part, path)
            if not LOCKS:
                os.replace(part, path)
        except BaseException:
            part.unlink(missing_ok=True)
            raise


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """A new folder that takes the place of `path`, with all that is in it, as whole_file does.

    Where the system cannot swap two folders there is a moment without either; who is killed just
    then finds the old one as NAME.before-....
    """
    path = Path(path)
    with naming(path):
        sweep(path.parent)
        part, handle = new_part_folder(path.parent)
        try:
            yield part
            if path.is_dir() and not path.is_symlink():
                part.chmod(stat.S_IMODE(path.stat().st_mode) & MODE)
            if not os.path.lexists(path):
                os.replace(part, path)
            elif not swap(part, path):
                aside = path.with_name(f"{path.name}.before-{secrets.token_hex(4)}")
                os.replace(path, aside)
                try:
                    os.replace(part, path)
                except BaseException:
                    os.replace(aside, path)
                    raise
                part = aside
        finally:
            remove(part)
            if handle is not None:
                os.close(handle)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A folder among the temporary files for this user alone; what a killed program left of such
    goes with the next one.
    """
    root = Path(tempfile.gettempdir())
    sweep(root)
    folder, handle = new_part_folder(root, 0o700)
    try:
        yield folder
    finally:
        remove(folder)
        if handle is not None:
            os.close(handle)


def discard_folder(path: Path) -> None:
    """Removes a folder in one moment; what a kill leaves of it has a name that `sweep` knows."""
    sweep(path.parent)
    part = part_name(path.parent)
    os.replace(path, part)
    remove(part)


def open_lines(path: Path) -> IO[str]:
    """A text file that grows line by line, from nothing; a link is replaced, not followed."""
    path = Path(path)
    with naming(path):
        if not is_stream(path):
            if path.is_symlink():
                path.unlink()
            flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | getattr(os, "O_NOFOLLOW", 0)
            return open(os.open(path, flags, 0o666), "w", encoding="utf-8", newline="\n")
        return open(path, "w", encoding="utf-8", newline="\n")


def open_locked(path: Path) -> IO[str] | None:
    """A short text file to read and write in place, ours alone while it is open and not removed.

    None while somebody else has it; on Windows, and where the file system knows no locks,
    everybody gets it.  A link is not followed.
    """
    flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)
    with naming(path):
        file = open(os.open(path, flags, 0o666), "r+", encoding="utf-8", newline="\n")
    if not LOCKS:
        return file
    import fcntl

    try:
        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        free = os.fstat(file.fileno()).st_nlink > 0  # else its last owner took it away meanwhile
    except BlockingIOError:
        free = False
    except OSError:
        free = True  # it knows no locks
    if free:
        return file
    file.close()
    return None


def make_folders(root: Path, below: Path | str, rights: int = 0o777) -> Path:
    """`root`, which may be a link of the user's, and in it the folders of ours, which may not.

    Raises OSError that names the one that is.
    """
    root.mkdir(parents=True, exist_ok=True)
    folder = root
    for name in Path(below).parts:
        folder = folder / name
        if folder.is_symlink():
            raise OSError(
                errno.ELOOP, "it is a link, through which nothing is written", str(folder)
            )
        folder.mkdir(rights, exist_ok=True)
    return folder


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Lets an OSError of a full disk, or one that names our part, name `path` instead."""
    try:
        yield
    except OSError as error:
        if error.errno is None:  # numpy's, which has a text alone
            raise OSError(errno.EIO, str(error), str(path)) from error
        named = error.filename if isinstance(error.filename, str) else ""
        if not named or any(map(PART.fullmatch, Path(named).parts)):
            error.filename, error.filename2 = str(path), None
        raise


def is_stream(path: Path) -> bool:
    """Whether `path` is a device or a pipe: they take what is written and are not replaced."""
    try:
        mode = path.stat().st_mode
    except OSError:
        return False
    return stat.S_ISCHR(mode) or stat.S_ISFIFO(mode) or str(path.absolute()).startswith(DEVICES)


def part_name(folder: Path) -> Path:
    return folder / f".shapeshift-{secrets.token_hex(8)}.part"


def new_part(folder: Path) -> tuple[Path, int]:
    """(path, handle) of a new file, locked."""
    flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0)
    while True:
        part = part_name(folder)
        handle = os.open(part, flags | getattr(os, "O_BINARY", 0), 0o666)
        lock(handle, wait=True)
        if not LOCKS or os.fstat(handle).st_nlink:  # else swept away before it was locked
            return part, handle
        os.close(handle)


def new_part_folder(folder: Path, rights: int = 0o777) -> tuple[Path, int | None]:
    """(path, handle) of a new folder, locked; no handle where folders cannot be."""
    while True:
        part = part_name(folder)
        part.mkdir(rights)
        if not LOCKS:
            return part, None
        handle = os.open(part, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        lock(handle, wait=True)
        if os.fstat(handle).st_nlink:
            return part, handle
        os.close(handle)


def lock(handle: int, wait: bool = False) -> bool:
    """Whether the file is ours alone now; False also where the file system knows no locks."""
    if not LOCKS:
        return False
    import fcntl

    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except OSError:
        return False
    return True


def take_over_rights(path: Path, handle: int) -> None:
    """The rights of the file before, and its owner where that is allowed."""
    try:
        before = path.lstat()
    except OSError:
        return
    if not (LOCKS and stat.S_ISREG(before.st_mode)):
        return
    now = os.fstat(handle)
    if (before.st_uid, before.st_gid) != (now.st_uid, now.st_gid):
        try:
            os.fchown(handle, before.st_uid, before.st_gid)
        except OSError:
            pass  # only root may give files away
    os.fchmod(handle, stat.S_IMODE(before.st_mode) & MODE)


def sweep(folder: Path) -> None:
    """Removes what killed writers left in the folder, the first time something is written there."""
    folder = folder.absolute()
    if folder in _swept:
        return
    _swept.add(folder)
    try:
        with os.scandir(folder) as entries:
            parts = [Path(entry.path) for entry in entries if PART.fullmatch(entry.name)]
    except OSError:
        return  # what is wrong with the folder is said when it is written to
    for part in parts:
        remove_dead(part)


def remove_dead(part: Path) -> None:
    """Removes a part whose writer is gone; nobody can take it up meanwhile."""
    try:
        if not LOCKS:
            if not part.is_dir() or time.time() - part.lstat().st_mtime > DEAD_S:
                remove(part)
            return
        handle = os.open(part, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return
    try:
        if lock(handle):
            remove(part)
    finally:
        os.close(handle)


def remove(part: Path) -> None:
    """A file, a link or a folder; what cannot be removed stays."""
    try:
        if part.is_dir() and not part.is_symlink():
            shutil.rmtree(part, ignore_errors=True)
        else:
            part.unlink()
    except OSError:
        pass


# Two folders change places in one moment, where the system can do that.

AT_FDCWD = -100  # linux/fcntl.h: paths are relative to the current folder
RENAME_EXCHANGE = 2  # linux/fs.h
RENAME_SWAP = 2  # sys/stdio.h of macOS


def swap(one: Path, other: Path) -> bool:
    """Whether they have changed places; where not, neither has moved."""
    try:
        system = ctypes.CDLL(None, use_errno=True)
        if sys.platform.startswith("linux"):
            paths = (AT_FDCWD, os.fsencode(one), AT_FDCWD, os.fsencode(other))
            return system.renameat2(*paths, RENAME_EXCHANGE) == 0
        if sys.platform == "darwin":
            return system.renamex_np(os.fsencode(one), os.fsencode(other), RENAME_SWAP) == 0
    except (AttributeError, OSError, TypeError):  # an older C library, another system, Windows
        pass
    return False
