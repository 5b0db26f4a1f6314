"""One command at a time writes an --out: two of one name would mix their files in silence."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import blake2b
from pathlib import Path

from shapeshift.app.cluster.task import is_task
from shapeshift.app.errors import UsageError
from shapeshift.app.first_start import try_lock
from shapeshift.app.paths import full
from shapeshift.runtime_models.files.user_cache import cache_folder

LONGEST = 200  # bytes of what a lock says of its owner


@contextmanager
def claimed(out: Path, command: str) -> Iterator[None]:
    """Nobody else of this user's claims the same path while this lasts.

    The system takes a lock back when its process ends, however it ends: none is ever stale.
    What a task of a command writes is that command's.  Raises UsageError.
    """
    handle = None if is_task() else lock_of(out)
    if handle is None:
        yield
        return
    descriptor, path = handle
    try:
        os.ftruncate(descriptor, 0)
        os.write(descriptor, f"{command}, process {os.getpid()}".encode()[:LONGEST])
        yield
    finally:
        with suppress(OSError):  # Windows keeps a file that is open
            path.unlink()
        os.close(descriptor)


def lock_of(out: Path) -> tuple[int, Path] | None:
    """(a locked file, its path); None where no lock can be kept.  Raises UsageError."""
    name = blake2b(os.fsencode(os.path.realpath(out)), digest_size=16).hexdigest()
    while True:
        try:
            path = cache_folder("running") / f"{name}.lock"
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        except OSError:
            return None
        taken = try_lock(descriptor)
        if taken and is_at(descriptor, path):
            return descriptor, path
        owner = os.pread(descriptor, LONGEST, 0) if hasattr(os, "pread") else b""
        os.close(descriptor)
        if taken is None:
            return None
        if taken is False:
            who = owner.decode("utf-8", "replace") or "another start"
            raise UsageError(
                f"{full(out)} is being written by another start of the program ({who}); wait until "
                "it has ended, or give another --out."
            )


def is_at(descriptor: int, path: Path) -> bool:
    """Whether a file still has its name: its owner before may have taken that away meanwhile."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except FileNotFoundError:
        return False
