"""COLMAP's cameras and images, text or binary; every count is held against the bytes there are."""

import math
import mmap
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.capture_files import in_code_page
from shapeshift.scene.captures.colmap.text_lines import (
    AGAIN,
    LONGEST_NAME,
    image_rows,
    numbers_of,
    rows_of_table,
)
from shapeshift.scene.pose import Pose

# Where a folder may hold its model; *: one of several that the mapper could not join.
MODELS = ("sparse/*", "sparse", "colmap/sparse/*", "dense/sparse", ".")
MOST_MODELS = 1000  # in one folder that are looked at
TABLES = ("cameras", "images", "points3D")
# name, how many focal lengths, how many parameters; COLMAP's src/colmap/sensor/models.h
LENSES = {
    0: ("SIMPLE_PINHOLE", 1, 3), 1: ("PINHOLE", 2, 4), 2: ("SIMPLE_RADIAL", 1, 4),
    3: ("RADIAL", 1, 5), 4: ("OPENCV", 2, 8), 5: ("OPENCV_FISHEYE", 2, 8),
    6: ("FULL_OPENCV", 2, 12), 7: ("FOV", 2, 5), 8: ("SIMPLE_RADIAL_FISHEYE", 1, 4),
    9: ("RADIAL_FISHEYE", 1, 5), 10: ("THIN_PRISM_FISHEYE", 2, 12),
    11: ("RAD_TAN_THIN_PRISM_FISHEYE", 2, 16), 12: ("SIMPLE_DIVISION", 1, 4),
    13: ("DIVISION", 2, 5), 14: ("SIMPLE_FISHEYE", 1, 3), 15: ("FISHEYE", 2, 4),
    16: ("EUCM", 2, 6),
}  # fmt: skip
# Not COLMAP's, with two focal lengths and a principal point first: captures/lenses.  COLMAP's own
# EQUIRECTANGULAR, whose parameters are its width and height, becomes such a PANORAMA.
PANORAMA, BROWN, BROWN_FISHEYE = "EQUIRECTANGULAR", "BROWN_CONRADY", "BROWN_CONRADY_FISHEYE"
BROWN_EQUISOLID, RADIAL_BACKWARDS = "BROWN_CONRADY_EQUISOLID_FISHEYE", "RADIAL_BACKWARDS"
SPHERE = 17, 2  # COLMAP's number for it, and how many parameters it has
LENS_NUMBERS = {name: number for number, (name, _, _) in LENSES.items()}
CAMERA, IMAGE = struct.Struct("<IiQQ"), struct.Struct("<I7dI")
COUNT = struct.Struct("<Q")
POINT_IN_IMAGE = 24  # bytes


@dataclass(frozen=True)
class ColmapCamera:
    """One row of COLMAP's table of cameras."""

    model: str
    size: tuple[int, int]
    params: tuple[float, ...]
    crop: float | None = None  # pixels from its centre beyond which the photo shows nothing

    @property
    def focals(self) -> tuple[float, ...]:
        """The first of its parameters: one for both directions, or two."""
        return self.params[: _focals(self.model)]

    @property
    def focal(self) -> tuple[float, float]:
        return self.focals[0], self.focals[-1]

    @property
    def centre(self) -> tuple[float, float]:
        first = _focals(self.model)
        return self.params[first], self.params[first + 1]

    @property
    def bends(self) -> bool:
        """Whether it is other than a pinhole: its further numbers say how much."""
        return (
            "FISHEYE" in self.model
            or self.model == PANORAMA
            or any(self.params[_focals(self.model) + 2 :])
        )

    @staticmethod
    def panorama(size: tuple[int, int]) -> "ColmapCamera":
        """All directions about the camera: pixels a radian, and the middle, which lies ahead."""
        width, height = size
        each = (width / (2 * math.pi), height / math.pi, width / 2, height / 2)
        return ColmapCamera(PANORAMA, size, each)


@dataclass(frozen=True)
class Posed:
    """One row of COLMAP's table of images."""

    number: int
    name: str
    wxyz: tuple[float, ...]  # camera from world, OpenCV axes
    place: tuple[float, ...]  # (3,) of that transform
    lens: int  # of a ColmapCamera

    @property
    def length(self) -> float:
        """Of its quaternion: any but 0 is a turn; tables are rounded, or were never divided."""
        return math.hypot(*self.wxyz)

    def camera_from_world(self) -> np.ndarray:
        """(4, 4) of its quaternion divided by its length, which is neither 0 nor infinite."""
        wxyz = np.array(self.wxyz) / max(map(abs, self.wxyz))  # 1e-320 has no square
        return Pose(np.array(self.place), wxyz / np.linalg.norm(wxyz)).matrix()


def find_model(folder: Path, tables: tuple[str, ...] = ("images",)) -> tuple[Path, str] | None:
    """The folder and ending (.bin or .txt) of a COLMAP model in or under `folder`, or None.

    Of several that the mapper could not join it is the one with most images, the first of these.
    """
    for place in MODELS:
        if place.endswith("/*"):
            found = models_in(folder / place[:-2], tables)
            numbered = [model for model in found if model[0].name.isdecimal()] or found
            if len(numbered) > 1:
                return max(numbered, key=lambda model: images_in(*model))
            if numbered:
                return numbered[0]
        elif (ending := ending_of(folder / place, tables)) is not None:
            return folder / place, ending
    return None


def models_in(folder: Path, tables: tuple[str, ...] = ("images",)) -> list[tuple[Path, str]]:
    """The models in the folders of one, in the order of their numbers."""
    if not folder.is_dir():
        return []
    names = sorted(os.listdir(folder))[:MOST_MODELS]
    names.sort(key=lambda name: int(name) if name.isdecimal() and len(name) < 9 else math.inf)
    endings = [(folder / name, ending_of(folder / name, tables)) for name in names]
    return [(model, ending) for model, ending in endings if ending is not None]


def ending_of(folder: Path, tables: tuple[str, ...]) -> str | None:
    """Of the tables of a model; as COLMAP does, binary ones before those of text."""
    for ending in (".bin", ".txt"):
        if all((folder / f"{table}{ending}").is_file() for table in tables):
            return ending
    return None


def images_in(folder: Path, ending: str) -> int:
    """How many images a model has; -1 where its table cannot be read."""
    path = folder / f"images{ending}"
    try:
        if ending == ".txt":
            return sum(1 for _ in image_rows(path))
        with mapped(path) as data:
            return count_of(data, IMAGE.size + 1 + COUNT.size, path)
    except BadFile:
        return -1


def read_tables(
    folder: Path, ending: str, photos: Path | None = None
) -> tuple[dict[int, ColmapCamera], list[Posed]]:
    """Lenses by their number, and the images by theirs.  Raises BadFile.

    photos: where they lie; names that are no UTF-8 are read in the code page in which they do.
    """
    cameras, images = folder / f"cameras{ending}", folder / f"images{ending}"
    for path in (cameras, images):
        if not path.is_file():
            raise BadFile(f"{path} is missing; cameras and images are needed, both as {ending}.")
    if ending == ".bin":
        with mapped(cameras) as lens_bytes, mapped(images) as image_bytes:
            lenses = cameras_of_bytes(lens_bytes, cameras)
            posed = images_of_bytes(image_bytes, images)
    else:
        lenses, posed = cameras_of_text(cameras), images_of_text(images)
    if not posed:
        raise BadFile(f"{images}: the COLMAP model holds no posed image; run the mapper again.")
    for image in posed:
        if image.lens not in lenses:
            raise BadFile(f"{images}: image {image.name} has camera {image.lens}, which is absent.")
    names = in_code_page([image.name for image in posed], photos)
    posed = [
        image if image.name == name else replace(image, name=name)
        for image, name in zip(posed, names, strict=True)
    ]
    return lenses, sorted(posed, key=lambda image: image.number)


@contextmanager
def mapped(path: Path) -> Iterator[bytes | mmap.mmap]:
    """A file's bytes, read as they are needed: the points in images.bin may be a gigabyte."""
    if not path.stat().st_size:
        yield b""
        return
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        yield data


def cameras_of_bytes(data: bytes | mmap.mmap, path: Path) -> dict[int, ColmapCamera]:
    count, at = count_of(data, CAMERA.size + 2 * 8, path), COUNT.size
    lenses = {}
    for _ in range(count):
        if at + CAMERA.size > len(data):
            raise short_of(path, count, "cameras")
        number, model, width, height = CAMERA.unpack_from(data, at)
        at += CAMERA.size
        if model not in LENSES and model != SPHERE[0]:
            raise BadFile(f"{path}: camera {number} is of model {model}, which is not known here.")
        params = SPHERE[1] if model == SPHERE[0] else LENSES[model][2]
        if at + 8 * params > len(data):
            raise short_of(path, count, "cameras")
        values = struct.unpack_from(f"<{params}d", data, at)
        at += 8 * params
        name = PANORAMA if model == SPHERE[0] else LENSES[model][0]
        lenses[number] = lens_from(name, (width, height), values)
    return lenses


def lens_from(model: str, size: tuple[int, int], params: tuple[float, ...]) -> ColmapCamera:
    """The lens of a row of either table."""
    return ColmapCamera.panorama(size) if model == PANORAMA else ColmapCamera(model, size, params)


def images_of_bytes(data: bytes | mmap.mmap, path: Path) -> list[Posed]:
    count, at = count_of(data, IMAGE.size + 1 + COUNT.size, path), COUNT.size
    posed = []
    for _ in range(count):
        if at + IMAGE.size > len(data):
            raise short_of(path, count, "images")
        number, *values, lens = IMAGE.unpack_from(data, at)
        at += IMAGE.size
        end = data.find(b"\0", at, at + LONGEST_NAME)
        if end < 0 or end + 1 + COUNT.size > len(data):
            raise short_of(path, count, "images")
        name = name_from(data[at:end])
        points = COUNT.unpack_from(data, end + 1)[0]
        at = end + 1 + COUNT.size
        if points > (len(data) - at) // POINT_IN_IMAGE:
            raise BadFile(f"{path}: image {name} claims {points:,} points; the file ends; {AGAIN}.")
        at += points * POINT_IN_IMAGE
        posed.append(Posed(number, name, tuple(values[:4]), tuple(values[4:]), lens))
    return posed


def count_of(data: bytes | mmap.mmap, least: int, path: Path) -> int:
    """The count that a table begins with, which its bytes must be able to hold."""
    if len(data) < COUNT.size:
        raise BadFile(f"{path} has {len(data)} bytes, too few for a table of COLMAP; {AGAIN}.")
    count = COUNT.unpack_from(data)[0]
    if count > (len(data) - COUNT.size) // least:
        raise BadFile(f"{path} claims {count:,} rows, its {len(data):,} bytes hold fewer; {AGAIN}.")
    return count


def cameras_of_text(path: Path) -> dict[int, ColmapCamera]:
    lenses = {}
    for where, words in rows_of_table(path):
        values = numbers_of(words[:1] + words[2:], where)
        model = words[1].decode("utf-8", "replace").upper() if len(words) > 1 else ""
        if model not in LENS_NUMBERS and model != PANORAMA:
            raise BadFile(f"{where}: {model[:40]!r} is no camera model known here.")
        params = SPHERE[1] if model == PANORAMA else LENSES[LENS_NUMBERS[model]][2]
        if len(values) != 3 + params:
            raise BadFile(f"{where}: {model} has {params} numbers after its size.")
        size = (int(values[1]), int(values[2]))
        lenses[int(values[0])] = lens_from(model, size, tuple(values[3:]))
    return lenses


def images_of_text(path: Path) -> list[Posed]:
    return [
        Posed(int(v[0]), name_from(name), tuple(v[1:5]), tuple(v[5:8]), int(v[8]))
        for v, name in image_rows(path)
    ]


def name_from(raw: bytes) -> str:
    """Of an image; what is no UTF-8 stays as it is until `in_code_page` knows better."""
    return raw.decode("utf-8", "surrogateescape")


def _focals(model: str) -> int:
    return LENSES[LENS_NUMBERS[model]][1] if model in LENS_NUMBERS else 2


def short_of(path: Path, count: int, what: str) -> BadFile:
    return BadFile(f"{path} claims {count:,} {what} and ends before the last; {AGAIN}.")
