"""Before anything is drawn: where libraries keep what they can make again, also on read-only homes.

Kernels of PoCL, invokers of pyopencl, shaders of Mesa, fonts of matplotlib and our own colliders
and charts go into the user's cache.  Where that cannot be written, a folder of the user's among
the temporary files stands in for it, which is said once.
"""

import atexit
import contextlib
import errno
import faulthandler
import os
import secrets
import shutil
import stat
import sys
import tempfile
import time
from pathlib import Path
from typing import IO

from shapeshift.app.first_start import try_lock
from shapeshift.app.paths import has_left
from shapeshift.app.terminal import say
from shapeshift.runtime_models.files.user_cache import OURS, cache_base, cache_folder
from shapeshift.runtime_models.files.whole_file import discard_folder, write_whole

CACHELESS = ("info", "lint", "cameras", "export")  # commands that draw and keep nothing
ROOM = 1 << 16  # bytes that have to fit: a cache on a full disk is none
FREE = 32 << 20  # and so many have to be free: a compiler that finds no room ends the program
KERNELS, STARTS = "pocl", "starts"  # caches: compiled kernels; a file of each start that goes on
INVOKERS = "pytools/**/pdict-*pyopencl*.sqlite"  # below the folder of all caches
LITTER = "tempfile_*"  # PoCL makes one at each start, and leaves it
LITTER_S = 3600.0  # so old it is nobody's any more


def settle_caches_for(command: str) -> None:
    """The same for a command of the program itself; another program's environment is its own."""
    if has_left() and command not in CACHELESS:
        settle_caches()
        with contextlib.suppress(OSError):  # then kernels are trusted, as ever
            mend_caches()
            note_start()


def settle_caches() -> None:
    """Sets the environment for the libraries that are loaded later.  Raises OSError."""
    try:
        try_cache()
    except OSError as error:
        base, why = cache_base(), error.strerror or str(error)
        os.environ["LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME"] = str(
            stand_in()
        )
        try_cache()
        say(f"The folder for caches, {base}, cannot be used ({why}); {cache_base()} is meanwhile.")
    os.environ.setdefault("POCL_CACHE_DIR", str(cache_folder(KERNELS)))
    os.environ.setdefault("MPLCONFIGDIR", str(cache_folder("matplotlib")))


def try_cache() -> None:
    """Raises OSError where our cache takes no file."""
    folder = cache_folder(KERNELS).parent
    if shutil.disk_usage(folder).free < FREE:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(folder))
    path = folder / "room"
    try:
        write_whole(path, bytes(ROOM))
    finally:
        path.unlink(missing_ok=True)


# A cache of kernels that a bad disk, a copy or a lost supply has damaged makes PoCL end the
# program, at each start anew.  So each start keeps a file into which Python writes where it was
# when a library ended it; the next start that finds one begins with an empty cache.

_noted: list[IO[bytes]] = []  # the file of this start


def mend_caches() -> None:
    if tidy_starts():
        discard_folder(cache_folder(KERNELS))
        say("An earlier start ended inside a library; kernels are compiled anew, once.")
    if remove_damaged_invokers():
        say("A cache of the kernels' callers was damaged; it is made anew.")
    sweep_litter()


def tidy_starts() -> bool:
    """Removes the files of starts that are over; True where a library ended one of them."""
    crashed = False
    for path in cache_folder(STARTS).iterdir():
        try:
            with path.open("r+b") as file:
                if try_lock(file.fileno()) is not False:
                    crashed |= file.read(1) != b""
                    path.unlink()
        except OSError:
            continue  # another start has removed it, or Windows holds it
    return crashed


def note_start() -> None:
    from shapeshift.rasterizer.device import opened

    if _noted:
        return
    path = cache_folder(STARTS) / f"{os.getpid()}-{secrets.token_hex(4)}"
    file = path.open("xb")
    if try_lock(file.fileno()) is None:  # no locks here: it would be taken for one that is over
        file.close()
        path.unlink()
        return

    def watch() -> None:
        faulthandler.disable()
        faulthandler.enable(file)

    def end() -> None:
        faulthandler.disable()
        path.unlink(missing_ok=True)
        file.close()

    watch()
    opened.append(watch)
    _noted.append(file)
    atexit.register(end)


def remove_damaged_invokers() -> bool:
    """Whether a database of pyopencl's was none; it stops at such a one."""
    import sqlite3

    damaged = False
    for path in cache_base().glob(INVOKERS):
        try:
            with contextlib.closing(sqlite3.connect(path, timeout=1.0)) as base:
                base.execute("pragma quick_check").fetchall()
        except sqlite3.OperationalError:
            continue  # somebody else writes it
        except sqlite3.DatabaseError:
            path.unlink(missing_ok=True)
            damaged = True
    return damaged


def sweep_litter() -> None:
    before = time.time() - LITTER_S
    for path in cache_folder(KERNELS).glob(LITTER):
        state = path.lstat()
        if state.st_size == 0 and state.st_mtime < before:
            path.unlink(missing_ok=True)


def stand_in() -> Path:
    """A folder among the temporary files that nobody else can have filled: kernels in it are run.

    The same at the next start, unless somebody was there first; then one for this start alone.
    """
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    path = Path(tempfile.gettempdir()) / f"{OURS}-{user}"
    try:
        path.mkdir(0o700)
    except FileExistsError:
        pass
    if not is_own(path):
        path = Path(tempfile.mkdtemp(prefix=f"{OURS}-"))
        atexit.register(shutil.rmtree, path, ignore_errors=True)
    return path


def is_own(path: Path) -> bool:
    """Whether a folder is this user's alone, and no link."""
    state = path.lstat()
    mine = not hasattr(os, "getuid") or state.st_uid == os.getuid()
    closed = os.name == "nt" or not state.st_mode & 0o077
    return stat.S_ISDIR(state.st_mode) and mine and closed
