"""Where photos of a capture lie: by the names that its file gives, and where copies put them."""

import os
import re
from collections.abc import Sequence
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import NamedTuple

ENDINGS = ("", ".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG", ".webp", ".tif", ".tiff")
SMALLER = (2, 4, 8)  # images_2, images_4 ... hold the photos of images with smaller sides
DRIVE = re.compile(r"^[A-Za-z]:[\\/]|^\\\\")  # of an absolute path of Windows


class NamedFile(NamedTuple):
    path: Path  # the name as it is where there is no such file
    elsewhere: bool = False  # not where the name says


def find_file(folder: Path, name: str, endings: Sequence[str] = ENDINGS) -> NamedFile:
    """The file that a capture in `folder` names; its ending may lack.

    Names may be written as on Windows.  What was copied from another machine, whose names begin at
    its own root or go up, is looked for below `folder` by the ends of its name, the longest first;
    photos of images/ also in images_2, images_4 and images_8.
    """
    if found := with_ending(folder, name, endings):
        return NamedFile(found)
    parts = parts_of(name)
    if "\\" in name and (found := with_ending(folder, "/".join(parts), endings)):
        return NamedFile(found)
    strange = name.startswith("/") or ".." in parts or bool(DRIVE.match(name))
    below = [part for part in parts if part != ".."]
    ends = [below[start:] for start in range(len(below))] if strange else [below]
    for end in ends:
        for first in ("", *SMALLER):
            place = "/".join([f"{end[0]}_{first}" if first else end[0], *end[1:]])
            if (first == "" or len(end) > 1) and (found := with_ending(folder, place, endings)):
                return NamedFile(found, elsewhere=True)
    return NamedFile(folder / name)


def parts_of(name: str) -> list[str]:
    """Of a path as Windows or others write it, without its root."""
    windows = "\\" in name and ("/" not in name or DRIVE.match(name))
    path = PureWindowsPath(name) if windows else PurePosixPath(name.replace("\\", "/"))
    return [part for part in path.parts if part != path.anchor] or [name]


def with_ending(folder: Path, name: str, endings: Sequence[str]) -> Path | None:
    for ending in endings:
        path = f"{folder / name}{ending}"
        if os.path.isfile(path):  # unlike Path.is_file it takes any text for a name
            return Path(path)
    return None
