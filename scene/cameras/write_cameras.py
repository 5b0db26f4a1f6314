"""Views into a file of cameras, in any of the forms that are read."""

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.whole_file import make_folders, write_whole
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import CameraList, data_from_ours, is_centred
from shapeshift.scene.cameras.camera_path import FPS
from shapeshift.scene.cameras.colmap_cameras import stale_tables, write_colmap_cameras
from shapeshift.scene.cameras.own_cameras import own_rows
from shapeshift.scene.cameras.read_floor import EYE_HEIGHT
from shapeshift.scene.captures.capture_rules import COLMAP_UP
from shapeshift.scene.captures.colmap_tables import TABLES
from shapeshift.scene.pose import View

# nerfstudio's camera_path.json, in the world of the splats that nerfstudio exports.

SAME = 1e-9  # relative: by which the two sides of a pixel may differ


def camera_path(cameras: CameraList) -> dict:
    """The file: each view a frame and a keyframe.  Raises BadFile for what the form cannot say."""
    size = cameras.views[0].size
    rows, turn = [], data_from_ours()
    for i, view in enumerate(cameras.views):
        check_plain(view, size, f"camera {i}")
        matrix = (turn @ view.world_from_eye.matrix()).ravel().tolist()
        fov = math.degrees(2 * math.atan(view.tangents[3]))
        rows.append((matrix, {"fov": fov, "aspect": size[0] / size[1]}))
    fps = cameras.fps or FPS
    return {
        "default_fov": rows[0][1]["fov"],
        "keyframes": [{"matrix": matrix} | lens for matrix, lens in rows],
        "camera_type": "perspective",
        "render_width": int(size[0]),
        "render_height": int(size[1]),
        "fps": fps,
        "seconds": len(rows) / fps,
        "is_cycle": False,
        "smoothness_value": 0.0,
        "camera_path": [{"camera_to_world": matrix} | lens for matrix, lens in rows],
    }


def check_plain(view: View, size: tuple[int, int], which: str) -> None:
    """The form knows one size, lines of sight in the middle, and square pixels."""
    other = "--to transforms, colmap-bin or ours can"
    left, right, low, high = view.tangents
    if view.size != size:
        raise BadFile(
            f"{which} has {view.size[0]}x{view.size[1]} pixels, the first {size[0]}x{size[1]}; a "
            f"camera path cannot say that, {other}."
        )
    if not is_centred(view):
        raise BadFile(f"{which} looks past its picture's middle, a camera path cannot; {other}.")
    if abs((right - left) * size[1] - (high - low) * size[0]) > SAME * (right - left) * size[1]:
        raise BadFile(f"{which} has pixels that are not square, a camera path cannot; {other}.")


# transforms.json in nerfstudio's form, in the world of 3DGS's splats: its "up" says -Y.


def transforms(cameras: CameraList) -> dict:
    """The file; every frame has its own lens and size, and OpenGL axes of the camera."""
    frames, turn = [], data_from_ours()
    for i, (view, name) in enumerate(zip(cameras.views, cameras.names, strict=True)):
        _, fx, fy, cx, cy = view.pinhole()
        frames.append(
            {
                "file_path": name or f"images/{i:05d}.png",
                "transform_matrix": (turn @ view.world_from_eye.matrix()).tolist(),
                "w": int(view.size[0]),
                "h": int(view.size[1]),
                "fl_x": float(fx),
                "fl_y": float(fy),
                "cx": float(cx),
                "cy": float(cy),
            }
        )
    return {
        "camera_model": "OPENCV",
        "convention": "opengl",
        "up": [float(c) for c in COLMAP_UP],
        "frames": frames,
    }


# cameras.json in the form of 3DGS, in the world of its splats.


def inria_rows(cameras: CameraList) -> list[dict]:
    """One row a view; "cx" and "cy", which 3DGS does not know, only where they are off centre."""
    rows, turn = [], data_from_ours()
    for i, (view, name) in enumerate(zip(cameras.views, cameras.names, strict=True)):
        camera_from_ours, fx, fy, cx, cy = view.pinhole()
        world_from_camera = turn @ np.linalg.inv(camera_from_ours)
        row = {
            "id": i,
            "img_name": name or f"{i:05d}",
            "width": int(view.size[0]),
            "height": int(view.size[1]),
            "position": world_from_camera[:3, 3].tolist(),
            "rotation": world_from_camera[:3, :3].tolist(),
            "fy": float(fy),
            "fx": float(fx),
        }
        rows.append(row if is_centred(view) else row | {"cx": float(cx), "cy": float(cy)})
    return rows


# splatapult's NAME_vr.json from a view: the floor lies an eye's height below it.

LEAST_LEVEL = 1e-3  # length of the level part of a line of sight that still has a heading


def floor(view: View) -> dict:
    """The file: level, facing where the view faces.  Raises BadFile for one straight up or down."""
    eye = view.world_from_eye
    back = eye.matrix()[:3, 2] * (1.0, 0.0, 1.0)
    length = float(np.linalg.norm(back))
    if not length > LEAST_LEVEL:
        raise BadFile("the view looks straight up or down, a floor needs a heading; turn it first.")
    up = np.array([0.0, 1.0, 0.0])
    ours_from_floor = np.eye(4)
    ours_from_floor[:3, 0] = np.cross(up, back / length)
    ours_from_floor[:3, 1], ours_from_floor[:3, 2] = up, back / length
    ours_from_floor[:3, 3] = eye.position - EYE_HEIGHT * up
    return {"floorMat": (data_from_ours() @ ours_from_floor).tolist()}


JSON_FORMS: dict[str, Callable[[CameraList], object]] = {
    "ours": own_rows,
    "inria": inria_rows,
    "transforms": transforms,
    "nerfstudio": camera_path,
    "vr": lambda cameras: floor(cameras.views[0]),
}
COLMAP_FORMS = {"colmap-bin": ".bin", "colmap-txt": ".txt"}
SPARSE = Path("sparse/0")  # where COLMAP and those who read it look
FORMS = (*COLMAP_FORMS, *JSON_FORMS)


def paths_of(path: Path, form: str) -> list[Path]:
    """The files that writing in `form` to `path` makes; COLMAP's lie in sparse/0 of a folder."""
    if form in COLMAP_FORMS:
        return [path / SPARSE / (table + COLMAP_FORMS[form]) for table in TABLES]
    return [path]


def stale_paths(path: Path, form: str) -> list[Path]:
    """Files there that writing in `form` to `path` removes, as they would contradict it."""
    return stale_tables(path / SPARSE, COLMAP_FORMS[form]) if form in COLMAP_FORMS else []


def write_cameras(cameras: CameraList, path: Path, form: str) -> list[Path]:
    """Writes the views; returns what was written, missing folders with it.  Raises BadFile.

    All forms but ours are written in the world of 3DGS's files, so that they fit the splats that
    another program opens.
    """
    if not cameras.views:
        raise BadFile("there is no camera to be written.")
    if form in COLMAP_FORMS:
        return write_colmap_cameras(cameras, make_folders(path, SPARSE), COLMAP_FORMS[form])
    data = JSON_FORMS[form](cameras)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, (json.dumps(data, indent=1, ensure_ascii=False) + "\n").encode())
    return [path]
