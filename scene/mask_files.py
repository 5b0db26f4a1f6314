"""Masks that lie with photos: which file is the mask of which photo, by the names of both.

Programs call the mask of images/a.jpg masks/a.jpg.png (COLMAP), masks/a.png (nerfstudio), a.jpg
again, images/a.jpg.mask.png (RealityScan) or a_mask.png (Metashape).
"""

import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from shapeshift.scene.capture_files import (
    SMALLER,
    entries_of,
    files_below,
    is_picture,
    photo_key,
)

# Folders of masks in which white counts, for photos of images/.
FOLDERS = ("masks", "mask", "image_masks", "images_masks", "images_mask", "mask_images")
INSIDE = (*FOLDERS, "_mask")  # within the folder of photos; RealityScan's layers
OF_PHOTO = re.compile(r"(.+)[._-]mask$", re.DOTALL | re.IGNORECASE)  # before the ending
# instant-ngp's hide what is white; others hold classes, in which white is one of many.
INVERTED = re.compile(r"^dynamic_mask_")
OTHER_FOLDERS = re.compile(r"(mask|segment|semantic)", re.IGNORECASE)
SMALLER_PHOTOS = re.compile(r"images(_\d+)$")
NO_NAME = "no photo has their name"


class FoundMasks(NamedTuple):
    """Of one capture."""

    of: dict[str, Path]  # by photo_key of the photo's name
    others: list[Path]  # masks of no photo
    beside: set[str]  # names below the folder of photos that are masks, not photos
    unread: list[Path]  # files of folders and forms whose white means something else


def find_masks(base: Path, photos: Path, names: Sequence[str], listed: Sequence[str]) -> FoundMasks:
    """names: of the photos, below the folder `photos`; listed: all files below it; base: where
    folders of masks lie beside that one.
    """
    known = {photo_key(name) for name in names}
    files = masks_inside(photos, listed, known)
    beside = {path.relative_to(photos).as_posix() for _, path in files}
    unread = [photos / name for name in listed if INVERTED.match(name.rpartition("/")[2])]
    there = entries_of(base, base.stat().st_mtime_ns) if base.is_dir() else {}
    smaller = SMALLER_PHOTOS.match(photos.name)
    own = [f"{name}{smaller[1]}" for name in FOLDERS[:2]] if smaller else []
    if not any(name in there for name in FOLDERS):  # then the smaller ones will do
        own += [f"{name}_{factor}" for name in FOLDERS[:2] for factor in SMALLER]
    for name in (*own, *FOLDERS):
        folder = base / there.get(name, name)
        if folder.is_dir() and folder != photos:
            files += [(below, folder / below) for below in files_below(folder)]
    for name in there.values():
        other = OTHER_FOLDERS.search(name) and re.sub(r"_\d+$", "", name).lower() not in FOLDERS
        if other and (base / name).is_dir() and base / name != photos:
            unread += [base / name / below for below in files_below(base / name)]
    of, others = matched(names, [(name, path) for name, path in files if is_picture(name)])
    return FoundMasks(of, others, beside, [path for path in unread if is_picture(path.name)])


def masks_in(folder: Path, names: Sequence[str]) -> tuple[dict[str, Path], list[Path]]:
    """Of the photos with these names in one folder of masks, and those of no photo."""
    files = [(name, folder / name) for name in files_below(folder) if is_picture(name)]
    return matched(names, files)


def masks_inside(photos: Path, listed: Sequence[str], known: set[str]) -> list[tuple[str, Path]]:
    """Among the photos: called like masks, or in folders of them; with the names without these."""
    found = []
    for name in listed:
        *folders, last = name.split("/")
        outer = [part for part in folders if part.lower() not in INSIDE]
        marked = len(outer) < len(folders) or OF_PHOTO.match(os.path.splitext(last)[0])
        if marked and photo_key(name) not in known:
            found.append(("/".join([*outer, last]), photos / name))
    return found


def matched(
    names: Sequence[str], files: Sequence[tuple[str, Path]]
) -> tuple[dict[str, Path], list[Path]]:
    """By photo_key; and the masks of no photo.  files: names as of photos, the likelier first."""
    masks = by_name(files)
    deep = all("/" in name for name in names)
    bare = by_name(
        [(name.rpartition("/")[2], path) for name, path in files if not (deep and "/" in name)]
    )
    ends = Counter(key.rpartition("/")[2] for key in set(map(photo_key, names)))
    mask_ends = Counter(name.rpartition("/")[2] for name, _ in files)
    of: dict[str, Path] = {}
    for name in names:
        key = photo_key(name)
        path = masks.get(key) or masks.get(os.path.splitext(key)[0])
        end = key.rpartition("/")[2]
        if path is None and ends[end] == 1:  # either of the two may lie in one folder more
            path = bare.get(end) or bare.get(os.path.splitext(end)[0])
            if path is not None and mask_ends[path.name] > 1:
                path = None
        if path is not None:
            of[key] = path
    taken = set(of.values())
    return of, [path for _, path in files if path not in taken]


def by_name(files: Sequence[tuple[str, Path]]) -> Mapping[str, Path]:
    """Masks by what is before their ending, and after that by what is before "mask"."""
    out: dict[str, Path] = {}
    png_first = sorted(files, key=lambda file: file[1].suffix.lower() != ".png")
    stems = [(os.path.splitext(name)[0], path) for name, path in png_first]
    for stem, path in stems:
        out.setdefault(photo_key(stem), path)
    for stem, path in stems:
        if found := OF_PHOTO.match(stem):
            out.setdefault(photo_key(found[1]), path)
    return out
