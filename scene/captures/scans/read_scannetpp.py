"""ScanNet++: dslr/nerfstudio/transforms.json, whose photos lie in dslr/resized_images."""

from pathlib import Path

from shapeshift.runtime_models.files.json_fields import read_json
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.scans.posed_frames import PosedFrames

TABLE = "nerfstudio/transforms.json"
MOST_BYTES = 1 << 28
# Where frames differ from what all have in common; the rest of a file's words are its own business.
COMMON = ("fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "k2", "k3", "k4", "p1", "p2", "camera_model")
MASKED = "Its masks, of what was made unrecognisable, are not used."


def find_scannetpp(folder: Path) -> Path | None:
    """The table of poses."""
    for place in (folder, folder / "dslr"):
        if (place / TABLE).is_file() and (place / "resized_images").is_dir():
            return place / TABLE
    return None


def scannetpp_frames(path: Path) -> PosedFrames:
    """Frames to train on, and test_frames.  Raises BadFile."""
    data = read_json(path, most_bytes=MOST_BYTES)
    if not isinstance(data, dict):
        raise BadFile(f"{path}: no object with 'frames'")
    common = {key: data[key] for key in COMMON if key in data}
    frames, masked = [], False
    for key, split in (("frames", "train"), ("test_frames", "test")):
        for frame in data.get(key) or ():
            if not (isinstance(frame, dict) and isinstance(frame.get("file_path"), str)):
                raise BadFile(f"{path}: one of its '{key}' names no photo")
            masked |= "mask_path" in frame
            own = {name: value for name, value in frame.items() if name != "mask_path"}
            own["file_path"] = f"resized_images/{frame['file_path']}"
            frames.append(common | own | {"split": split})
    return PosedFrames(path.parents[1], str(path), frames, (MASKED,) if masked else ())
