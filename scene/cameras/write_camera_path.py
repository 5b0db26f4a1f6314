"""nerfstudio's camera_path.json, in the world of the splats that nerfstudio exports."""

import math

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import CameraList, data_from_ours, is_centred
from shapeshift.scene.cameras.read_camera_path import FPS
from shapeshift.scene.pose import View

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
