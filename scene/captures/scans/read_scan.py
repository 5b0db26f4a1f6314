"""A scan or a data set in a form of its own -> Capture: which reader a folder is for."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.capture_files import find_file, photo_key
from shapeshift.scene.capture_found import FileTable
from shapeshift.scene.captures.capture import LEFT_HANDED, Capture, FoundFiles
from shapeshift.scene.captures.capture_rules import turn_of_world
from shapeshift.scene.captures.read_transforms import capture_of
from shapeshift.scene.captures.scans.posed_frames import PosedFrames
from shapeshift.scene.captures.scans.read_arkitscenes import arkitscenes_frames, find_arkitscenes
from shapeshift.scene.captures.scans.read_nerfies import find_nerfies, nerfies_frames
from shapeshift.scene.captures.scans.read_nuscenes import find_nuscenes, nuscenes_frames
from shapeshift.scene.captures.scans.read_polycam import find_polycam, polycam_frames
from shapeshift.scene.captures.scans.read_posed_folders import (
    find_posed_splits,
    find_scannet,
    posed_split_frames,
    scannet_frames,
)
from shapeshift.scene.captures.scans.read_record3d import find_record3d, record3d_frames
from shapeshift.scene.captures.scans.read_scanner_app import (
    find_scanner_app,
    scanner_app_frames,
)
from shapeshift.scene.captures.scans.read_scannetpp import find_scannetpp, scannetpp_frames
from shapeshift.scene.captures.scans.read_sdfstudio import find_sdfstudio, sdfstudio_frames
from shapeshift.scene.captures.scans.read_sitcoms3d import find_sitcoms3d, sitcoms3d_frames

READERS = (
    (find_polycam, polycam_frames),
    (find_nerfies, nerfies_frames),  # has a metadata.json, too
    (find_record3d, record3d_frames),
    (find_scannet, scannet_frames),
    (find_arkitscenes, arkitscenes_frames),
    (find_scannetpp, scannetpp_frames),
    (find_sdfstudio, sdfstudio_frames),
    (find_posed_splits, posed_split_frames),
    (find_nuscenes, nuscenes_frames),
    (find_sitcoms3d, sitcoms3d_frames),
    (find_scanner_app, scanner_app_frames),
)


def read_scan(folder: Path) -> Capture | None:
    """The capture, or None where the folder has none of these forms.  Raises BadFile."""
    for find, frames_of in READERS:
        if (found := find(folder)) is not None:
            return capture_from(frames_of(found))
    return None


def is_scan(folder: Path) -> bool:
    return any(find(folder) is not None for find, _ in READERS)


def capture_from(posed: PosedFrames) -> Capture:
    if not posed.frames:
        raise BadFile(f"{posed.where}: no photo has a pose here; copy the whole folder")
    first = posed.frames[0]
    said = {key: first[key] for key in ("up", "ply_file_path") if key in first}
    table = FileTable(posed.folder)
    for why, names in posed.left.items():
        paths = [find_file(posed.folder, name).path for name in names]
        table.left_out("photos", paths, f"they {why}", said=True)
        table.accounted |= {photo_key(str(path)) for path in paths}
    capture = capture_of(posed.folder, posed.where, said, posed.frames, table, posed.alone)
    if posed.points is not None and capture.points is None:
        capture = with_points(capture, posed)
    return replace(capture, doubts=capture.doubts + posed.doubts)


def with_points(capture: Capture, posed: PosedFrames) -> Capture:
    """The capture with points of the file's world, turned as its cameras were."""
    points, colors = np.asarray(posed.points), posed.colors
    good = np.isfinite(points).all(axis=1)
    if not good.any():
        return capture
    up, mirrored = capture.notes["up_in_file"], capture.notes.get(LEFT_HANDED, False)
    turn = turn_of_world(up, mirrored, posed.where)[:3, :3]
    ours = (points[good] @ turn.T - np.array(capture.origin)).astype(np.float32)
    if colors is not None:
        colors = np.clip(colors[good], 0, 1).astype(np.float32)
    files = (*capture.files, FoundFiles("points", len(ours), len(ours), 0))
    return replace(capture, points=ours, point_colors=colors, files=files)
