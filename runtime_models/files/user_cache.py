"""Where this user's caches lie: nowhere else, never beside a file that was only opened."""

import errno
import os
import stat
import sys
import tempfile
from pathlib import Path

from shapeshift.runtime_models.files.whole_file import make_folders

OURS = "shapeshift"


def cache_base() -> Path:
    """Where this platform keeps the caches of programs; the folder need not be there.

    %LOCALAPPDATA% on Windows, else XDG_CACHE_HOME, without it ~/Library/Caches on macOS and
    ~/.cache on Linux.
    """
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or tempfile.gettempdir())
    base = os.environ.get("XDG_CACHE_HOME", "")
    if os.path.isabs(base):  # the XDG rule: a relative one counts as unset
        return Path(base)
    return Path(os.path.expanduser("~/Library/Caches" if sys.platform == "darwin" else "~/.cache"))


def cache_folder(name: str) -> Path:
    """The folder of one of our caches, made for this user alone where it is absent.

    Raises OSError where it cannot be made, where a link stands in its place, and where it, or the
    folder of all of them, is another user's or may be written by others: kernels in it are run.
    """
    folder = make_folders(cache_base(), f"{OURS}/{name}", rights=0o700)
    refuse_others(folder.parent)
    refuse_others(folder)
    return folder


def refuse_others(folder: Path) -> None:
    """Raises OSError for a folder in which others than this user may put files."""
    if not hasattr(os, "getuid"):  # Windows: folders of the user's are the user's
        return
    state = folder.stat()
    if state.st_uid != os.getuid():
        raise OSError(errno.EPERM, "it is another user's", str(folder))
    if state.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise OSError(errno.EPERM, "others may write in it: chmod go-w", str(folder))
