"""Any capture that we understand -> Capture, in our world: which reader a path is for."""

import os
import shlex
from dataclasses import replace
from itertools import compress
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, read_json, saved_object
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.program import program
from shapeshift.scene.cameras.colmap_cameras import camera_pose, other_lengths
from shapeshift.scene.capture_files import find_file
from shapeshift.scene.capture_found import FileTable
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
    stops_from,
    with_counts,
)
from shapeshift.scene.captures.colmap.colmap_files import (
    base_of,
    left_beside,
    listed_split,
    masks_of,
    photos_alone,
    photos_folder,
    points_of,
)
from shapeshift.scene.captures.colmap.rig_frames import refused_poses, refused_text
from shapeshift.scene.captures.colmap_tables import Posed, find_model, read_tables
from shapeshift.scene.captures.foreign.read_foreign import (
    blank_beside,
    is_table_of_lenses,
    known_beside,
    read_foreign,
    refuse_known,
)
from shapeshift.scene.captures.modalities.frame_modalities import said_beside, with_twins
from shapeshift.scene.captures.modalities.photo_modality import modalities_of, splits_of
from shapeshift.scene.captures.modalities.said_modalities import said_modality_of
from shapeshift.scene.captures.modalities.two_sorts import (
    check_two_sorts,
    has_grey_mode,
    opened_photos,
)
from shapeshift.scene.captures.radiometric.stated_bands import of_each_band, sharing_folders
from shapeshift.scene.captures.read_transforms import read_transforms
from shapeshift.scene.captures.scans.read_data_sets import TABLE as SITCOMS3D
from shapeshift.scene.captures.scans.read_data_sets import find_sitcoms3d
from shapeshift.scene.captures.scans.read_scan import capture_from, is_scan, read_scan

TABLES = ("transforms.json", "transforms_multimodal.json", "cameras.json")
MINIMAL = ("train.npz", "val.npz", "test.npz")
SPLITS = ("train", "val", "test")  # of transforms_{split}.json
MOST_LOOKED_AT, MOST_LOOKED_AT_BYTES = 200, 1 << 26  # entries and bytes, to find poses elsewhere
PICTURES = {".png", ".jpg", ".jpeg"}


def read_capture(path: Path) -> Capture:
    """Reads a folder, or one of its JSON files.  Raises BadFile in one sentence.

    Folders: COLMAP's (sparse/0 and images/), or with transforms.json, transforms_multimodal.json,
    cameras.json, transforms_train.json and transforms_test.json, or of a scanning program
    (docs/capture.md).
    """
    path = Path(path)
    if path.name == SITCOMS3D and find_sitcoms3d(path.parent) is not None:
        path = path.parent
    if path.is_file() and (posed := read_foreign(path)) is not None:
        return capture_from(posed)
    if path.is_file() and path.suffix.lower() == ".json":
        return read_transforms(path)
    if path.name in MINIMAL:
        raise minimal_form(path)
    refuse_known(path)
    if not path.exists() and (scan := read_scan(path)) is not None:
        return scan  # a scene of nuScenes, by name
    if not path.is_dir():
        found = "is no capture" if path.exists() else "does not exist"
        raise BadFile(f"{path}: {found}; give a folder of posed photos or its transforms.json")
    for name in TABLES:
        another = name == SITCOMS3D and find_sitcoms3d(path) is not None
        if (path / name).is_file() and not another and not is_table_of_lenses(path / name):
            return read_transforms(path / name)
    splits = [path / f"transforms_{s}.json" for s in SPLITS]
    if splits[0].is_file():
        return read_transforms(*(s for s in splits if s.is_file()))
    if find_model(path) is not None:
        return read_colmap(path)
    if (scan := read_scan(path)) is not None:
        return scan
    if (path / MINIMAL[0]).is_file():
        raise minimal_form(path)
    if (posed := read_foreign(path)) is not None:
        return capture_from(posed)
    if has_photos(path):
        raise BadFile(f"{path}: photos without poses; {how_to_pose(path)}.")
    raise BadFile(f"{path}: neither photos nor poses in this folder; see docs/capture.md")


def has_photos(folder: Path) -> bool:
    return any(path.suffix.lower() in PICTURES for path in folder.rglob("*"))


def minimal_form(path: Path) -> BadFile:
    return BadFile(
        f"{path}: nerfstudio's minimal form (.npz) holds pickled Python objects, which may run any "
        "program when they are opened; write transforms.json where it was made "
        "(docs/nerfstudio.md has the lines for it)"
    )


def has_poses(folder: Path) -> bool:
    """Whether a folder is one of those that `read_capture` knows."""
    names = (*TABLES, f"transforms_{SPLITS[0]}.json")
    tables = any((folder / name).is_file() for name in names)
    return tables or find_model(folder) is not None or is_scan(folder)


def poses_below(folder: Path) -> Path | None:
    """A folder in it that has poses, or a JSON file of frames under a name of its own."""
    if not folder.is_dir():
        return None
    inside = sorted(folder.iterdir())[:MOST_LOOKED_AT]
    for path in inside:
        if path.is_dir() and has_poses(path):
            return path
    for path in inside:
        if path.suffix.lower() == ".json" and path.is_file() and has_frames(path):
            return path
    return None


def has_frames(path: Path) -> bool:
    try:
        data = read_json(path, most_bytes=MOST_LOOKED_AT_BYTES)
    except BadFile:
        return False
    return isinstance(data, dict) and isinstance(data.get("frames"), list)


def how_to_pose(photos: Path) -> str:
    """What to do with a folder of photos: name the one above it, or find their poses."""
    above = photos.absolute().parent
    if has_poses(above):
        return f"the poses lie in the folder above, name that: {above}"
    if (below := poses_below(photos)) is not None:
        return f"the poses lie below, name that: {below}"
    if known := known_beside(photos):
        return known
    command = f"{program()} {shlex.join(['poses', str(photos), '--out', 'CAPTURE'])}"
    if blank := blank_beside(photos):
        return f"{blank}: export it again, or find the poses, `{command}`, and name that folder"
    return f"find them first, `{command}`, and name that folder then"


# A COLMAP folder (sparse/0 and images/, text or binary) -> Capture.


def read_colmap(folder: Path) -> Capture:
    """Sub-folders of images/ are modalities; capture.json may say more (docs/capture.md)."""
    if (found := find_model(folder)) is None:
        raise BadFile(f"{folder} holds no COLMAP model; images.bin or images.txt is wanted.")
    model, ending = found
    base = base_of(folder, model)
    folder = base if model == folder else folder
    root = photos_folder(base)
    lenses, images = read_tables(model, ending, root)
    posed, unpaired = with_twins(sorted(images, key=lambda image: image.name), root)
    table, said, known_masks = FileTable(folder), said_beside(folder), set[str]()
    if not said.get("modalities"):
        posed, known_masks = photos_alone(posed, root, table)
    names = [image.name for image in posed]
    paths = [find_file(root, name, ("",)).path for name in names]
    stops, modality_of = modalities(said, posed, paths, folder)
    cameras = [camera_pose(image, f"{folder}: {image.name}") for image in posed]
    world = CaptureWorld.of(np.array(cameras), COLMAP_UP, said, str(folder), COLMAP_UP)
    there = [os.path.isfile(path) for path in paths]
    missing = [str(path) for path, found in zip(paths, there, strict=True) if not found]
    refuse_all_missing(missing, len(posed), str(model))
    masks = masks_of(base, root, list(compress(paths, there)), table, known_masks)
    means = stated_meaning(Fields(said, f"{folder}/capture.json"))
    photos: list[Photo] = []
    rescaled: list[str] = []
    turned: list[str] = []
    splits = splits_of(names)
    rows = zip(posed, paths, cameras, modality_of, splits, strict=True)
    for image, path, world_from_camera, modality, split in compress(rows, there):
        lens = lenses[image.lens]
        matrix, where = world.turned(world_from_camera), f"{folder}: camera {image.lens}"
        made = posed_photos(path, modality, matrix, lens, where)
        mask = masks.get(path)
        if mask is not None:
            refuse_other_mask(mask, made[0].file_size)
        photos += [replace(p, mask=mask, mask_means=means, split=split or p.split) for p in made]
        if made[0].file_size != lens.size:
            (rescaled if fits(lens.size, made[0].file_size) else turned).append(str(path))
    points, colors, more = points_of(model, ending)
    table.used("points", 0 if points is None else len(points))
    if guessed := not said.get("modalities"):
        numbers = {path: str(image.lens) for path, image in zip(paths, posed, strict=True)}
        more += check_two_sorts(opened_photos(photos, root, numbers), stops, folder)
    photos = listed_split(photos, folder, root, table, by_folder=any(splits))
    photos = of_each_band(photos, sharing_folders(said.get("modalities") or (), str(folder)))
    photos = with_counts(photos, said.get("modalities"), f"{folder}/capture.json")
    background = background_from(said, f"{folder}/capture.json")
    photos, unsure = meant_by_masks(photos)
    doubts = doubts_of(len(posed), missing, photos, rescaled, turned=turned) + unsure + more
    doubts += unpaired + other_lengths(images) + refused_poses(model, ending, images)
    doubts += refused_text(model, ending, images)
    table.photos(photos, missing)
    table.partners("masks", photos)
    left_beside(base, model, ending, table)
    doubts += tuple(table.sentences)
    capture = world.capture(
        folder, stops, photos, points, colors, background, guessed, doubts=doubts
    )
    metres = capture.metres or length_of_poses(folder)
    return replace(capture, files=table.sorted_rows(), metres=metres)


def length_of_poses(folder: Path) -> str:
    """The length by which `poses` found the scale; "" where it was given none."""
    said = saved_object(folder / "poses.json", 1 << 20).get("scale")
    return said[:200] if isinstance(said, str) and not said.startswith("arbitrary") else ""


def modalities(
    said: dict, posed: list[Posed], paths: list[Path], folder: Path
) -> tuple[tuple[Stop, ...], list[str]]:
    """Stops, and of each image the name of its stop: from capture.json, or else from the names."""
    names = [image.name for image in posed]
    if not said.get("modalities"):
        return modalities_of(names, folder, is_grey=lambda row: has_grey_mode(paths[row]))
    where, entries = f"{folder}/capture.json", said["modalities"]
    stops = stops_from(entries, where)

    def cameras_of(row: int) -> set[str]:
        size = image_size(paths[row], None) if os.path.isfile(paths[row]) else (0, 0)
        return {str(posed[row].lens), "{}x{}".format(*size)}

    of = said_modality_of(entries, stops, names, where, cameras_of)
    return tuple(sorted(stops, key=lambda s: s.x)), of
