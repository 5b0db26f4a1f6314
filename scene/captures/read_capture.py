"""Any capture that we understand -> Capture, in our world: which reader a path is for."""

import shlex
from pathlib import Path

from shapeshift.runtime_models.files.json_fields import read_json
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.captures.colmap_tables import find_model
from shapeshift.scene.captures.foreign.read_foreign import (
    blank_beside,
    is_table_of_lenses,
    known_beside,
    read_foreign,
    refuse_known,
)
from shapeshift.scene.captures.read_colmap import read_colmap
from shapeshift.scene.captures.read_transforms import read_transforms
from shapeshift.scene.captures.scans.read_scan import capture_from, is_scan, read_scan
from shapeshift.scene.captures.scans.read_sitcoms3d import TABLE as SITCOMS3D
from shapeshift.scene.captures.scans.read_sitcoms3d import find_sitcoms3d

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
    command = shlex.join(["python3", "launch.py", "poses", str(photos), "--out", "CAPTURE"])
    if blank := blank_beside(photos):
        return f"{blank}: export it again, or find the poses, `{command}`, and name that folder"
    return f"find them first, `{command}`, and name that folder then"
