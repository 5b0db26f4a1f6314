"""Two folders change places in one moment, where the system can do that."""

import ctypes
import os
import sys
from pathlib import Path

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
