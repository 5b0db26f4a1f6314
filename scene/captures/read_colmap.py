"""A COLMAP folder (sparse/0 and images/, text or binary) -> Capture."""

import os
from dataclasses import replace
from itertools import compress
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, shown
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.stop_names import guess_kind
from shapeshift.scene.cameras.read_colmap_cameras import camera_pose, other_lengths
from shapeshift.scene.capture_files import find_file
from shapeshift.scene.capture_found import FileTable
from shapeshift.scene.capture_masks import meant_by_masks, refuse_other_mask, stated_meaning
from shapeshift.scene.capture_photos import doubts_of, fits, posed_photos, refuse_all_missing
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.capture_rules import (
    COLMAP_UP,
    CaptureWorld,
    background_from,
    spread_stops,
    stops_from,
    with_counts,
)
from shapeshift.scene.captures.colmap.colmap_files import (
    base_of,
    left_beside,
    listed_split,
    masks_of,
    photos_folder,
    points_of,
)
from shapeshift.scene.captures.colmap.rig_frames import refused_poses
from shapeshift.scene.captures.colmap_tables import find_model, read_tables
from shapeshift.scene.captures.radiometric.stated_bands import of_each_band, sharing_folders
from shapeshift.scene.captures.read_transforms import read_capture_json


def read_colmap(folder: Path) -> Capture:
    """Sub-folders of images/ are modalities; capture.json may say more (docs/capture.md)."""
    if (found := find_model(folder)) is None:
        raise BadFile(f"{folder} holds no COLMAP model; images.bin or images.txt is wanted.")
    model, ending = found
    base = base_of(folder, model)
    folder = base if model == folder else folder
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
    table = FileTable()
    masks = masks_of(base, root, list(compress(paths, there)), table)
    means = stated_meaning(Fields(said, f"{folder}/capture.json"))
    photos: list[Photo] = []
    rescaled: list[str] = []
    turned: list[str] = []
    for image, path, world_from_camera in compress(zip(posed, paths, cameras, strict=True), there):
        lens = lenses[image.lens]
        matrix, where = world.turned(world_from_camera), f"{folder}: camera {image.lens}"
        made = posed_photos(path, modality_of[image.name], matrix, lens, where)
        mask = masks.get(path)
        if mask is not None:
            refuse_other_mask(mask, made[0].file_size)
        photos += [replace(photo, mask=mask, mask_means=means) for photo in made]
        if made[0].file_size != lens.size:
            (rescaled if fits(lens.size, made[0].file_size) else turned).append(str(path))
    points, colors, more = points_of(model, ending)
    table.used("points", 0 if points is None else len(points))
    photos = listed_split(photos, folder, root, table)
    photos = of_each_band(photos, sharing_folders(said.get("modalities") or (), str(folder)))
    photos = with_counts(photos, said.get("modalities"), f"{folder}/capture.json")
    background = background_from(said, f"{folder}/capture.json")
    guessed = not said.get("modalities")
    photos, unsure = meant_by_masks(photos)
    doubts = doubts_of(len(posed), missing, photos, rescaled, turned=turned) + unsure + more
    doubts += other_lengths(posed) + refused_poses(model, ending, posed)
    table.photos(photos, missing)
    table.partners("masks", photos)
    left_beside(base, model, ending, table)
    doubts += tuple(table.sentences)
    capture = world.capture(
        folder, stops, photos, points, colors, background, guessed, doubts=doubts
    )
    return replace(capture, files=table.sorted_rows())


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
    sharing = sharing_folders(entries, where)
    bands = {name for names in sharing.values() for name in names[1:]}  # of the first's photos
    for stop, entry in zip(stops, entries, strict=True):
        if stop.formula or stop.name in bands:
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
