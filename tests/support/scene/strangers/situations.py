"""Captures as other people's tools leave them: a list of situations, and what the program says.

Every module of this folder with a list SITUATIONS takes part: the test of all situations
(tests/scene/captures/test_strange_captures.py), and docs/bench/strange_captures.csv, which
`python3 tools/scene/strange_captures.py` writes.

To add a row: in a module of this folder, a function that writes the smallest valid input into an
empty folder and returns the path that a person would give, and a line in its list SITUATIONS:

    Situation("rig folders", "COLMAP's rig1/CAMERA/", rig_folders, "rgb 4, thermal 4")

The last text is what `look` has to say of that path, word for word; without a `look` of your own it
is what read_capture finds: the stops with how many photos each has, or "refused: " and the sentence
up to its first ";".  Then run the program, and commit its rows with it.  Photos of a few pixels
are enough (`picture`), and nothing may be read that is not made on the spot.
"""

import importlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.pose import OPENCV_FROM_EYE
from tests.support.scene.captures import opencv_pose, write_transforms

HERE = Path(__file__).parent
FOCAL = 1.2  # times the width
DTYPES = {"L": np.uint8, "I;16": np.uint16, "F": np.float32, "RGB": np.uint8}


@dataclass(frozen=True)
class Shot:
    """One photo of a capture that is written."""

    name: str  # as the capture has it, either slash
    mode: str = "RGB"  # as PIL names its pixels
    size: tuple[int, int] = (16, 12)
    camera: int = 1  # of the COLMAP model
    keys: tuple = ()  # more of its frame in transforms.json: pairs


def found_in(path: Path) -> str:
    """What read_capture finds: stops in their order with their photos, or the refusal."""
    try:
        capture = read_capture(path)
    except BadFile as error:
        return f"refused: {short(str(error), path)}"
    photos = {stop.name: {p.path for p in capture.photos if p.modality == stop.name}
              for stop in capture.stops}  # fmt: skip
    return ", ".join(f"{name} {len(mine)}" for name, mine in photos.items())


def short(sentence: str, path: Path) -> str:
    """A refusal without the folder that it is about, up to its advice."""
    folder = path if path.is_dir() else path.parent
    return sentence.replace(f"{folder}/", "").replace(f"{folder}: ", "").split(";")[0]


@dataclass(frozen=True)
class Situation:
    name: str
    met: str  # what people meet, a clause
    make: Callable[[Path], Path]  # writes it below the folder; what to open
    expected: str
    look: Callable[[Path], str] = found_in


def situations() -> Iterator[tuple[str, Situation]]:
    """(module, situation) of all modules of this folder, by name."""
    for file in sorted(HERE.glob("*.py")):
        module = importlib.import_module(f"tests.support.scene.strangers.{file.stem}")
        for situation in getattr(module, "SITUATIONS", ()):
            yield file.stem, situation


def picture(path: Path, mode: str = "RGB", size: tuple[int, int] = (16, 12), seed: int = 0) -> None:
    """Noise of that mode, saved as the path's ending says."""
    path.parent.mkdir(parents=True, exist_ok=True)
    shape = (size[1], size[0], 3) if mode == "RGB" else (size[1], size[0])
    values = np.random.default_rng(seed).integers(0, 200, shape)
    Image.fromarray(values.astype(DTYPES[mode])).save(path)


def write_photos(root: Path, shots: list[Shot]) -> None:
    for seed, shot in enumerate(shots):
        picture(root / shot.name.replace("\\", "/"), shot.mode, shot.size, seed)


def write_colmap(
    folder: Path, shots: list[Shot], photos: str = "images", model: str = "sparse/0"
) -> Path:
    """A COLMAP model as text, with its photos in the folder `photos`; "" writes none."""
    if photos:
        write_photos(folder / photos, shots)
    (folder / model).mkdir(parents=True)
    sizes = {shot.camera: shot.size for shot in shots}
    cameras = [
        f"{number} PINHOLE {w} {h} {FOCAL * w} {FOCAL * w} {w / 2} {h / 2}"
        for number, (w, h) in sorted(sizes.items())
    ]
    lines = []
    for number, shot in enumerate(shots, 1):
        camera_from_world = np.linalg.inv(opencv_pose(number))
        wxyz = quaternion(camera_from_world[:3, :3])
        numbers = " ".join(f"{value:.12g}" for value in (*wxyz, *camera_from_world[:3, 3]))
        lines += [f"{number} {numbers} {shot.camera} {shot.name}", ""]
    (folder / model / "cameras.txt").write_text("\n".join(cameras) + "\n")
    (folder / model / "images.txt").write_text("\n".join(lines) + "\n")
    (folder / model / "points3D.txt").write_text("1 0 0 0 200 100 50 0.5 1 0 2 0\n")
    return folder


def quaternion(rotation: np.ndarray) -> tuple[float, ...]:
    """w x y z of a rotation matrix."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    return float(w), float(x), float(y), float(z)


def write_frames(folder: Path, shots: list[Shot], **more) -> Path:
    """The same as transforms.json of nerfstudio, photos where it says."""
    write_photos(folder, shots)
    frames = []
    for number, shot in enumerate(shots):
        pose = opencv_pose(number, (0.0, 0.0, 1.0)) @ OPENCV_FROM_EYE
        w, h = shot.size
        lens = {"w": w, "h": h, "fl_x": FOCAL * w, "cx": w / 2, "cy": h / 2}
        frame = {"file_path": shot.name, "transform_matrix": pose.tolist()} | lens
        frames.append(frame | dict(shot.keys))
    write_transforms(folder, frames, **more)
    return folder
