"""Where photos of a capture lie: by the names that its file gives, and where copies put them."""

import os
import re
import unicodedata
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import NamedTuple

ENDINGS = ("", ".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG", ".webp", ".tif", ".tiff")
PICTURES = {".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".bmp", ".heic", ".dng"}
MOST_FILES = 200_000  # of a folder and those in it that are looked at
# What other programs keep in folders of photos: of macOS, and of network drives' thumbnails.
NO_PHOTOS = (".", "@", "__MACOSX")
SMALLER = (2, 4, 8)  # images_2, images_4 ... hold the photos of images with smaller sides
# Of names that are no UTF-8, the likeliest first: Windows of the West, of Central Europe and in
# Russian, Japanese, Chinese, Korean; DOS, which zip programs still write.
CODE_PAGES = ("cp1252", "cp1250", "cp1251", "cp932", "gbk", "big5", "cp949", "cp437", "cp850")
NAMES_TRIED = 200  # in each of them
DRIVE = re.compile(r"^[A-Za-z]:[\\/]|^\\\\")  # of an absolute path of Windows


class NamedFile(NamedTuple):
    path: Path  # the name as it is where there is no such file
    elsewhere: bool = False  # not where the name says


def find_file(folder: Path, name: str, endings: Sequence[str] = ENDINGS) -> NamedFile:
    """The file that a capture in `folder` names; its ending may lack.

    Names may be written as on Windows.  What was copied from another machine, whose names begin at
    its own root or go up, is looked for below `folder` by the ends of its name, the longest first;
    photos of images/ also in images_2, images_4 and images_8.  Last, capital letters and the two
    ways to write an umlaut are taken for each other, as Windows and macOS do.
    """
    if found := with_ending(folder, name, endings):
        return NamedFile(found)
    parts = parts_of(name)
    if "\\" in name and (found := with_ending(folder, "/".join(parts), endings)):
        return NamedFile(found)
    below = [part for part in parts if part != ".."]
    ends = [below[start:] for start in range(len(below))] if is_strange(name) else [below]
    for end in ends:
        for first in ("", *SMALLER):
            place = "/".join([f"{end[0]}_{first}" if first else end[0], *end[1:]])
            if (first == "" or len(end) > 1) and (found := with_ending(folder, place, endings)):
                return NamedFile(found, elsewhere=True)
    if found := alike_named(folder, [part for part in parts if part != "."], endings):
        return NamedFile(found, elsewhere=True)
    return NamedFile(folder / name)


def is_strange(name: str) -> bool:
    """Whether a name begins at another machine's root, or goes up."""
    up = ".." in name and ".." in parts_of(name)
    return name.startswith("/") or up or bool(DRIVE.match(name))


def alike_named(folder: Path, parts: Sequence[str], endings: Sequence[str]) -> Path | None:
    """A file below `folder` whose name is the same but for capitals and composed letters."""
    if not parts or ".." in parts or not folder.is_dir():  # none of the name "."
        return None
    for part in parts[:-1]:
        name = entries_of(folder, folder.stat().st_mtime_ns).get(folded(part))
        if name is None or not (folder / name).is_dir():
            return None
        folder = folder / name
    names = entries_of(folder, folder.stat().st_mtime_ns)
    for ending in endings:
        name = names.get(folded(parts[-1] + ending))
        if name is not None and (folder / name).is_file():
            return folder / name
    return None


def folded(name: str) -> str:
    return unicodedata.normalize("NFC", name).casefold()


@lru_cache(maxsize=64)
def entries_of(folder: Path, changed_ns: int) -> dict[str, str]:
    """Names in a folder by how they are compared; changed_ns: when it was, to be read anew then."""
    return {folded(name): name for name in sorted(os.listdir(folder))}


def files_below(folder: Path, deep: bool = True) -> list[str]:
    """Names of the files in it, with / below it, sorted; hidden ones are passed over.

    deep: those in its folders as well, also behind links, each folder once.
    """
    found: list[str] = []
    seen: set[tuple[int, int]] = set()
    for place, folders, names in os.walk(folder, followlinks=True):
        status = os.stat(place)
        if (status.st_dev, status.st_ino) in seen:
            folders.clear()
            continue
        seen.add((status.st_dev, status.st_ino))
        folders[:] = [name for name in folders if deep and not name.startswith(NO_PHOTOS)]
        below = Path(place).relative_to(folder).as_posix()
        prefix = "" if below == "." else f"{below}/"
        found += [prefix + name for name in names if not name.startswith(NO_PHOTOS)]
        if len(found) > MOST_FILES:
            break
    return sorted(found[:MOST_FILES])


def is_picture(name: str) -> bool:
    return os.path.splitext(name)[1].lower() in PICTURES


def photo_key(name: str) -> str:
    """A photo's name to be compared: / between folders, without ./, capitals or umlauts apart."""
    if name.isascii() and not any(part in name for part in ("\\", "./", "//")):
        return name.lstrip("/").lower()  # nearly all are so
    return folded("/".join(part for part in parts_of(name) if part != "."))


def parts_of(name: str) -> list[str]:
    """Of a path as Windows or others write it, without its root."""
    if "\\" not in name:
        return [part for part in name.split("/") if part not in ("", ".")] or [name]
    windows = "/" not in name or DRIVE.match(name)
    path = PureWindowsPath(name) if windows else PurePosixPath(name.replace("\\", "/"))
    return [part for part in path.parts if part != path.anchor] or [name]


def with_ending(folder: Path, name: str, endings: Sequence[str]) -> Path | None:
    for ending in endings:
        path = os.path.join(folder, name) + ending
        if os.path.isfile(path):  # unlike Path.is_file it takes any text for a name
            return Path(path)
    return None


def in_code_page(names: Sequence[str], folder: Path | None) -> list[str]:
    """The names with those that are no UTF-8 (they hold surrogate escapes) read in the code page in
    which most of them are files in `folder`; where none is, in that of western Windows.
    """
    raw = {n: n.encode("utf-8", "surrogateescape") for n in names if not is_text(n)}
    if not raw:
        return list(names)
    tried = list(raw.values())[:NAMES_TRIED]
    best, most = CODE_PAGES[0], 0
    # In UTF-8 with its escapes: a file whose name has the same bytes, as Linux allows.
    for page in ("utf-8", *CODE_PAGES) if folder is not None else ():
        there = 0
        for name in tried:
            try:
                text = name.decode(page, "surrogateescape" if page == "utf-8" else "strict")
            except UnicodeDecodeError:
                continue
            there += os.path.isfile(find_file(folder or Path(), text, ("",)).path)
        if there > most:
            best, most = page, there
    errors = "surrogateescape" if best == "utf-8" else "replace"
    read = {name: data.decode(best, errors) for name, data in raw.items()}
    return [read.get(name, name) for name in names]


def is_text(name: str) -> bool:
    """Whether it has no halves of surrogate pairs."""
    return name.isascii() or not any("\ud800" <= letter <= "\udfff" for letter in name)
