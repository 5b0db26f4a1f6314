"""Label maps of a capture's photos, in a folder of any program's: found by the photos' names."""

from collections import Counter
from pathlib import Path

import numpy as np

from shapeshift.decomposition.masks.label_maps import SILENT, read_label_map
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.undistort import lost, straight_pixels
from shapeshift.scene.pose import View


def find_maps(folder: Path, capture: Capture) -> list[tuple[Photo, Path]]:
    """The label map of each photo that has one: rgb/012.png for rgb/012.jpg, or rgb/012.jpg.png;
    012.png alone where only one photo is called so.  Raises BadFile where there is none at all.
    """
    if not folder.is_dir():
        raise BadFile(f"{folder} is no folder; label maps lie in one, named as their photos.")
    stems = Counter(photo.path.stem for photo in capture.photos)
    found: list[tuple[Photo, Path]] = []
    for photo in capture.photos:
        below = below_capture(photo, capture)
        names = [below.with_suffix(".png"), below.with_name(f"{below.name}.png")]
        if stems[photo.path.stem] == 1:
            names += [Path(name.name) for name in names]
        path = next((folder / name for name in names if (folder / name).is_file()), None)
        if path is not None:
            found.append((photo, path))
    if not found:
        first = below_capture(capture.photos[0], capture).with_suffix(".png")
        raise BadFile(
            f"{folder} has a label map of none of the {len(capture.photos)} photos; the first "
            f"one's would be called {first.as_posix()}."
        )
    return found


def below_capture(photo: Photo, capture: Capture) -> Path:
    """The photo's path from the capture's folder; of one elsewhere its name."""
    try:
        return photo.path.relative_to(capture.folder)
    except ValueError:
        return Path(photo.path.name)


def read_map(path: Path, photo: Photo, factor: int = 1) -> tuple[View, np.ndarray]:
    """The view of the photo with 1 / factor of its pixels a side, and its labels (H, W) uint8.

    Each pixel has the label of the nearest pixel of the file, never a blend; where a straightened
    photo shows nothing it is silent.  Raises BadFile.
    """
    labels, gone = sampled(read_label_map(path, photo.file_size), photo, factor)
    if gone is not None:
        labels[gone] = SILENT
    return photo.view.divided(factor), labels


def sampled(pixels: np.ndarray, photo: Photo, factor: int) -> tuple[np.ndarray, np.ndarray | None]:
    """Pixels (H, W) of the photo's file at the middles of those of its divided view, straight; and
    (h, w) bool where a bent photo shows nothing, None of a straight one.
    """
    view, size = photo.view.divided(factor), photo.file_size
    x, y = ((np.arange(side) + 0.5) * factor for side in view.size)
    if photo.lens is None:
        return np.ascontiguousarray(pixels[np.ix_(y.astype(int), x.astype(int))]), None
    at = np.nan_to_num(straight_pixels(photo.lens, x, y), nan=-1.0)
    column, row = (np.clip(at[..., k], 0, size[k] - 1).astype(int) for k in (0, 1))
    return np.ascontiguousarray(pixels[row, column]), lost(photo.lens, view.size, factor)


def stop_of(photo: Photo, stops: tuple[Stop, ...]) -> Stop:
    """The model's stop that a photo shows, by its modality's name.  Raises BadFile."""
    name = photo.modality.casefold()
    found = [stop for stop in stops if stop.name.casefold() == name]
    if not found and len(stops) == 1:
        return stops[0]
    if not found:
        names = ", ".join(stop.name for stop in stops)
        raise BadFile(
            f"the photos of '{photo.modality}' belong to no stop of the scene, which has {names}; "
            "name the scene that was trained on this capture."
        )
    return found[0]
