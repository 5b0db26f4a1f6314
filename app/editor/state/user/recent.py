"""The files that were opened last, kept for the next start."""

import json
from dataclasses import dataclass, field
from pathlib import Path

from shapeshift.runtime_models.files.json_fields import saved_object
from shapeshift.runtime_models.files.whole_file import write_whole

MOST = 10
LARGEST = 1 << 20  # bytes; a list of ten paths is never so long
FILE = "recent.json"


@dataclass
class RecentFiles:
    """A list in a file of its folder, newest first; a broken file counts as empty."""

    folder: Path
    paths: tuple[Path, ...] = field(default=())

    @staticmethod
    def read(folder: Path) -> "RecentFiles":
        listed = saved_object(folder / FILE, LARGEST).get("recent")
        texts = listed if isinstance(listed, list) else []
        good = [t for t in texts if isinstance(t, str) and t and "\0" not in t]
        return RecentFiles(folder, tuple(map(Path, dict.fromkeys(good)))[:MOST])

    def add(self, path: Path) -> None:
        """Puts a file first and writes the list; OSError where the folder cannot be written."""
        path = path.absolute()
        # Another window may have added to the list meanwhile.
        others = [p for p in RecentFiles.read(self.folder).paths if p != path]
        self._keep((path, *others)[:MOST])

    def clear(self) -> None:
        self._keep(())

    def _keep(self, paths: tuple[Path, ...]) -> None:
        self.paths = paths
        self.folder.mkdir(parents=True, exist_ok=True)
        # A name that is no text (Linux allows any bytes) is kept by JSON's escapes.
        data = json.dumps({"recent": [str(p) for p in paths]}, indent=1)
        write_whole(self.folder / FILE, data.encode())
