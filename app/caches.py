"""Before anything is drawn: where libraries keep what they can make again, also on read-only homes.

Kernels of PoCL, invokers of pyopencl, shaders of Mesa, fonts of matplotlib and our own colliders
and charts go into the user's cache.  Where that cannot be written, a folder of the user's among
the temporary files stands in for it, which is said once.
"""

import atexit
import os
import shutil
import stat
import sys
import tempfile
from pathlib import Path

from shapeshift.app.paths import has_left
from shapeshift.app.terminal import say
from shapeshift.runtime_models.files.user_cache import OURS, cache_base, cache_folder
from shapeshift.runtime_models.files.whole_file import write_whole

CACHELESS = ("info", "lint", "cameras", "export")  # commands that draw and keep nothing
ROOM = 1 << 16  # bytes that have to fit: a cache on a full disk is none


def settle_caches_for(command: str) -> None:
    """The same for a command of the program itself; another program's environment is its own."""
    if has_left() and command not in CACHELESS:
        settle_caches()


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
    os.environ.setdefault("POCL_CACHE_DIR", str(cache_folder("pocl")))
    os.environ.setdefault("MPLCONFIGDIR", str(cache_folder("matplotlib")))


def try_cache() -> None:
    """Raises OSError where our cache takes no file."""
    folder = cache_folder("pocl").parent
    path = folder / "room"
    try:
        write_whole(path, bytes(ROOM))
    finally:
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
