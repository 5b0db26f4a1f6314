"""One image of a COLMAP model that stands for a photo of light and one of heat."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.stop_names import sort_of_name
from shapeshift.scene.capture_files import ENDINGS, find_file, parts_of
from shapeshift.scene.captures.colmap_tables import Posed
from shapeshift.scene.captures.modalities.photo_modality import SPLITS


def with_twins(posed: list[Posed], root: Path) -> tuple[list[Posed], tuple[str, ...]]:
    """The images, each once for each photo that stands for it, and what is doubtful.

    In the form of Thermal-Gaussian a bare name of the model is that of a photo in rgb/train or
    rgb/test, and of one in thermal/train or thermal/test, of the same camera and place.
    """
    sorts = [sub for sub in sorted(root.iterdir()) if sub.is_dir() and sort_of_name(sub.name)]
    if not sorts:
        return posed, ()
    places = [[p for p in (sub, *(sub / split for split in SPLITS)) if p.is_dir()] for sub in sorts]
    out, lone = [], []
    for image in posed:
        if os.path.isfile(find_file(root, image.name, ("",)).path):
            out.append(image)
            continue
        *above, file = parts_of(image.name)
        if above and (root / above[0]).is_dir():  # it is said where the photo lay
            out.append(image)
            continue
        found = [twin for each in places if (twin := first_of(each, file)) is not None]
        out += [replace(image, name=p.relative_to(root).as_posix()) for p in found] or [image]
        lone += [image.name] if 0 < len(found) < len(sorts) else []
    folders = ", ".join(sub.name for sub in sorts)
    said = f"{len(lone)} images of the model have no photo in each of {folders}, for example "
    return out, (f"{said}{path_end(lone[0])}.",) if lone else ()


def first_of(places: Sequence[Path], file: str) -> Path | None:
    """The photo of that name in one of the folders; its ending may be another."""
    for name, endings in ((file, ("",)), (Path(file).stem, ENDINGS)):
        for place in places:
            path = find_file(place, name, endings).path
            if os.path.isfile(path):
                return path
    return None
