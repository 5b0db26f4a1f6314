"""Reads files, each in a process of its own, and says what each took: one line of JSON for each.

    python bomb_run.py READER PATH [READER PATH ...]

The processes are forks of this one, in which everything is imported already: what they take beyond
it is for the file.
"""

import json
import os
import re
import resource
import sys
import time
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[3])]
LONGEST_S = 60  # of processor time


def read_photo(path: Path) -> object:
    from shapeshift.scene.captures.photo import read_pixels

    return read_pixels(path)


def read_trained(path: Path) -> object:
    """As training does: a.png beside `path`, its mask and its lens if there are such."""
    from shapeshift.scene.captures.capture import Photo
    from shapeshift.scene.captures.colmap_tables import ColmapCamera
    from shapeshift.scene.captures.photo import load_photo
    from shapeshift.scene.captures.undistort import pinhole_of
    from shapeshift.scene.pose import View

    image, mask = path.with_name("a.png"), path.with_name("mask.png")
    params, lens, size = json.loads(path.read_text()).get("fisheye"), None, (64, 64)
    if params:
        lens = ColmapCamera("OPENCV_FISHEYE", (2400, 2400), tuple(params))
        size = pinhole_of(lens).size
    view = View.from_pinhole(np.eye(4), (1.0, 1.0), (0.0, 0.0), size)
    return load_photo(Photo(view, image, "RGB", mask if mask.exists() else None, lens=lens), 2)


def read_depth(path: Path) -> object:
    from shapeshift.scene.captures.depth_photo import _pixels

    return _pixels(path, 0)


def readers() -> dict:
    """All of them, with what they import on the way."""
    import laspy
    import lazrs
    import onnx
    import PIL.Image
    import PIL.PngImagePlugin
    import PIL.WebPImagePlugin
    import pycolmap
    import scipy.spatial
    import trimesh
    import zstandard

    assert all((laspy, lazrs, onnx, pycolmap, PIL, scipy, trimesh, zstandard))
    from shapeshift.runtime_models.read_scene import read_model
    from shapeshift.scene.cameras.read_cameras import read_camera_list
    from shapeshift.scene.captures.point_clouds import read_points
    from shapeshift.scene.captures.read_capture import read_capture
    from shapeshift.scene.colliders.read_mesh import read_mesh
    from shapeshift.scene.document.read_scene_file import read_scene_file

    return {
        "model": read_model, "points": read_points, "capture": read_capture, "photo": read_photo,
        "trained": read_trained,
        "depth": read_depth, "mesh": read_mesh, "scene": read_scene_file,
        "cameras": read_camera_list,
    }  # fmt: skip


def resident() -> tuple[int, int]:
    """(now, most) bytes of this process in memory."""
    text = Path("/proc/self/status").read_text()
    kilobytes = dict(re.findall(r"(Vm\w+):\s+(\d+) kB", text))
    return int(kilobytes["VmRSS"]) << 10, int(kilobytes["VmHWM"]) << 10


def measured(read, path: Path) -> dict:
    """What came of it, in this process, which ends afterwards."""
    from shapeshift.runtime_models.model import BadFile

    resource.setrlimit(resource.RLIMIT_CPU, (LONGEST_S, LONGEST_S))
    Path("/proc/self/clear_refs").write_text("5")  # the most begins anew
    before, said, began = resident()[0], "", time.process_time()
    try:
        read(path)
    except BadFile as refusal:
        said = str(refusal)
    children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss << 10
    taken = max(resident()[1] - before, children)
    return {"refused": said, "bytes": taken, "seconds": time.process_time() - began}


def main(arguments: list[str]) -> None:
    known = readers()
    for reader, path in zip(arguments[::2], arguments[1::2], strict=True):
        taking, giving = os.pipe()
        if (child := os.fork()) == 0:
            try:
                line = json.dumps(measured(known[reader], Path(path)))
            except BaseException as error:
                line = json.dumps({"fault": repr(error)[:300]})
            os.write(giving, line.encode())
            os._exit(0)
        os.close(giving)
        with os.fdopen(taking, "rb") as pipe:
            line = pipe.read().decode()
        status = os.waitpid(child, 0)[1]
        print(line or json.dumps({"fault": f"ended with {status}"}), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
