"""A COLMAP folder (sparse/0 and images/, text or binary) -> Capture."""

from dataclasses import replace
from itertools import compress
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, shown
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.stop_names import guess_kind
from shapeshift.scene.cameras.read_colmap_cameras import camera_pose
from shapeshift.scene.capture_photos import doubts_of, image_size, posed_photo, refuse_all_missing
from shapeshift.scene.captures.capture import Capture
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
from shapeshift.scene.captures.colmap_points import read_colmap_points
from shapeshift.scene.captures.colmap_tables import find_model, read_tables
from shapeshift.scene.captures.read_transforms import read_capture_json


def read_colmap(folder: Path) -> Capture:
    """Sub-folders of images/ are modalities; capture.json may say more (docs/capture.md)."""
    if (found := find_model(folder)) is None:
        raise BadFile(f"{folder} holds no COLMAP model; images.bin or images.txt is wanted.")
    model, ending = found
    lenses, images = read_tables(model, ending)
    posed = sorted(images, key=lambda image: image.name)
    root = folder / "images" if (folder / "images").is_dir() else folder
    said = read_capture_json(folder / "capture.json") if (folder / "capture.json").is_file() else {}
    stops, modality_of = modalities(said, [i.name for i in posed], folder)
    cameras = [camera_pose(image, f"{folder}: {image.name}") for image in posed]
    world = CaptureWorld.of(np.array(cameras), COLMAP_UP, said.get("up", COLMAP_UP), str(folder))
    there = [(root / image.name).is_file() for image in posed]
    missing = [str(root / i.name) for i, found in zip(posed, there, strict=True) if not found]
    refuse_all_missing(missing, len(posed), str(model))
    photos, rescaled = [], []
    for image, world_from_camera in compress(zip(posed, cameras, strict=True), there):
        lens, path = lenses[image.lens], root / image.name
        matrix, where = world.turned(world_from_camera), f"{folder}: camera {image.lens}"
        photo = posed_photo(path, modality_of[image.name], matrix, lens, where)
        mask = find_mask(folder, image.name)
        if mask is not None:
            image_size(mask, photo.file_size)
        photos.append(replace(photo, mask=mask))
        rescaled += [str(path)] if photo.file_size != lens.size else []
    xyz, rgb = read_colmap_points(model / f"points3D{ending}")
    points, colors = (xyz, rgb.astype(np.float32) / 255) if len(xyz) else (None, None)
    counts = counts_from(said.get("modalities"), f"{folder}/capture.json")
    photos = with_counts(split_every_8th(photos), counts)
    background = background_from(said, f"{folder}/capture.json")
    guessed, doubts = not said.get("modalities"), doubts_of(len(posed), missing, photos, rescaled)
    return world.capture(folder, stops, photos, points, colors, background, guessed, doubts=doubts)


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
