"""Pictures among photos that are none: depth, normals, masks, classes, by how they are called."""

import os
import re
from collections.abc import Callable, Sequence

from shapeshift.runtime_models.stop_names import words_of
from shapeshift.scene.capture_files import is_picture, parts_of, photo_key

DEPTH, NORMALS, MASKS, CLASSES = "depth photos", "normal maps", "masks", "pictures of classes"
# Folders of masks in which white counts, for photos of images/, and those within it; RealityScan's
# layers are the last.
FOLDERS = ("masks", "mask", "image_masks", "images_masks", "images_mask", "mask_images")
INSIDE = (*FOLDERS, "_mask")
# The same of programs of matting and of turntables; what else may be called so is told by pixels.
SILHOUETTES = ("silhouettes", "silhouette", "mattes", "matte", "alphas", "alpha")
OF_PHOTO = re.compile(r"(.+)[._-]mask$", re.DOTALL | re.IGNORECASE)  # before the ending
INVERTED = re.compile(r"^dynamic_mask_")  # instant-ngp's, which hide what is white
# One look, before names are taken to pieces: thousands of photos have none of these.
HINT = re.compile(r"depth|dispar|normal|mask|silhouette|matte|alpha|segment|semantic", re.I)
OF_KIND = re.compile(
    r"(.+?)[._ -](?:(depth(?:[._ -]?map)?|disparity)|(normals?(?:[._ -]?map)?)|(mask|alpha|matte"
    r"|silhouette)|(segmentation|semantic))(?:[._ -]?\d{1,4})?$",
    re.DOTALL | re.IGNORECASE,
)
DEPTH_WORDS = {"depth", "depths", "depthmap", "depthmaps", "disparity", "disparities"}
NORMAL_WORDS = {"normals", "normalmap", "normalmaps"}
CLASS_WORDS = {"segmentation", "segmentations", "semantic", "semantics"}
MAPS = {"map", "maps"}
BESIDE = MAPS | {"image", "images", "photo", "photos", "raw", "gt", "mono", "metric", "mask",
                 "masks", "left", "right", "png", "exr"}  # fmt: skip  # words that change nothing


def kind_of_folder(name: str) -> str:
    """DEPTH, NORMALS, MASKS or CLASSES by the whole name of a folder; "" of others.

    `depth_of_field`, `normal` (beside `opened`) and `masked_ball` are folders of photos.
    """
    if name.lower() in (*INSIDE, *SILHOUETTES):
        return MASKS
    found = set(words_of(name))
    words = found - BESIDE
    if words and words <= DEPTH_WORDS:
        return DEPTH
    if words and (words <= NORMAL_WORDS or (words == {"normal"} and found & MAPS)):
        return NORMALS
    return CLASSES if words and words <= CLASS_WORDS else ""


def other_pictures(names: Sequence[str], is_grey: Callable[[int], bool]) -> dict[int, str]:
    """Rows of pictures that are no photos, and of which kind, where other pictures are photos.

    By their folder, or by the end of a name that is a photo's before it.  What a folder of masks or
    classes holds is called as photos are, and masks have no colours: is_grey tells it of a row, and
    is asked once a folder.  In `alpha/` they may be photos of heat: only beside colours they are
    none.
    """
    if not any(map(HINT.search, names)):
        return {}
    parts = [parts_of(name) for name in names]
    known = {key for name in names for key in (photo_key(name), stem_of(photo_key(name)))}
    found: dict[int, str] = {}
    by_folder: dict[tuple[str, ...], list[int]] = {}
    for row, (*folders, file) in enumerate(parts):
        if kind := next(filter(None, map(kind_of_folder, folders)), ""):
            found[row] = kind
            by_folder.setdefault(tuple(folders), []).append(row)
        elif kind := kind_of_file(folders, file, known):
            found[row] = kind
    rows = [row for row in range(len(names)) if row not in found]
    photo_of = {ends_of(parts[row][-1])[0]: row for row in rows}
    for place, rows in by_folder.items():
        if (kind := found[rows[0]]) in (MASKS, CLASSES):
            ends = [end for row in rows for end in ends_of(parts[row][-1]) if end in photo_of]
            sure = {*map(str.lower, place)}.isdisjoint(SILHOUETTES)
            grey = kind == CLASSES or (bool(ends) and is_grey(rows[0]))
            if not (ends and grey and (sure or not is_grey(photo_of[ends[0]]))):
                for row in rows:
                    del found[row]
    return found if len(found) < len(names) else {}


def kind_of_file(folders: Sequence[str], file: str, known: set[str]) -> str:
    """Of a picture that is called as another one (photo_key in `known`) and after it "mask" ...; a
    mask of a.jpg that is called a.jpg.mask.png needs no a.jpg.
    """
    stem = stem_of(file)
    if INVERTED.match(file):
        return MASKS
    if (found := OF_PHOTO.match(stem)) and is_picture(found[1]):
        return MASKS
    if (found := OF_KIND.match(stem)) is None or photo_key("/".join([*folders, found[1]])) not in (
        known
    ):
        return ""
    words = found.groups()[1:]
    return next(k for k, w in zip((DEPTH, NORMALS, MASKS, CLASSES), words, strict=True) if w)


def stem_of(name: str) -> str:
    return os.path.splitext(name)[0]


def ends_of(file: str) -> tuple[str, ...]:
    """How the photo may be called whose mask, or whose classes, a file is: without endings."""
    stem = photo_key(stem_of(file))
    inner = OF_PHOTO.match(stem)
    stem = inner[1] if inner else stem
    return (stem, stem_of(stem)) if is_picture(stem) else (stem,)
