"""transforms.json and cameras.json -> Capture: nerfstudio, Blender, our own form, OpenCV tables."""

import os
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, Inherited, shown
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.scene.capture_files import files_below, find_file, photo_key
from shapeshift.scene.capture_found import FileTable
from shapeshift.scene.capture_masks import meant_by_masks, refuse_other_mask, stated_meaning
from shapeshift.scene.capture_photos import (
    doubts_of,
    fits,
    posed_photos,
    refuse_all_missing,
)
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.capture_rules import (
    COLMAP_UP,
    CaptureWorld,
    background_from,
    rigid,
    split_every_8th,
    with_counts,
)
from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.depth_photo import NAMES as DEPTH_NAMES
from shapeshift.scene.captures.depth_photo import in_millimetres, refuse_other_units, with_depth
from shapeshift.scene.captures.lenses.frame_lens import lens_of
from shapeshift.scene.captures.lenses.panorama import is_panorama, stereo_sentences
from shapeshift.scene.captures.modalities.frame_modalities import (
    named_file,
    read_capture_json,
    said_beside,
    stops_of_frames,
)
from shapeshift.scene.captures.modalities.two_sorts import check_two_sorts, opened_photos
from shapeshift.scene.captures.normal_photo import NAMES as NORMAL_NAMES
from shapeshift.scene.captures.normal_photo import normals_of, refuse_other_axes
from shapeshift.scene.captures.point_clouds import read_points
from shapeshift.scene.captures.radiometric.stated_bands import (
    of_each_band,
    only_bands,
    sharing_folders,
    stated_bands,
)
from shapeshift.scene.mask_files import find_masks, is_grey_file
from shapeshift.scene.other_pictures import other_pictures
from shapeshift.scene.pose import OPENCV_FROM_EYE

POSES = ("transform_matrix", "c2w_opencv", "c2w")
SPLITS = {"train": "train", "test": "test", "val": "test"}
# nerfstudio's lists of the photos of a split; what is in none of them is not used.
LISTS = {"train_filenames": "train", "val_filenames": "test", "test_filenames": "test"}


@dataclass(frozen=True)
class Shot:
    """One photo as the file has it: its frame with what the file says for all frames."""

    entry: Mapping
    modality: str
    path: Path  # without an ending where there is no such file
    world_from_camera: np.ndarray  # (4, 4) OpenCV axes, the file's world
    where: str  # for messages
    folder: Path  # where the names of its photos begin
    elsewhere: bool = False  # not where the file says

    @property
    def names_depth(self) -> bool:
        return any(self.entry.get(key) for key in DEPTH_NAMES)

    @property
    def names_normals(self) -> bool:
        return any(self.entry.get(key) for key in NORMAL_NAMES)


def read_transforms(*files: Path) -> Capture:
    """A capture from one JSON file, or from the train/val/test files of a Blender data set."""
    table = FileTable(files[0].parent)
    return capture_of(files[0].parent, str(files[0]), *gather(files, table), table)


def capture_of(
    folder: Path,
    where: str,
    data: dict,
    entries: Sequence[Mapping],
    table: FileTable | None = None,
    alone: bool = True,
) -> Capture:
    """A capture out of what a file says for all frames, and of every frame with that filled in.

    where: of the file, for messages; table: what was left out so far; alone: files beside those
    that frames name are worth a word.  Raises BadFile.
    """
    table = table or FileTable(folder)
    entries = frames_of_photos(folder, data, entries, table)
    stops, usual, told = stops_of_frames(folder, data, entries, where)
    listed = data.get("modalities") or told
    rows, bands = enumerate(zip(entries, usual, strict=True)), stated_bands(listed, where)
    sharing = sharing_folders(told, where)
    named = [s for i, (e, of) in rows for s in shots_of(e, i, of, stops, folder, where, bands)]
    there = [os.path.isfile(shot.path) for shot in named]
    shots = list(compress(named, there))
    missing = [str(shot.path) for shot, found in zip(named, there, strict=True) if not found]
    refuse_all_missing(missing, len(named), where)
    refuse_without_images(stops, shots, only_bands(sharing), where)
    world = CaptureWorld.of(
        np.array([s.world_from_camera for s in shots]),
        (0, 0, 1),
        data,
        where,
        COLMAP_UP if opencv_axes(entries[0]) else None,
    )
    photos, doubts = photos_and_doubts(shots, entries, world, folder, missing, table)
    photos, unsure = meant_by_masks(photos)
    photos = with_counts(of_each_band(photos, sharing), listed, where)
    if not any("split" in e for e in entries):
        photos = split_every_8th(photos)
    points, colors, more = points_of(folder, data, where)
    table.used("points", 0 if points is None else len(points))
    if alone:
        unnamed_files(folder, photos, table)
    described = any(isinstance(m, dict) for m in listed)
    if not (told or data.get("modalities") or any("modality" in e for e in entries)):
        more += check_two_sorts(opened_photos(photos, folder), stops, folder)
    background, notes = background_from(data, where), Fields(data, where).optional_object("notes")
    capture = world.capture(
        folder,
        stops,
        photos,
        points,
        colors,
        background,
        not described,
        dict(notes.data) if notes else None,
        doubts + unsure + more + tuple(table.sentences),
    )
    capture = in_millimetres(replace(capture, files=table.sorted_rows()), entries)
    refuse_other_units(capture, where)
    refuse_other_axes(capture, where)
    return capture


def frames_of_photos(
    folder: Path, data: dict, entries: Sequence[Mapping], table: FileTable
) -> Sequence[Mapping]:
    """The frames without those whose picture shows depth, normals, masks or classes, where nobody
    says which stops there are.
    """
    if data.get("modalities") or any("modality" in entry for entry in entries):
        return entries
    names = [named_file(entry) for entry in entries]
    found = other_pictures(names, lambda row: is_grey_file(find_file(folder, names[row]).path))
    if not found or said_beside(folder).get("modalities"):
        return entries
    for kind in dict.fromkeys(found.values()):
        mine = [find_file(folder, names[row]).path for row in found if found[row] == kind]
        table.left_out(kind, mine, "they have frames as photos do; 'modality' makes a stop of them")
        table.accounted |= {photo_key(str(path)) for path in mine}
    return [entry for row, entry in enumerate(entries) if row not in found]


def photos_and_doubts(
    shots: Sequence[Shot],
    entries: Sequence[Mapping],
    world: CaptureWorld,
    folder: Path,
    missing: list[str],
    table: FileTable,
) -> tuple[list[Photo], tuple[str, ...]]:
    """missing: photos that are named and not there.  Raises BadFile."""
    lenses = [lens_of(shot.entry, shot.path, shot.where) for shot in shots]
    photos: list[Photo] = []
    gathered: list[list] = [[] for _ in range(5)]
    no_depth, no_normals, rescaled, turned, round_depth = gathered
    for shot, lens in zip(shots, lenses, strict=True):
        photos += (made := photos_of(shot, lens, world, folder))
        path = str(shot.path)
        if made[0].file_size != lens.size:
            (rescaled if fits(lens.size, made[0].file_size) else turned).append(path)
        if is_panorama(lens):
            round_depth += [path] if shot.names_depth or shot.names_normals else []
        else:
            no_depth += [path] if made[0].depth is None and shot.names_depth else []
            no_normals += [path] if made[0].normals is None and shot.names_normals else []
    table.photos(photos, missing)
    table.partners("masks", photos)
    table.partners("depth photos", photos, no_depth)
    table.partners("normal maps", photos, no_normals)
    table.left_out("depth photos and normal maps", round_depth, "their photos are panoramas")
    named = len(shots) + len(missing)
    doubts = doubts_of(named, missing, photos, rescaled, no_depth, no_normals, turned)
    return photos, doubts + stereo_sentences(lenses) + doubts_of_entries(shots, entries)


def unnamed_files(folder: Path, photos: Sequence[Photo], table: FileTable) -> None:
    """Says what lies beside the files that frames name, and which masks none names."""
    paths = {photo.path for photo in photos}
    others = {path for p in photos for path in (p.mask, p.depth, p.normals) if path is not None}
    named = {photo_key(str(path)) for path in paths | others} | table.accounted
    places = {path.parent for path in paths}
    masks = {photo.mask.parent for photo in photos if photo.mask is not None} - places
    if not any(photo.mask for photo in photos):
        root = Path(os.path.commonpath([path.parent for path in paths]))
        names = [path.relative_to(root).as_posix() for path in paths]
        listed = [
            (place / name).relative_to(root).as_posix()
            for place in sorted(places)
            for name in files_below(place, deep=False)
        ]
        base = folder if root != folder and root.is_relative_to(folder) else root.parent
        found = find_masks(base, root, names, listed)
        lying = [*found.of.values(), *found.spare]
        table.left_out("masks", lying, "no frame names one ('mask_path')")
        named |= {photo_key(str(path)) for path in lying}
    table.unnamed("photos", places, named)
    table.unnamed("masks", masks, named)
    for kind, key in (("depth photos", "depth"), ("normal maps", "normals")):
        lies = {path.parent for p in photos if (path := getattr(p, key)) is not None}
        table.unnamed(kind, lies - places - masks, named)


def points_of(
    folder: Path, data: dict, where: str
) -> tuple[np.ndarray | None, np.ndarray | None, tuple[str, ...]]:
    """Points and colours in the file's world, as far as there are some, and what is doubtful."""
    fields = Fields(data, where)
    name = fields.text("points", "")
    if not name and (name := fields.text("ply_file_path", "")):
        path = find_file(folder, name, ("",)).path
        if not os.path.isfile(path):
            return None, None, (f"The points {path_end(path)} are not there.",)
        return *read_points(path), ()
    if name or (folder / "points3d.npz").is_file():
        return *read_points(folder / (name or "points3d.npz")), ()
    return None, None, ()


def doubts_of_entries(shots: Sequence[Shot], entries: Sequence[Mapping]) -> tuple[str, ...]:
    """What a person should know of the frames, a sentence each."""
    said, moved = [], [shot for shot in shots if shot.elsewhere]
    if moved:
        first = moved[0]
        said.append(
            f"{len(moved)} photos are not where the capture says; they are taken from below its "
            f"folder, for example {path_end(first.path.relative_to(first.folder))}."
        )
    times = {time for entry in entries if isinstance(time := entry.get("time"), int | float)}
    if len(times) > 1:
        said.append(
            "Its frames have different times; they are taken as one still scene, and what moves "
            "will be a smear."
        )
    return tuple(said)


def gather(files: tuple[Path, ...], table: FileTable | None = None) -> tuple[dict, list[Mapping]]:
    """What the files say for all frames, and every frame with that filled in.

    table: gets what their lists leave out.
    """
    table = table or FileTable(files[0].parent)
    everything: dict = {}
    entries: list[Mapping] = []
    for file in files:
        data = read_capture_json(file)
        frames = data.pop("frames", None)
        frames = with_test_frames(frames, data.pop("test_frames", None))
        if not isinstance(frames, list) or not all(isinstance(f, dict) for f in frames):
            raise BadFile(f"{file}: no list 'frames'; this file holds no posed photos")
        if not frames:
            raise BadFile(f"{file}: 'frames' is empty; a capture needs at least one photo")
        held = [{"split": file.stem.rpartition("_")[2]}, data] if len(files) > 1 else [data]
        # One after the other, not one of them: each frame would hold all that is said for all.
        entries += [Inherited(frame, *held) for frame in listed(frames, data, file, table)]
        everything |= data
    return everything, entries


def with_test_frames(frames: object, tests: object) -> object:
    """The frames of ScanNet++, which has those that are held out in a list of their own."""
    if not (isinstance(frames, list) and isinstance(tests, list) and tests):
        return frames
    if not all(isinstance(frame, dict) for frame in (*frames, *tests)):
        return None
    return [f | {"split": "train"} for f in frames] + [f | {"split": "test"} for f in tests]


def listed(frames: list[dict], data: dict, file: Path, table: FileTable) -> list[dict]:
    """The frames with the splits of nerfstudio's lists of them; all as they are without such."""
    splits: dict[str, tuple[str, str]] = {}  # by photo_key: the name as it is listed, split
    for key, split in LISTS.items():
        if data.get(key):
            names = Fields(data, str(file)).texts(key)
            splits |= {photo_key(name): (name, split) for name in names}
    if not splits:
        return frames
    names = [name if isinstance(name := f.get("file_path"), str) else "" for f in frames]
    keys = [photo_key(name) for name in names]
    used = [f | {"split": splits[k][1]} for f, k in zip(frames, keys, strict=True) if k in splits]
    if not used:
        raise BadFile(f"{file}: its lists of training and test photos name none of its frames")
    left = [name for name, key in zip(names, keys, strict=True) if key not in splits]
    table.left_out("photos", left, f"they are in none of its lists ({', '.join(LISTS)})")
    table.accounted |= {photo_key(str(find_file(file.parent, name).path)) for name in left}
    lost = [name for key, (name, _) in splits.items() if key not in set(keys)]
    table.left_out("names in its lists", lost, "no frame has them", there=False)
    return used


def refuse_without_images(
    stops: tuple[Stop, ...], shots: Sequence[Shot], bands: Container[str], where: str
) -> None:
    """Raises BadFile for a modality without one.  bands: those whose photos are of another."""
    there = {shot.modality for shot in shots}
    for stop in stops:
        if not (stop.formula or stop.name in bands or stop.name in there):
            raise BadFile(
                f"{where}: modality {shown(stop.name)} has no images; add frames or drop it"
            )


def shots_of(
    entry: Mapping,
    number: int,
    usual: str,
    stops: tuple[Stop, ...],
    folder: Path,
    where: str,
    bands: Container[str] = (),
) -> list[Shot]:
    """The photos of one frame: one, or one a modality where neither the frame names one of several
    nor `usual`, what is known of it otherwise.  bands: modalities that are bands of its own file.
    """
    where = f"{where}: frame {number}"
    fields = Fields(entry, where)
    file = fields.text("file_path", "") or fields.text("file", "")
    if not file:
        raise BadFile(f"{where} names no image; give it a 'file_path'")
    where = fields.where = f"{where} ({path_end(file)})"
    key = next((k for k in POSES if k in entry), None)
    if key is None:
        raise BadFile(f"{where} has no pose; run COLMAP first, or give it a 'transform_matrix'")
    matrix = rigid(entry[key], where, may_mirror=True)
    if not opencv_axes(entry):
        matrix = matrix @ OPENCV_FROM_EYE
    names = [s.name for s in stops if not s.formula]
    if "modality" in entry or usual or len(names) == 1:
        modality = fields.text("modality", usual or names[0])
        if modality not in names:
            raise BadFile(
                f"{where} is of modality {shown(modality)}; the file lists {shown(names)}"
            )
        path, elsewhere = find_file(folder, file)
        return [Shot(entry, modality, path, matrix, where, folder, elsewhere)]
    shots = []
    for name in names:
        place = folder if name in bands else folder / name
        path, elsewhere = find_file(place, file)
        shots.append(Shot(entry, name, path, matrix, where, place, elsewhere))
    return shots


def opencv_axes(entry: Mapping) -> bool:
    """Whether poses have x right, y down, z forward; without a word on it they are OpenGL's."""
    if "transform_matrix" in entry:
        return "opencv" in str(entry.get("convention", "")).lower()
    return "opengl" not in str(entry.get("convention", "")).lower()


def photos_of(shot: Shot, lens: ColmapCamera, world: CaptureWorld, folder: Path) -> list[Photo]:
    """The photo of a shot; of a panorama the straight ones that it is cut into."""
    entry, where = shot.entry, shot.where
    fields = Fields(entry, where)
    split = fields.text("split", "train")
    if split not in SPLITS:
        raise BadFile(f"{where} has split {shown(split)}; use train or test")
    pose = world.turned(shot.world_from_camera)
    photos = posed_photos(shot.path, shot.modality, pose, lens, where)
    mask, name = None, fields.text("mask_path", "") or fields.text("mask", "")
    if name:
        mask = find_file(folder, name).path
        if not os.path.isfile(mask):
            raise BadFile(f"{where}: the mask {path_end(mask)} is missing; put it there")
        refuse_other_mask(mask, photos[0].file_size)
    means = stated_meaning(fields)
    photos = [replace(p, mask=mask, mask_means=means, split=SPLITS[split]) for p in photos]
    if is_panorama(lens):  # whose depth is measured along rays, not along a view
        return photos
    photo = with_depth(photos[0], entry, shot.folder, where)
    normals, axes = normals_of(entry, shot.folder, photo.file_size, where)
    return [replace(photo, normals=normals, normal_axes=axes)]
