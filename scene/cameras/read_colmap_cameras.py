"""A COLMAP model for its cameras alone, text or binary; neither photos nor points are needed."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import (
    CameraList,
    CameraReading,
    ours_from_world,
    pinhole_view,
    read_name,
)
from shapeshift.scene.captures.colmap.rig_frames import refused_poses, refused_text
from shapeshift.scene.captures.colmap_tables import ColmapCamera, Posed, read_tables
from shapeshift.scene.pose import View

UNIT = 1e-2  # by which a quaternion's length differs from 1 in rounded text files, at most


def read_colmap_cameras(folder: Path, ending: str, reading: CameraReading) -> CameraList:
    """The views of all images in their numbers' order, turned as 3DGS's splats are; BadFile."""
    lenses, posed = read_tables(folder, ending)
    turn = ours_from_world(reading)
    views = []
    for image in posed:
        view = view_of(
            image, lenses[image.lens], turn, f"{folder / f'images{ending}'}: {image.name}"
        )
        views.append(view.resized(reading.size) if reading.size else view)
    notes = other_lengths(posed) + refused_poses(folder, ending, posed)
    notes += refused_text(folder, ending, posed)
    if any(lenses[image.lens].bends for image in posed):
        notes += (
            f"{folder}: the lenses' distortion is left out; the views are those of pinholes.",
        )
    kind = "binary" if ending == ".bin" else "text"
    return CameraList(
        tuple(views), tuple(read_name(i.name) for i in posed), f"COLMAP {kind}", notes
    )


def view_of(image: Posed, lens: ColmapCamera, turn: np.ndarray, where: str) -> View:
    world_from_camera = turn @ camera_pose(image, where)
    return pinhole_view(world_from_camera, lens.focal, lens.centre, lens.size, where)


def camera_pose(image: Posed, where: str) -> np.ndarray:
    """(4, 4) camera to world, OpenCV axes, COLMAP's world.  Raises BadFile."""
    if not (0 < image.length < math.inf and np.isfinite(image.place).all()):
        raise BadFile(f"{where}: its pose is no rotation and place; run the mapper again.")
    return np.linalg.inv(image.camera_from_world())


def other_lengths(posed: Sequence[Posed]) -> tuple[str, ...]:
    """A sentence where quaternions have other lengths than 1: other programs may read such poses
    otherwise."""
    other = [image for image in posed if not abs(image.length - 1) <= UNIT]
    if not other:
        return ()
    return (
        f"{len(other)} of {len(posed)} quaternions have another length than 1, for example "
        f"{other[0].length:.3g} of {path_end(other[0].name)}; they are divided by it.",
    )
