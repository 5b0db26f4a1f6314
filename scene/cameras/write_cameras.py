"""Views into a file of cameras, in any of the forms that are read."""

import json
from collections.abc import Callable
from pathlib import Path

from shapeshift.runtime_models.files.whole_file import make_folders, write_whole
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import CameraList
from shapeshift.scene.cameras.write_camera_path import camera_path
from shapeshift.scene.cameras.write_colmap_cameras import stale_tables, write_colmap_cameras
from shapeshift.scene.cameras.write_floor import floor
from shapeshift.scene.cameras.write_inria_cameras import inria_rows
from shapeshift.scene.cameras.write_own_cameras import own_rows
from shapeshift.scene.cameras.write_transforms_cameras import transforms
from shapeshift.scene.captures.colmap_tables import TABLES

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
