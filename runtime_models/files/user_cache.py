"""Where this user's caches lie: nowhere else, never beside a file that was only opened."""

import os
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

    Raises OSError where it cannot be made, and where a link stands in its place.
    """
    return make_folders(cache_base(), f"{OURS}/{name}", rights=0o700)
