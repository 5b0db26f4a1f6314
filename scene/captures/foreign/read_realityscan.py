"""RealityScan's and RealityCapture's CSV (Alignment, Export, Registration, Internal/External camera
parameters): #name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2.

As its export's template has it: f is the focal length of a 36 mm film, px and py are parts of the
longer side from the photo's middle, and t2, t1 are OpenCV's p1, p2.  A camera with OpenGL axes is
turned about its y by the roll, then about x by the pitch, then about z, which points up, by minus
the heading.
"""

import csv
import math
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture_rules import LARGEST_NUMBER
from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.foreign.foreign_frames import (
    Z_UP,
    Gathered,
    PhotoIndex,
    brown_lens,
    text_in,
)
from shapeshift.scene.captures.scans.posed_frames import PosedFrames
from shapeshift.scene.pose import OPENCV_FROM_EYE

FILM = 36.0  # mm, of the longer side
# Names of columns, newer and older ones.
NAMES = {
    "name": ("name", "#name"), "x": ("x",), "y": ("y",), "alt": ("alt", "z", "altitude"),
    "heading": ("heading", "yaw"), "pitch": ("pitch",), "roll": ("roll",),
    "f": ("f", "f_35mm"), "px": ("px", "px_norm"), "py": ("py", "py_norm"),
    "k1": ("k1",), "k2": ("k2",), "k3": ("k3",), "k4": ("k4",), "t1": ("t1",), "t2": ("t2",),
}  # fmt: skip
MUST = ("name", "x", "y", "alt", "heading", "pitch", "roll", "f")


def realityscan_frames(path: Path, photos: PhotoIndex) -> PosedFrames:
    """Raises BadFile."""
    rows = rows_of(path, photos)
    columns = columns_of(rows[0])
    out = Gathered(path, "RealityScan", photos, Z_UP)
    if lacks := [key for key in MUST if key not in columns]:
        raise BadFile(
            f"{path}: its table lacks {', '.join(lacks)}; in RealityScan: Alignment, Export, "
            "Registration, Internal/External camera parameters"
        )
    places: list[np.ndarray] = []
    for number, row in enumerate(rows[1:], 2):
        if not any(word.strip() for word in row) or row[0].startswith("#"):
            continue
        where = f"{path}, line {number}"
        if len(row) <= max(columns.values()):
            raise BadFile(f"{where}: {len(row)} columns, the first line names more; export again")
        if len(row) > len(rows[0]) and any(word.strip() for word in row[len(rows[0]) :]):
            raise BadFile(
                f"{where}: {len(row)} columns, the first line names {len(rows[0])}; export it "
                "again with decimal points"
            )
        name = row[columns["name"]].strip()
        values = {key: number_in(row[at], where) for key, at in columns.items() if key != "name"}
        pose = np.eye(4)
        angles = [values[key] for key in ("heading", "pitch", "roll")]
        pose[:3, :3] = world_from_angles(*np.radians(angles))
        pose[:3, 3] = [values[key] for key in ("x", "y", "alt")]
        size = out.size_of(name)
        lens = None if size is None else lens_of(values, size, where)
        places.append(pose[:3, 3])
        out.add(name, pose @ OPENCV_FROM_EYE, lens)
    if look_like_degrees(np.array(places)):
        raise BadFile(
            f"{path}: x and y look like degrees beside an altitude in metres; export in a system "
            "of metres (local, or UTM)"
        )
    return out.finished()


def look_like_degrees(places: np.ndarray) -> bool:
    """Whether places (N, 3) hardly differ in x and y, far from zero, and much in height."""
    if len(places) < 3 or (np.abs(places[:, :2]) > (180, 90)).any():
        return False
    across, high = np.ptp(places[:, :2], axis=0).max(), np.ptp(places[:, 2])
    return bool(100 * across < min(high, np.abs(places[:, :2].mean(axis=0)).max()))


def rows_of(path: Path, photos: PhotoIndex) -> list[list[str]]:
    text = text_in(path, photos).replace("\0", "")
    first = text.partition("\n")[0]
    cut = max(",;\t", key=first.count)
    try:
        rows = list(csv.reader(text.splitlines(), delimiter=cut, skipinitialspace=True))
    except csv.Error as error:
        raise BadFile(f"{path} is no table ({error!s:.60}); export it again") from None
    # Some of its exports have the number of cameras before the table.
    while rows and not columns_of(rows[0]):
        rows = rows[1:]
    if not rows:
        raise BadFile(f"{path}: no line names its columns (#name,x,y,alt ...); export it again")
    return rows


def columns_of(row: list[str]) -> dict[str, int]:
    """Which column is which, of a line that names them; {} of another."""
    words = [word.strip().lower() for word in row]
    found = {
        key: words.index(name) for key, names in NAMES.items() for name in names if name in words
    }
    return found if "name" in found else {}


def number_in(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= LARGEST_NUMBER:  # NaN is not
        raise BadFile(f"{where}: {text[:40]!r} is no number; export it again with decimal points")
    return value


def world_from_angles(heading: float, pitch: float, roll: float) -> np.ndarray:
    """(3, 3) world from camera with OpenGL axes; radians."""
    (sh, sp, sr), (ch, cp, cr) = np.sin([-heading, pitch, roll]), np.cos([heading, pitch, roll])
    about_z = np.array([[ch, -sh, 0], [sh, ch, 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
    about_y = np.array([[cr, 0, sr], [0, 1, 0], [-sr, 0, cr]])
    return about_z @ about_x @ about_y


def lens_of(values: dict[str, float], size: tuple[int, int], where: str) -> ColmapCamera:
    scale, (width, height) = max(size), size
    f = values["f"] / FILM * scale
    centre = (
        width / 2 + values.get("px", 0) * scale,
        height / 2 + values.get("py", 0) * scale,
    )
    radial = [values.get(key, 0.0) for key in ("k1", "k2", "k3", "k4")]
    tangential = [values.get(key, 0.0) for key in ("t2", "t1")]
    return brown_lens(size, (f, f, *centre), radial, tangential, where)
