"""Scaniverse's raw data (scan.pb, frames.pb) as descaniverse writes it as JSON: 'scan' and 'frames'
with a focal length, a principal point, a quaternion xyzw and a place each.
"""

import math
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.foreign.foreign_frames import (
    Gathered,
    PhotoIndex,
    checked_lens,
    checked_size,
    world_from,
)
from shapeshift.scene.captures.scans.posed_frames import PosedFrames

MOST_BYTES = 1 << 30
LARGE, SMALL = "imgl", "img"  # folders of photos; the numbers of the lens are of small ones


def scaniverse_frames(path: Path, photos: PhotoIndex) -> PosedFrames:
    """World from camera, OpenCV axes; the large photos where there are such.  Raises BadFile."""
    from scipy.spatial.transform import Rotation

    said = Fields(read_json(path, most_bytes=MOST_BYTES), str(path))
    sizes = said.object("scan").object("configuration")
    small, large = (size_of(sizes, key) for key in ("smallImageSize", "largeImageSize"))
    rows = said.object("frames").rows("frames", 1 << 24, "frame", 0)
    any_large = any(row.value("isLargeImage", False) is True for row in rows)
    size, folder = (large, LARGE) if any_large else (small, SMALL)
    scale = size[0] / small[0]
    out = Gathered(path, "Scaniverse", photos)
    for row in rows:
        if any_large and row.value("isLargeImage", False) is not True:
            continue
        name = f"{folder}/{int(row.number('id', 0.0)):05d}.jpg"
        camera, place = row.object("camera"), row.object("transform")
        xyzw = place.numbers("rotation", 4)
        if not math.hypot(*xyzw) > 0.5:
            raise BadFile(f"{row.where}: its quaternion has no direction; write it again")
        turn = Rotation.from_quat(xyzw).as_matrix()
        pose = world_from(turn.T, np.array(place.numbers("translation", 3)))
        f, *centre = (scale * camera.number(key) for key in ("f", "px", "py"))
        out.add(name, pose, checked_lens("PINHOLE", size, (f, f, *centre), row.where))
    return out.finished()


def size_of(said: Fields, key: str) -> tuple[int, int]:
    size = said.object(key)
    return checked_size(size.value("width"), size.value("height"), size.where)
