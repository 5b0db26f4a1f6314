"""Masks that lie with photos: which file is the mask of which photo, by the names of both.

Programs call the mask of images/a.jpg masks/a.jpg.png (COLMAP), masks/a.png (nerfstudio), a.jpg
again, images/a.jpg.mask.png (RealityScan) or a_mask.png (Metashape).
"""

import os
import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from shapeshift.scene.capture_files import (
    SMALLER,
    entries_of,
    files_below,
    is_picture,
    photo_key,
)
from shapeshift.scene.captures.capture_rules import is_grey
from shapeshift.scene.captures.photo import ASPECT, open_image
from shapeshift.scene.captures.radiometric.no_value import FLOATS, GREY_16
from shapeshift.scene.other_pictures import FOLDERS, INSIDE, INVERTED, OF_PHOTO, SILHOUETTES

# Of classes, in which white is one of many.
OTHER_FOLDERS = re.compile(r"(mask|segment|semantic)", re.IGNORECASE)
SMALLER_PHOTOS = re.compile(r"images(_\d+)$")
NO_NAME = "no photo has their name"
NO_MASK = (
    "they have colours, or another shape than their photos, or their photos are grey or have masks "
    "elsewhere; call their folder masks/ if white counts"
)


class FoundMasks(NamedTuple):
    """Of one capture."""

    of: dict[str, Path]  # by photo_key of the photo's name
    others: list[Path]  # masks of no photo
    beside: set[str]  # names below the folder of photos that are masks, not photos
    unread: list[Path]  # files of folders and forms whose white means something else
    spare: list[Path]  # called as photos are, in folders of SILHOUETTES, and not taken


def find_masks(
    base: Path,
    photos: Path,
    names: Sequence[str],
    listed: Sequence[str],
    posed: Collection[str] = (),
) -> FoundMasks:
    """names: of the photos, below the folder `photos`; listed: all files below it; base: where
    folders of masks lie beside that one; posed: photo_key of listed ones that are known as masks.
    """
    known = {photo_key(name) for name in names}
    files = masks_inside(photos, listed, known, posed)
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
    spare: list[Path] = []
    for name in SILHOUETTES:
        folder = base / there.get(name, name)
        below = photo_key(f"{os.path.relpath(folder, photos)}/")
        if folder.is_dir() and folder != photos and not any(k.startswith(below) for k in known):
            found, alone = masks_in(folder, names)
            taken = {} if of else silhouettes(found, {photo_key(n): photos / n for n in names})
            of |= taken
            if taken:
                others += alone
            else:
                spare += found.values()
    unread = [path for path in unread if is_picture(path.name)]
    return FoundMasks(of, others, beside, unread, spare)


def silhouettes(found: dict[str, Path], photos: Mapping[str, Path]) -> dict[str, Path]:
    """The masks of a folder that may hold others: those of the photos' shape, where the first has
    no colours and its photo has.  found, photos: by photo_key.
    """
    first = next(iter(found), "")
    if not first or not is_grey_file(found[first]) or is_grey_file(photos[first]):
        return {}
    out = {}
    for key, path in found.items():
        with open_image(path) as mask, open_image(photos[key]) as photo:
            shape = mask.width * photo.height / (mask.height * photo.width)
        if abs(shape - 1) <= ASPECT:
            out[key] = path
    return out


def is_grey_file(path: Path) -> bool:
    """Whether a picture has no colours; one that is not there has."""
    if not os.path.isfile(path):
        return False
    with open_image(path) as image:
        mode = image.mode
    return mode in GREY_16 or mode == FLOATS or is_grey(path)


def masks_in(
    folder: Path, names: Sequence[str], photos: Collection[Path] = ()
) -> tuple[dict[str, Path], list[Path]]:
    """Of the photos with these names in one folder of masks, and those of no photo.

    photos: files that are none, where they lie in that folder, too.
    """
    files = [(name, folder / name) for name in files_below(folder) if is_picture(name)]
    return matched(names, [file for file in files if file[1] not in photos])


def masks_inside(
    photos: Path, listed: Sequence[str], known: set[str], posed: Collection[str] = ()
) -> list[tuple[str, Path]]:
    """Among the photos: called like masks, or in folders of them; with the names without these.

    posed: as of find_masks.
    """
    found = []
    for name in listed:
        *folders, last = name.split("/")
        key = photo_key(name)
        inside = (*INSIDE, *SILHOUETTES) if key in posed else INSIDE
        outer = [part for part in folders if part.lower() not in inside]
        marked = len(outer) < len(folders) or OF_PHOTO.match(os.path.splitext(last)[0])
        if marked and key not in known:
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
