"""A scan or a data set in a form of its own -> Capture: which reader a folder is for."""

from dataclasses import replace
from pathlib import Path

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture
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
    capture = capture_of(posed.folder, posed.where, said, posed.frames, alone=posed.alone)
    return replace(capture, doubts=capture.doubts + posed.doubts)
