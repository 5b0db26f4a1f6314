"""Any capture that we understand -> Capture, in our world: which reader a path is for."""

from pathlib import Path

from runtime_models.model import BadFile
from scene.capture import Capture
from scene.colmap_tables import find_model
from scene.read_colmap import read_colmap
from scene.read_transforms import read_transforms

TABLES = ("transforms.json", "transforms_multimodal.json", "cameras.json")
PICTURES = {".png", ".jpg", ".jpeg"}


def read_capture(path: Path) -> Capture:
    """Reads a folder, or one of its JSON files.  Raises BadFile in one sentence.

    Folders: COLMAP's (sparse/0 and images/), or with transforms.json, transforms_multimodal.json,
    cameras.json, or transforms_train.json and transforms_test.json (docs/capture.md).
    """
    path = Path(path)
    if path.is_file() and path.suffix.lower() == ".json":
        return read_transforms(path)
    if not path.is_dir():
        found = "is no capture" if path.exists() else "does not exist"
        raise BadFile(f"{path}: {found}; give a folder of posed photos or its transforms.json")
    for name in TABLES:
        if (path / name).is_file():
            return read_transforms(path / name)
    splits = [path / f"transforms_{s}.json" for s in ("train", "val", "test")]
    if splits[0].is_file():
        return read_transforms(*(s for s in splits if s.is_file()))
    if find_model(path) is not None:
        return read_colmap(path)
    if any(p.suffix.lower() in PICTURES for p in path.rglob("*")):
        raise BadFile(
            f"{path}: photos without poses; run structure from motion first, for example "
            f"colmap automatic_reconstructor --workspace_path {path} --image_path {path}/images"
        )
    raise BadFile(f"{path}: neither photos nor poses in this folder; see docs/capture.md")
