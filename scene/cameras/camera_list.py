"""A list of views with names, as every file of cameras gives it, and what its readers share."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, is_number, rows_of, shown
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.operations.rotate_splats import UPSIDE_DOWN, ours_from_file
from shapeshift.scene.cameras.framing import FOV_Y
from shapeshift.scene.captures.capture_rules import rigid
from shapeshift.scene.pose import OPENCV_FROM_EYE, Pose, View

SIZE = (640, 360)  # pixels, where neither the file nor its reader says
NEAR, FAR = 0.05, 1000.0  # metres, where the file does not say
MOST_BYTES = 256 << 20  # of JSON; a thousand cameras take about half a megabyte
MOST_VIEWS = 100_000
LONGEST_NAME = 1000  # letters
DATA_UP = "-Y"  # of COLMAP's and 3DGS's worlds, which are turned as their splats are


@dataclass(frozen=True)
class CameraReading:
    """How a file of cameras is to be read; every reader takes it."""

    size: tuple[int, int] | None = None  # pixels instead of the file's
    fov_y: float = 0.0  # radians, for files that say nothing about the lens; 0 = FOV_Y
    up: str = ""  # the axis of the file's world that points up; "" = what its format says
    flip: bool = False  # half a turn about z after that


@dataclass(frozen=True)
class CameraList:
    """Views in a file's order."""

    views: tuple[View, ...]  # our world
    names: tuple[str, ...]  # one a view; "" where it has none
    format: str
    notes: tuple[str, ...] = ()  # what the reader had to assume or leave out, one sentence each
    fps: float = 0.0  # of a path that is to be played; 0 = separate views


def read_rows(rows: object, name: str, where: str) -> list[Fields]:
    """The list of objects `name` of a file, one a camera; BadFile unless it is one, not empty."""
    if not isinstance(rows, list):
        raise BadFile(
            f"{where}: {name} is {shown(rows)}; a list of objects, one a camera, is wanted."
        )
    if not rows:
        raise BadFile(f"{where} holds no camera; add one.")
    if len(rows) > MOST_VIEWS:
        raise BadFile(f"{where} holds {len(rows):,} cameras; at most {MOST_VIEWS:,} are read.")
    return list(rows_of(rows, f"{where}, camera", 0))


def numbers(value: object, shape: tuple[int, ...], what: str) -> np.ndarray:
    """A float64 array of that shape; a flat list of as many numbers will do."""
    try:
        return np.array(value, np.float64).reshape(shape)
    except (TypeError, ValueError, OverflowError):
        raise BadFile(f"{what} is not {' x '.join(map(str, shape))} numbers.") from None


def read_name(value: object) -> str:
    """A name on one line, as any file can hold it; "" for None."""
    text = "" if value is None else str(value)[:LONGEST_NAME]
    words = "".join(c if c.isprintable() else " " for c in text).split()
    return " ".join(words).encode("utf-8", "replace").decode()


def pose_matrix(value: object, where: str, may_mirror: bool = False) -> np.ndarray:
    """(4, 4) float64 rigid, from 4 x 4, 3 x 4, 16 or 12 numbers; its rotation made exact.

    may_mirror: as in `rigid`.
    """
    try:
        flat = np.array(value, np.float64).ravel()
    except (TypeError, ValueError, OverflowError):
        flat = np.zeros(0)
    if flat.size not in (12, 16):
        raise BadFile(f"{where} is not 4 x 4 numbers.")
    matrix = flat.reshape(-1, 4)
    if len(matrix) == 4 and not np.array_equal(matrix[3], (0, 0, 0, 1)):
        raise BadFile(f"{where} is no rotation and position, [R t; 0 0 0 1].")
    return rigid(matrix, where, may_mirror)


def ours_from_world(reading: CameraReading, up: str = DATA_UP) -> np.ndarray:
    """(4, 4) the turn from a file's world to ours, as its splats make it."""
    turn = np.eye(4)
    turn[:3, :3] = ours_from_file(reading.up or up, reading.flip)
    return turn


def flipped(reading: CameraReading) -> np.ndarray:
    """(4, 4) what --flip adds to a turn that the file itself states."""
    turn = np.eye(4)
    turn[:3, :3] = UPSIDE_DOWN if reading.flip else np.eye(3)
    return turn


def pinhole_view(
    world_from_camera: np.ndarray,
    focal: tuple[float, float],
    centre: tuple[float, float],
    size: tuple[float, float],
    where: str,
) -> View:
    """The view of a camera with OpenCV axes (4, 4), pixels.  Raises BadFile."""
    if not all(is_number(f) and f > 0 for f in focal):
        raise BadFile(f"{where} has focal lengths {_numbers_text(focal)}; both must be above 0.")
    if not all(is_number(n) and n >= 1 for n in size):
        raise BadFile(f"{where} has the size {_numbers_text(size)}; pixels from 1 up are wanted.")
    if not all(map(is_number, centre)):
        raise BadFile(
            f"{where} has its principal point at {_numbers_text(centre)}; pixels are wanted."
        )
    pixels = (int(size[0]), int(size[1]))
    try:
        return View.from_pinhole(world_from_camera, focal, centre, pixels, NEAR, FAR)
    except ValueError as error:
        raise BadFile(f"{where}: {error}") from None


def eye_view(
    world_from_eye: np.ndarray, tangents: tuple, size: tuple[int, int], where: str,
    near: float = NEAR, far: float = FAR,
) -> View:  # fmt: skip
    """The view of an eye that looks along its -Z (4, 4).  Raises BadFile."""
    try:
        return View(Pose.from_matrix(world_from_eye), tangents, near, far, size)
    except ValueError as error:
        raise BadFile(f"{where}: {error}") from None


def opencv_from_eye(world_from_eye: np.ndarray) -> np.ndarray:
    """(4, 4) world_from_camera with OpenCV axes of an eye's pose, and back: its own inverse."""
    return world_from_eye @ OPENCV_FROM_EYE


def assumed_fov(reading: CameraReading, where: str) -> tuple[float, tuple[str, ...]]:
    """Radians for a file that says nothing about the lens, and the note about that."""
    fov_y = reading.fov_y or FOV_Y
    if reading.fov_y:
        return fov_y, ()
    return fov_y, (
        f"{where} gives no field of view; taken is {math.degrees(fov_y):.1f} degrees from top to "
        "bottom, --fov-y gives another.",
    )


def is_centred(view: View) -> bool:
    left, right, low, high = view.tangents
    return abs(left + right) < 1e-9 * right and abs(low + high) < 1e-9 * high


def data_from_ours() -> np.ndarray:
    """(4, 4) the turn from our world to that of COLMAP's and 3DGS's files, for writers."""
    return np.linalg.inv(ours_from_world(CameraReading()))


def first_of_each(views: list[View]) -> list[int]:
    """Indices of the views that no earlier one equals."""
    seen: dict = {}
    for i, view in enumerate(views):
        pose = view.world_from_eye
        lens = (view.tangents, view.whole, view.size)
        seen.setdefault((tuple(pose.position), tuple(pose.wxyz), *lens), i)
    return list(seen.values())


def moved(views: Sequence[View], by: Sequence[float]) -> list[View]:
    """The views with (3,) metres added to their places: a scene's -origin, for one re-centred."""
    shift = np.asarray(by, np.float64)
    if not shift.any():
        return list(views)
    return [
        replace(
            v, world_from_eye=replace(v.world_from_eye, position=v.world_from_eye.position + shift)
        )
        for v in views
    ]


def _numbers_text(values: Sequence) -> str:
    return ", ".join(f"{v:.6g}" if is_number(v) else str(v)[:20] for v in values)
