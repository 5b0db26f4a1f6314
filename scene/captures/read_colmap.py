"""A COLMAP folder (sparse/0 and images/, text or binary) -> Capture."""

import os
from dataclasses import replace
from itertools import compress
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, shown
from shapeshift.runtime_models.files.memory import read_text_file
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.stop_names import guess_kind
from shapeshift.scene.cameras.read_colmap_cameras import camera_pose, other_lengths
from shapeshift.scene.capture_files import SMALLER, find_file
from shapeshift.scene.capture_masks import meant_by_masks, refuse_other_mask, stated_meaning
from shapeshift.scene.capture_photos import doubts_of, fits, posed_photos, refuse_all_missing
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.capture_rules import (
    COLMAP_UP,
    CaptureWorld,
    background_from,
    counts_from,
    split_every_8th,
    spread_stops,
    stops_from,
    with_counts,
)
from shapeshift.scene.captures.colmap.colmap_points import read_colmap_points
from shapeshift.scene.captures.colmap_tables import find_model, read_tables
from shapeshift.scene.captures.read_transforms import read_capture_json

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
    posed = sorted(images, key=lambda image: image.name)
    said = read_capture_json(folder / "capture.json") if (folder / "capture.json").is_file() else {}
    stops, modality_of = modalities(said, [i.name for i in posed], folder)
    cameras = [camera_pose(image, f"{folder}: {image.name}") for image in posed]
    world = CaptureWorld.of(np.array(cameras), COLMAP_UP, said.get("up", COLMAP_UP), str(folder))
    paths = [find_file(root, image.name, ("",)).path for image in posed]
    there = [os.path.isfile(path) for path in paths]
    missing = [str(path) for path, found in zip(paths, there, strict=True) if not found]
    refuse_all_missing(missing, len(posed), str(model))
    means = stated_meaning(Fields(said, f"{folder}/capture.json"))
    photos: list[Photo] = []
    rescaled: list[str] = []
    turned: list[str] = []
    for image, path, world_from_camera in compress(zip(posed, paths, cameras, strict=True), there):
        lens = lenses[image.lens]
        matrix, where = world.turned(world_from_camera), f"{folder}: camera {image.lens}"
        made = posed_photos(path, modality_of[image.name], matrix, lens, where)
        mask = find_mask(base, image.name)
        if mask is not None:
            refuse_other_mask(mask, made[0].file_size)
        photos += [replace(photo, mask=mask, mask_means=means) for photo in made]
        if made[0].file_size != lens.size:
            (rescaled if fits(lens.size, made[0].file_size) else turned).append(str(path))
    points, colors, more = points_of(model / f"points3D{ending}")
    counts = counts_from(said.get("modalities"), f"{folder}/capture.json")
    photos = with_counts(listed_split(photos, folder, root), counts)
    background = background_from(said, f"{folder}/capture.json")
    guessed = not said.get("modalities")
    photos, unsure = meant_by_masks(photos)
    doubts = doubts_of(len(posed), missing, photos, rescaled, turned=turned) + unsure + more
    doubts += other_lengths(posed)
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


def listed_split(photos: list[Photo], folder: Path, root: Path) -> list[Photo]:
    """By nerfstudio's lists beside the model, a name a line; without them every 8th is held out.

    Photos in none of the lists are not used.
    """
    splits: dict[str, str] = {}
    for name, split in LISTS.items():
        if (folder / name).is_file():
            lines = read_text_file(folder / name).decode("utf-8", "replace").split("\n")
            splits |= {line.strip(): split for line in lines if line.strip()}
    if not splits:
        return split_every_8th(photos)
    named = [(photo, splits.get(photo.path.relative_to(root).as_posix())) for photo in photos]
    used = [replace(photo, split=split) for photo, split in named if split]
    if not used:
        raise BadFile(f"{folder}: its lists of training and test photos name none of its photos")
    return used


def modalities(
    said: dict, names: list[str], folder: Path
) -> tuple[tuple[Stop, ...], dict[str, str]]:
    """Stops, and image name -> stop name, from capture.json or else from the sub-folders."""
    if not said.get("modalities"):
        first = {n: n.split("/")[0] if "/" in n else "RGB" for n in names}
        # Visible light first, then heat, then the rest by name.
        order = {"rgb": 0, "thermal": 1, "layer": 2}
        found = sorted(set(first.values()), key=lambda n: (order[guess_kind(n, 2)], n))
        return spread_stops(found), first
    where, entries = f"{folder}/capture.json", said["modalities"]
    stops = stops_from(entries, where)
    of: dict = {}
    for stop, entry in zip(stops, entries, strict=True):
        if stop.formula:
            continue
        prefix = Fields(entry, where).text("folder", stop.name).rstrip("/") + "/"
        mine = [n for n in names if n.startswith(prefix)]
        if not mine:
            raise BadFile(
                f"{where}: modality {shown(stop.name)} has no images under "
                f"images/{path_end(prefix)}; add them to the COLMAP model or drop the modality"
            )
        of |= dict.fromkeys(mine, stop.name)
    left = sorted(set(names) - set(of))
    if left:
        raise BadFile(f"{where}: image {left[0]} belongs to no listed modality")
    return tuple(sorted(stops, key=lambda s: s.x)), of


def find_mask(folder: Path, name: str) -> Path | None:
    """COLMAP's masks/NAME.jpg.png, or masks/NAME.png."""
    for path in (folder / "masks" / f"{name}.png", (folder / "masks" / name).with_suffix(".png")):
        if path.is_file():
            return path
    return None
