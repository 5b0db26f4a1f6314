"""Which scene files this person's own saving has written: those alone are written over unasked."""

import json
from pathlib import Path

from shapeshift.runtime_models.files.json_fields import saved_object
from shapeshift.runtime_models.files.whole_file import write_whole

FILE = "saved.json"
MOST = 200  # files that are remembered
LARGEST = 1 << 20  # bytes of the list

Stamp = tuple[int, ...]  # what changes when somebody else writes a file


class OwnFiles:
    """Paths with the stamp that each had after its last saving, in a file of the folder.

    A broken or missing list counts as empty: then it is asked once more.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder  # None: remembered until the program ends
        self._stamps: dict[str, Stamp] = _read(folder / FILE) if folder else {}

    def has(self, path: Path, stamp: Stamp) -> bool:
        """Whether the file is as the last saving has left it."""
        return bool(stamp) and self._stamps.get(_key(path)) == tuple(stamp)

    def wrote(self, path: Path, stamp: Stamp) -> None:
        """A file was saved just now.  OSError where the list cannot be kept."""
        if self._folder is not None:  # another window may have saved meanwhile
            self._stamps = _read(self._folder / FILE) | self._stamps
        self._stamps.pop(_key(path), None)
        self._stamps[_key(path)] = tuple(stamp)
        newest = list(self._stamps.items())[-MOST:]
        self._stamps = dict(newest)
        if self._folder is not None:
            self._folder.mkdir(parents=True, exist_ok=True)
            rows = [{"path": path, "stamp": stamp} for path, stamp in newest]
            write_whole(self._folder / FILE, json.dumps({"saved": rows}, indent=1).encode())


def _key(path: Path) -> str:
    return str(path.absolute())


def _read(path: Path) -> dict[str, Stamp]:
    rows = saved_object(path, LARGEST).get("saved")
    found = {}
    for row in rows if isinstance(rows, list) else []:
        name, stamp = (row.get("path"), row.get("stamp")) if isinstance(row, dict) else (0, 0)
        if isinstance(name, str) and isinstance(stamp, list) and all(type(n) is int for n in stamp):
            found[name] = tuple(stamp)
    return found
