"""What readers of scans and data sets hand on: frames in the words of transforms.json."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.memory import read_text_file
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.pose import OPENCV_FROM_EYE

MOST_BYTES = 1 << 20  # of a table of one camera


@dataclass(frozen=True)
class PosedFrames:
    """The frames of a folder; see docs/capture.md for their keys."""

    folder: Path  # below which their files lie
    where: str  # the file or folder that has the poses, for messages
    frames: list[dict]
    doubts: tuple[str, ...] = ()  # what a person should know, a sentence each
    left: Mapping[str, Sequence[str]] = field(default_factory=dict)  # why -> photos; doubts say it
    alone: bool = True  # no other captures have photos in the same folders
    points: np.ndarray | None = None  # (P, 3) float64, the file's world
    colors: np.ndarray | None = None  # (P, 3) 0..1
    program: str = ""  # whose file it is, where not a data set's


def table_of(path: Path, *shapes: tuple[int, ...]) -> np.ndarray:
    """The numbers of a text file, in the first of `shapes` that they fill; -Inf and NaN may be
    among them, as ScanNet marks what has no pose.  Raises BadFile.
    """
    if not path.is_file():
        raise BadFile(f"{path} is missing; copy the whole folder")
    if path.stat().st_size > MOST_BYTES:
        raise BadFile(f"{path} has {path.stat().st_size:,} bytes, too many for one camera")
    try:
        values = np.array([float(word) for word in read_text_file(path).split()])
    except ValueError:
        raise BadFile(f"{path}: what should be numbers is not; copy it again") from None
    for shape in shapes:
        if values.size == np.prod(shape):
            return values.reshape(shape)
    wanted = " or ".join(str(np.prod(shape)) for shape in shapes)
    raise BadFile(f"{path} holds {values.size} numbers; {wanted} are wanted")


def opengl_pose(world_from_camera: np.ndarray) -> list:
    """The 'transform_matrix' of a pose (4, 4) with OpenCV axes."""
    return (world_from_camera @ OPENCV_FROM_EYE).tolist()


def photos_in(folder: Path) -> list[Path]:
    """Pictures of a folder, by number where their names are numbers, else by name."""
    found = [p for p in folder.iterdir() if p.suffix.lower() in {".jpg", ".jpeg", ".png"}]
    return sorted(found, key=lambda p: (int(p.stem) if p.stem.isdecimal() else -1, p.name))
