"""A COLMAP folder (sparse/0 and images/, text or binary) -> Capture."""

import os
from collections.abc import Sequence
from dataclasses import replace
from itertools import compress
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields
from shapeshift.runtime_models.files.memory import read_text_file
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.stop_names import sort_of_name
from shapeshift.scene.cameras.read_colmap_cameras import camera_pose, other_lengths
from shapeshift.scene.capture_files import ENDINGS, SMALLER, find_file, parts_of
from shapeshift.scene.capture_masks import meant_by_masks, refuse_other_mask, stated_meaning
from shapeshift.scene.capture_photos import (
    doubts_of,
    fits,
    image_size,
    posed_photos,
    refuse_all_missing,
)
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.capture_rules import (
    COLMAP_UP,
    CaptureWorld,
    background_from,
    split_every_8th,
    stops_from,
    with_counts,
)
from shapeshift.scene.captures.colmap.colmap_points import read_colmap_points
from shapeshift.scene.captures.colmap_tables import Posed, find_model, read_tables
from shapeshift.scene.captures.modalities.frame_modalities import said_beside
from shapeshift.scene.captures.modalities.photo_modality import SPLITS, modalities_of, splits_of
from shapeshift.scene.captures.modalities.said_modalities import said_modality_of
from shapeshift.scene.captures.modalities.two_sorts import (
    Opened,
    opened_photo,
    refuse_two_sorts,
)

# nerfstudio's, beside the model
LISTS = {"train_list.txt": "train", "validation_list.txt": "test", "test_list.txt": "test"}


def read_colmap(folder: Path) -> Capture:
    """Sub-folders of images/ are modalities; capture.json may say more (docs/capture.md)."""
    if (found := find_model(folder)) is None:
        raise BadFile(f"{folder} holds no COLMAP model; images.bin or images.txt is wanted.")
    model, ending = found
    base = folder / "dense" if model == folder / "dense" / "sparse" else folder
    root = photos_folder(base)
    lenses, images = read_tables(model, ending, root)
    posed, unpaired = with_twins(sorted(images, key=lambda image: image.name), root)
    names = [image.name for image in posed]
    paths = [find_file(root, name, ("",)).path for name in names]
    said = said_beside(folder)
    stops, modality_of = modalities(said, posed, paths, folder)
    cameras = [camera_pose(image, f"{folder}: {image.name}") for image in posed]
    world = CaptureWorld.of(np.array(cameras), COLMAP_UP, said.get("up", COLMAP_UP), str(folder))
    there = [os.path.isfile(path) for path in paths]
    missing = [str(path) for path, found in zip(paths, there, strict=True) if not found]
    refuse_all_missing(missing, len(posed), str(model))
    means = stated_meaning(Fields(said, f"{folder}/capture.json"))
    photos: list[Photo] = []
    opened: list[Opened] = []
    rescaled: list[str] = []
    turned: list[str] = []
    rows = zip(posed, paths, cameras, modality_of, splits_of(names), strict=True)
    for image, path, world_from_camera, modality, split in compress(rows, there):
        lens = lenses[image.lens]
        matrix, where = world.turned(world_from_camera), f"{folder}: camera {image.lens}"
        made = posed_photos(path, modality, matrix, lens, where)
        opened.append(opened_photo(image.name, made[0], str(image.lens)))
        mask = find_mask(base, image.name)
        if mask is not None:
            refuse_other_mask(mask, made[0].file_size)
        photos += [replace(p, mask=mask, mask_means=means, split=split or p.split) for p in made]
        if made[0].file_size != lens.size:
            (rescaled if fits(lens.size, made[0].file_size) else turned).append(str(path))
    points, colors, more = points_of(model / f"points3D{ending}")
    photos = listed_split(photos, folder, root, by_folder=any(splits_of(names)))
    photos = with_counts(photos, said.get("modalities"), f"{folder}/capture.json")
    background = background_from(said, f"{folder}/capture.json")
    if guessed := not said.get("modalities"):
        refuse_two_sorts(opened, stops, folder)
    photos, unsure = meant_by_masks(photos)
    doubts = doubts_of(len(posed), missing, photos, rescaled, turned=turned)
    doubts += unpaired + unsure + more + other_lengths(images)
    return world.capture(folder, stops, photos, points, colors, background, guessed, doubts=doubts)


def photos_folder(base: Path) -> Path:
    """images/, else the first of those with smaller photos, else the folder itself."""
    names = ("images", *(f"images_{factor}" for factor in SMALLER))
    return next((base / name for name in names if (base / name).is_dir()), base)


def points_of(path: Path) -> tuple[np.ndarray | None, np.ndarray | None, tuple[str, ...]]:
    """Points and colours 0..1 of a model, and what is doubtful: a model may come without."""
    if not path.is_file():
        return None, None, (f"The points {path_end(path)} are not there.",)
    xyz, rgb = read_colmap_points(path)
    return (xyz, rgb.astype(np.float32) / 255, ()) if len(xyz) else (None, None, ())


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


def listed_split(photos: list[Photo], folder: Path, root: Path, by_folder: bool) -> list[Photo]:
    """By nerfstudio's lists beside the model, a name a line; without them as the folders of photos
    say, and where these do not, every 8th is held out.

    Photos in none of the lists are not used.
    """
    splits: dict[str, str] = {}
    for name, split in LISTS.items():
        if (folder / name).is_file():
            lines = read_text_file(folder / name).decode("utf-8", "replace").split("\n")
            splits |= {line.strip(): split for line in lines if line.strip()}
    if not splits:
        return photos if by_folder else split_every_8th(photos)
    named = [(photo, splits.get(photo.path.relative_to(root).as_posix())) for photo in photos]
    used = [replace(photo, split=split) for photo, split in named if split]
    if not used:
        raise BadFile(f"{folder}: its lists of training and test photos name none of its photos")
    return used


def modalities(
    said: dict, posed: list[Posed], paths: list[Path], folder: Path
) -> tuple[tuple[Stop, ...], list[str]]:
    """Stops, and of each image the name of its stop: from capture.json, or else from the names."""
    names = [image.name for image in posed]
    if not said.get("modalities"):
        return modalities_of(names, folder)
    where, entries = f"{folder}/capture.json", said["modalities"]
    stops = stops_from(entries, where)

    def cameras_of(row: int) -> set[str]:
        size = image_size(paths[row], None) if os.path.isfile(paths[row]) else (0, 0)
        return {str(posed[row].lens), "{}x{}".format(*size)}

    of = said_modality_of(entries, stops, names, where, cameras_of)
    return tuple(sorted(stops, key=lambda s: s.x)), of


def find_mask(folder: Path, name: str) -> Path | None:
    """COLMAP's masks/NAME.jpg.png, or masks/NAME.png."""
    for path in (folder / "masks" / f"{name}.png", (folder / "masks" / name).with_suffix(".png")):
        if path.is_file():
            return path
    return None
