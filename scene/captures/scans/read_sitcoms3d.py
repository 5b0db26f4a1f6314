"""sitcoms3D: cameras.json with image_name, intrinsics and camtoworld a frame, and images_4/."""

from pathlib import Path

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.scans.posed_frames import PosedFrames
from shapeshift.scene.captures.scans.read_sdfstudio import matrix_of

TABLE, UP = "cameras.json", (0, 1, 0)
MOST_BYTES = 1 << 28
PEOPLE = "Its masks of people (segmentations/) are not used: who moves will be a smear."


def find_sitcoms3d(folder: Path) -> Path | None:
    """The table of poses."""
    path = folder / TABLE
    try:
        data = read_json(path, most_bytes=MOST_BYTES) if path.is_file() else None
    except BadFile:  # whoever reads it as another form says what is wrong
        return None
    frames = data.get("frames") if isinstance(data, dict) else None
    first = frames[0] if isinstance(frames, list) and frames else None
    needed = {"image_name", "camtoworld", "intrinsics"}
    return path if isinstance(first, dict) and needed <= first.keys() else None


def sitcoms3d_frames(path: Path) -> PosedFrames:
    """camtoworld with OpenGL axes; the lens is of the whole photos, whose middle it has.

    Raises BadFile.
    """
    said = Fields(read_json(path, most_bytes=MOST_BYTES), str(path))
    frames = []
    for row in said.rows("frames", 1 << 20, "frame", 0):
        k = matrix_of(row, "intrinsics", ((3, 3), (4, 4), (3, 4)))
        pose = matrix_of(row, "camtoworld", ((4, 4), (3, 4)))
        frame = {
            "file_path": f"images/{row.text('image_name')}",
            "transform_matrix": [*pose[:3].tolist(), [0, 0, 0, 1]], "up": UP,
            "w": round(2 * k[0, 2]), "h": round(2 * k[1, 2]),
            "fl_x": k[0, 0], "fl_y": k[1, 1], "cx": k[0, 2], "cy": k[1, 2],
        }  # fmt: skip
        frames.append(frame)
    masks = any(path.parent.glob("segmentations*"))
    return PosedFrames(path.parent, str(path), frames, (PEOPLE,) if masks else ())
