"""The files that lie with a COLMAP model: photos, masks, points, lists; and what is not read."""

import mmap
import os
from array import array
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.capture_files import (
    SMALLER,
    entries_of,
    files_below,
    find_file,
    is_picture,
    photo_key,
)
from shapeshift.scene.capture_found import FileTable
from shapeshift.scene.captures.capture import Photo
from shapeshift.scene.captures.capture_rules import split_every_8th
from shapeshift.scene.captures.colmap.text_lines import AGAIN, lines_of, numbers_of
from shapeshift.scene.captures.colmap_tables import (
    COUNT,
    Posed,
    count_of,
    ending_of,
    images_in,
    mapped,
    models_in,
    short_of,
)
from shapeshift.scene.mask_files import NO_MASK, NO_NAME, find_masks, is_grey_file
from shapeshift.scene.other_pictures import (
    CLASSES,
    DEPTH,
    MASKS,
    NORMALS,
    kind_of_folder,
    other_pictures,
)

NORMAL = "normal"  # a folder of normal maps beside that of photos, where it is no state of a thing
OTHER_MASKS = "their white hides, or stands for a class; masks/ is for those whose white counts"
POSED = "they are posed as photos; a transforms.json can name them, capture.json can make a stop"
FEW = 4  # models that a sentence names
# nerfstudio's, beside the model
LISTS = {"train_list.txt": "train", "validation_list.txt": "test", "test_list.txt": "test"}


def base_of(folder: Path, model: Path) -> Path:
    """Where the folder of photos lies: a model may be named itself, to be read and no other."""
    if model == folder / "dense" / "sparse":
        return folder / "dense"
    if model == folder and photos_folder(folder) == folder:
        for place in (folder.absolute(), folder.absolute().parent):
            if place.name == "sparse" and photos_folder(place.parent) != place.parent:
                return place.parent
    return folder


def photos_folder(base: Path) -> Path:
    """images/, else the first of those with smaller photos, else the folder itself."""
    names = ("images", *(f"images_{factor}" for factor in SMALLER))
    return next((base / name for name in names if (base / name).is_dir()), base)


def photos_alone(posed: list[Posed], root: Path, table: FileTable) -> tuple[list[Posed], set[str]]:
    """The images without those that show depth, normals, masks or classes; photo_key of the masks.

    Where nobody says which stops there are: a model may be of everything below images/.
    """

    def path_of(row: int) -> Path:
        return find_file(root, posed[row].name, ("",)).path

    names = [image.name for image in posed]
    found = other_pictures(names, lambda row: is_grey_file(path_of(row)))
    for kind in (DEPTH, NORMALS, CLASSES):
        mine = [path_of(row) for row, each in found.items() if each == kind]
        table.left_out(kind, mine, POSED)
        table.accounted |= {photo_key(str(path)) for path in mine}
    masks = [path_of(row) for row, kind in found.items() if kind == MASKS]
    if masks:
        table.sentences.append(
            f"{len(masks)} images of the model are called as masks are, and taken for that, for "
            f"example {table.short(masks[0])}; capture.json makes a stop of them."
        )
    rest = [image for row, image in enumerate(posed) if row not in found]
    return rest, {photo_key(name_below(root, path)) for path in masks}


def masks_of(
    base: Path, root: Path, paths: Sequence[Path], table: FileTable, posed: Collection[str] = ()
) -> dict[Path, Path]:
    """The masks of photos; what else lies among these and these masks is left out.

    posed: masks that the model has, as of photos_alone.
    """
    name_of = {path: name_below(root, path) for path in paths}
    names = list(name_of.values())
    if root == base:  # beside the model: only folders that have photos of it
        places = sorted({name.rpartition("/")[0] for name in names})
        listed = [
            f"{place}/{name}" if place else name
            for place in places
            for name in files_below(root / place, deep=False)
        ]
    else:
        listed = files_below(root)
    found = find_masks(base, root, names, listed, posed)
    known = {photo_key(name) for name in names}
    no_photos = {*found.unread, *(root / name for name in found.beside)}
    others = [root / name for name in listed if is_picture(name) and photo_key(name) not in known]
    others = [path for path in others if photo_key(str(path)) not in table.accounted]
    table.unposed(path for path in others if path not in no_photos)
    table.left_out("masks", found.others, NO_NAME)
    table.left_out("masks", found.unread, OTHER_MASKS)
    table.left_out("masks", found.spare, NO_MASK)
    return {path: found.of[key] for path in paths if (key := photo_key(name_of[path])) in found.of}


def name_below(root: Path, path: Path) -> str:
    """A path as a name in `root`, with /; names may go up and down again."""
    text, start = str(path), f"{root}{os.sep}"
    if os.sep == "/" and text.startswith(start) and "/../" not in text:
        return text[len(start) :]  # nearly all; relpath asks for the working folder each time
    return Path(os.path.relpath(path, root)).as_posix()


def points_of(
    model: Path, ending: str
) -> tuple[np.ndarray | None, np.ndarray | None, tuple[str, ...]]:
    """Points and colours 0..1 of a model, and what is doubtful: a model may come without."""
    other = {".bin": ".txt", ".txt": ".bin"}[ending]
    paths = [model / f"points3D{each}" for each in (ending, other)]
    path = next((path for path in paths if path.is_file()), None)
    if path is None:
        return None, None, (f"The points {path_end(paths[0])} are not there.",)
    xyz, rgb = read_colmap_points(path)
    said = () if path == paths[0] else (f"The points are those of {path_end(path)}.",)
    return (xyz, rgb.astype(np.float32) / 255, said) if len(xyz) else (None, None, said)


def left_beside(base: Path, model: Path, ending: str, table: FileTable) -> None:
    """Says what else lies there that is not read: other models, depth photos, normal maps."""
    other_models(model, ending, table)
    unread_folders(base, table)


def other_models(model: Path, ending: str, table: FileTable) -> None:
    """Says which of several was taken, and what the others have."""
    others = others_of(model)
    if said := said_of_models(model, ending):
        mine = images_in(model, ending)
        table.used("models", 1, f"sparse/{model.name}, {mine} images")
        why = f"not joined to sparse/{model.name}, which has {mine} images"
        table.left_out("models", [path for path, _ in others], why, said=True)
        table.sentences += said


def others_of(model: Path) -> list[tuple[Path, str]]:
    """The models in the folder sparse/ of one, and what lies in that folder itself."""
    if model.parent.name != "sparse":
        return []
    found = [each for each in models_in(model.parent) if each[0] != model]
    ending = ending_of(model.parent, ("images",))
    return [*found, (model.parent, ending)] if ending is not None else found


def said_of_models(model: Path, ending: str) -> tuple[str, ...]:
    """A sentence where a model is one of several."""
    others = others_of(model)
    if not others:
        return ()
    few = [
        f"{'' if path == model.parent else 'sparse/'}{path.name} ({images_in(path, kind)})"
        for path, kind in others[:FEW]
    ]
    return (
        f"Of {len(others) + 1} models that are not joined, sparse/{model.name} with "
        f"{images_in(model, ending)} images is used, not {', '.join(few)}"
        f"{' ...' if len(others) > FEW else ''}; name the folder of another one to use that.",
    )


def unread_folders(base: Path, table: FileTable) -> None:
    """Depth photos and normal maps beside COLMAP's model, whose tables name none."""
    found: dict[str, list[Path]] = {DEPTH: [], NORMALS: []}
    for name in entries_of(base, base.stat().st_mtime_ns).values():
        kind = NORMALS if name.lower() == NORMAL else kind_of_folder(name)
        if kind in found and (base / name).is_dir():
            files = [base / name / below for below in files_below(base / name)]
            found[kind] += [p for p in files if photo_key(str(p)) not in table.accounted]
    for kind, files in found.items():
        table.left_out(kind, files, "a COLMAP model names none, a transforms.json can")


def listed_split(
    photos: list[Photo], folder: Path, root: Path, table: FileTable, by_folder: bool
) -> list[Photo]:
    """By nerfstudio's lists beside the model, a name a line; without them as it is where the
    photos' folders say it, else every 8th is held out.

    Photos in none of the lists are not used.  Names are compared as photos are found.
    """
    splits: dict[str, tuple[str, str, str]] = {}  # by photo_key: list, name, split
    for name, split in LISTS.items():
        if (folder / name).is_file():
            for line in lines_of(folder / name):
                if text := line.decode("utf-8", "replace").strip():
                    splits[photo_key(text).removeprefix("images/")] = name, text, split
    if not splits:
        return photos if by_folder else split_every_8th(photos)
    used, left, taken = [], [], set()
    for photo in photos:
        key = photo_key(name_below(root, photo.path))
        key = key if key in splits else os.path.splitext(key)[0]  # lists may leave out endings
        if key in splits:
            used.append(replace(photo, split=splits[key][2]))
            taken.add(key)
        else:
            left.append(photo.path)
    if not used:
        raise BadFile(f"{folder}: its lists of training and test photos name none of its photos")
    table.left_out("photos", list(dict.fromkeys(left)), f"they are in none of {', '.join(LISTS)}")
    for name in LISTS:
        lost = [text for key, (of, text, _) in splits.items() if of == name and key not in taken]
        table.left_out(f"names in {name}", lost, "no photo of the model has them", there=False)
    return used


# COLMAP's points3D, text or binary: places and colours; tracks are stepped over.

POINT = np.dtype([("number", "<u8"), ("xyz", "<f8", 3), ("rgb", "u1", 3), ("error", "<f8")])
STEP_OF_TRACK = 8  # bytes
WORDS = 8  # of a line of text before its track
FARTHEST = 1e30  # beyond this float32 ends soon


def read_colmap_points(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """(P, 3) float64 places and (P, 3) uint8 colours, in the order of their numbers; BadFile."""
    if not path.is_file():
        raise BadFile(f"{path} is missing; copy the whole COLMAP model.")
    if path.suffix == ".bin":
        with mapped(path) as data:
            rows = points_of_bytes(data, path)
    else:
        rows = points_of_text(path)
    rows = rows[np.argsort(rows["number"], kind="stable")]
    if not (np.abs(rows["xyz"]) < FARTHEST).all():
        raise BadFile(f"{path}: some points are nowhere (NaN, Inf or beyond measure); {AGAIN}.")
    return rows["xyz"].copy(), rows["rgb"].copy()


def points_of_bytes(data: bytes | mmap.mmap, path: Path) -> np.ndarray:
    """(P,) POINT; where each begins is found one by one, as tracks have any length."""
    count, at = count_of(data, POINT.itemsize + COUNT.size, path), COUNT.size
    starts = array("Q")
    for _ in range(count):
        end = at + POINT.itemsize
        if end + COUNT.size > len(data):
            raise short_of(path, count, "points")
        steps = COUNT.unpack_from(data, end)[0]
        starts.append(at)
        at = end + COUNT.size
        if steps > (len(data) - at) // STEP_OF_TRACK:
            raise short_of(path, count, "points")
        at += steps * STEP_OF_TRACK
    rows = np.empty((count, POINT.itemsize), np.uint8)
    whole, first = np.frombuffer(data, np.uint8), np.array(starts, np.int64)
    for byte in range(POINT.itemsize):
        rows[:, byte] = whole[first + byte]
    return rows.reshape(-1).view(POINT)


def points_of_text(path: Path) -> np.ndarray:
    """(P,) POINT."""
    values = []
    for line, text in enumerate(lines_of(path), 1):
        words = text.split(maxsplit=WORDS)
        if not words or words[0].startswith(b"#"):
            continue
        if len(words) < WORDS:
            raise BadFile(f"{path}, line {line}: a number, a place, a colour and an error wanted.")
        values.append(numbers_of(words[:WORDS], f"{path}, line {line}"))
    table = np.array(values, np.float64).reshape(-1, WORDS)
    rows = np.zeros(len(table), POINT)
    rows["number"] = table[:, 0].clip(0, 2.0**63)
    rows["xyz"], rows["rgb"] = table[:, 1:4], table[:, 4:7].clip(0, 255)
    return rows
