"""What readers of other programs' poses share: their photos, their lenses, what points up."""

import codecs
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shapeshift.runtime_models.files.json_fields import is_number
from shapeshift.runtime_models.files.memory import read_text_file
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.capture_files import CODE_PAGES, NAMES_TRIED, SMALLER, folded, parts_of
from shapeshift.scene.capture_photos import image_size
from shapeshift.scene.captures.capture_rules import LARGEST_NUMBER
from shapeshift.scene.captures.colmap_tables import BROWN, ColmapCamera
from shapeshift.scene.captures.scans.posed_frames import PosedFrames
from shapeshift.scene.other_pictures import kind_of_folder
from shapeshift.scene.pose import OPENCV_FROM_EYE

MOST_ENTRIES = 50_000  # files below a folder among which photos are looked for
DEEPEST = 6  # folders in folders
ENDINGS = {".jpg", ".jpeg", ".png", ".tif", ".tiff", ".webp", ".bmp"}
NO_PHOTOS = (
    "mask",
    "depth",
    "normal",
    "thumb",
    ".",
    "__macosx",
)  # how folders of other pictures begin
STRAIGHT = "undistort"  # in names of folders
SEVERAL = "have names that several photos have, in folders that it does not tell"
Z_UP = (0.0, 0.0, 1.0)
EARTH = (6.2e6, 6.6e6)  # metres from its middle: places of the geocentric system
FLATTENING = 1 / 298.257223563  # of WGS84's ellipsoid ...
EQUATOR = 6378137.0  # ... and its half axis, metres


class PhotoIndex:
    """The pictures below a folder, by their names; other programs name them by whole paths of
    another machine, by bare names, or without an ending."""

    def __init__(self, folder: Path, deepest: int = DEEPEST) -> None:
        self.folder = folder
        self.by_name: dict[str, list[str]] = {}  # folded name -> paths from the folder, with /
        self.by_stem: dict[str, list[str]] = {}
        self.paths = set(pictures_below(folder, deepest))
        for path in sorted(self.paths):
            name = path.rpartition("/")[2]
            self.by_name.setdefault(folded(name), []).append(path)
            self.by_stem.setdefault(folded(name.rpartition(".")[0]), []).append(path)

    def find(self, name: str, size: tuple[int, int] | None = None, hint: str = "") -> list[str]:
        """Paths from the folder of the photos that a name may mean, the best alone.

        size: pixels that it has; hint: words that its folder may have in its name.
        """
        parts = [part for part in parts_of(name) if part != "."] or [name]
        if (path := "/".join(parts)) in self.paths:
            return [path]
        last = folded(parts[-1])
        alike = self.by_name.get(last) or self.by_stem.get(last)
        if alike is None and "." in last:  # the photo may have been converted since
            alike = self.by_stem.get(last.rpartition(".")[0])
        if not alike and ".." not in parts and os.path.isfile(self.folder / path):
            return [path]  # in a folder that is called as those of masks are
        alike = best([ends_alike(path, parts) for path in alike or ()], alike or [])
        if len(alike) > 1 and hint:
            alike = best([folded(hint) in folded(path) for path in alike], alike)
        if len(alike) > 1:  # alpha/1.png beside images/1.png
            alike = best([not any(map(kind_of_folder, p.split("/")[:-1])) for p in alike], alike)
        if len(alike) > 1:  # copies that OpenSfM makes; what it writes of them names them itself
            alike = best([STRAIGHT not in folded(path) for path in alike], alike)
        if len(alike) > 1 and size is not None:
            alike = best([image_size(self.folder / p, None) == size for p in alike], alike)
        return alike


def best(scores: Sequence[int], of: Sequence[str]) -> list[str]:
    """Those with the highest score."""
    most = max(scores, default=0)
    return [path for path, score in zip(of, scores, strict=True) if score == most]


def ends_alike(path: str, parts: Sequence[str]) -> int:
    """How many folders, from the photo upwards, are called alike."""
    count = 0
    for mine, other in zip(reversed(path.split("/")[:-1]), reversed(parts[:-1]), strict=False):
        if folded(mine) != folded(other):
            break
        count += 1
    return count


def pictures_below(folder: Path, deepest: int) -> Iterable[str]:
    """Paths of pictures from the folder, sorted: at most MOST_ENTRIES files are looked at."""
    seen, found = 0, []
    for place, folders, files in os.walk(folder):
        below = Path(place).relative_to(folder)
        others = {f"images_{n}" for n in SMALLER} if "images" in folders else set()
        usual = [f for f in folders if not folded(f).startswith(NO_PHOTOS) and f not in others]
        folders[:] = sorted(usual) if len(below.parts) < deepest else []
        seen += len(files)
        if seen > MOST_ENTRIES:
            break
        names = [f for f in files if os.path.splitext(f)[1].lower() in ENDINGS]
        found += [(below / name).as_posix() for name in names if not name.startswith(".")]
    return sorted(found)


def text_in(path: Path, photos: PhotoIndex | None = None) -> str:
    """A file's text with \n between its lines.  What is no UTF-8 is read in the code page in which
    most of the photos' names are in it; without any in that of western Windows.  Raises BadFile.
    """
    data = read_text_file(path, "its words")
    wide = data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    pages = ["utf-16" if wide else "utf-8-sig"]
    try:
        text = data.decode(pages[0])
    except UnicodeDecodeError:
        pages = pages if wide else list(CODE_PAGES)
        named = [] if photos is None else [n for n in photos.by_name if not n.isascii()]
        texts = [data.decode(page, "replace") for page in pages]
        found = [sum(name in folded(t) for name in named[:NAMES_TRIED]) for t in texts]
        text = texts[found.index(max(found))]
    return text.replace("\r\n", "\n").replace("\r", "\n")


@dataclass
class Gathered:
    """Frames as a reader finds them one after the other, and what it left out."""

    path: Path  # the file
    program: str
    photos: PhotoIndex
    up: tuple[float, float, float] | None = None  # in the file's world; None: the cameras tell
    frames: list[dict] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)
    named: int = 0  # photos in the file
    left: dict[str, list[str]] = field(default_factory=dict)  # why -> their names
    points: np.ndarray | None = None  # (P, 3) float64, the file's world
    colors: np.ndarray | None = None  # (P, 3) 0..1

    def leave(self, name: str, why: str) -> None:
        self.named += 1
        found = self.photos.find(name)
        self.left.setdefault(why, []).append(found[0] if len(found) == 1 else name)

    def add(
        self,
        name: str,
        world_from_camera: np.ndarray,
        lens: ColmapCamera | None,
        more: Mapping | None = None,
        hint: str = "",
    ) -> None:
        """A photo with its pose (4, 4) with OpenCV axes, and its lens; one that is not there keeps
        the name that the file gives it."""
        found = self.photos.find(name, None if lens is None else lens.size, hint)
        if len(found) > 1:
            self.leave(name, SEVERAL)
            return
        self.named += 1
        frame = {"file_path": found[0] if found else name} | lens_words(lens) | dict(more or {})
        frame["transform_matrix"] = (world_from_camera @ OPENCV_FROM_EYE).tolist()
        self.frames.append(frame)

    def size_of(self, name: str) -> tuple[int, int] | None:
        """Pixels of a photo, where a file says none; None where it is not there."""
        found = self.photos.find(name)
        return image_size(self.photos.folder / found[0], None) if found else None

    def finished(self) -> PosedFrames:
        """Raises BadFile where nothing is left."""
        said = [
            f"{len(names)} of {self.named} photos of {path_end(self.path)} {why}, for example "
            f"{path_end(names[0])}; they are left out."
            for why, names in self.left.items()
        ]
        if not self.frames:
            what = said[0] if said else "it names no photo."
            raise BadFile(
                f"{self.path}: no photo has a pose in this file of {self.program}: {what}"
            )
        if self.up is not None:
            self.frames[0]["up"] = list(self.up)
        doubts = (
            f"The poses are those of {self.program}: {path_end(self.path)}.",
            *said,
            *self.doubts,
        )
        folder, where = self.photos_where_they_were(), str(self.path)
        return PosedFrames(
            folder, where, self.frames, doubts, self.left,
            points=self.points, colors=self.colors, program=self.program,
        )  # fmt: skip

    def photos_where_they_were(self) -> Path:
        """The folder of the photos; where none lies with the file, as in Meshroom's cache, that of
        the photos which it names by whole paths of this machine."""
        names = [str(frame["file_path"]) for frame in self.frames]
        folder = self.photos.folder
        whole = [os.path.isabs(name) for name in names]
        if all(whole) and any(map(os.path.isfile, names)):
            folder = Path(os.path.commonpath([os.path.dirname(name) for name in names]))
        for frame, name, absolute in zip(self.frames, names, whole, strict=True):
            if absolute and Path(name).is_relative_to(folder):
                frame["file_path"] = Path(name).relative_to(folder).as_posix()
            elif absolute:  # one of them may be there: it is of another place
                frame["file_path"] = "/".join(parts_of(name))
        return folder


def lens_words(lens: ColmapCamera | None) -> dict:
    """The words of transforms.json for a lens, and the lens itself."""
    if lens is None:
        return {}
    (fx, fy), (cx, cy), (width, height) = lens.focal, lens.centre, lens.size
    return {"w": width, "h": height, "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "lens": lens}


def checked_size(width: Any, height: Any, where: str) -> tuple[int, int]:
    for side in (width, height):
        if not (is_number(side) and 1 <= side <= 1 << 20 and int(side) == side):
            raise BadFile(f"{where} has {width!s:.20}x{height!s:.20} pixels; export it again")
    return int(width), int(height)


def checked_lens(
    model: str, size: tuple[int, int], params: Sequence[float], where: str
) -> ColmapCamera:
    """A lens of numbers that a file states: focal lengths above 0, all of them usable."""
    values = tuple(map(float, params))
    if not all(abs(value) <= LARGEST_NUMBER for value in values):  # NaN is not
        raise BadFile(f"{where}: its lens holds numbers that are none; export it again")
    if not (values[0] > 0 and values[1] > 0):
        raise BadFile(f"{where} has focal lengths {values[:2]}; both must be above 0")
    return ColmapCamera(model, size, values)


def brown_lens(
    size: tuple[int, int],
    pinhole: Sequence[float],
    radial: Sequence[float],
    tangential: Sequence[float],
    where: str,
) -> ColmapCamera:
    """k1 to k4 (fewer: 0) and p1, p2 as OpenCV means them: x gets 2 p1 x y + p2 (r^2 + 2 x^2)."""
    k = (*radial, 0.0, 0.0, 0.0, 0.0)[:4]
    if k[3]:
        return checked_lens(BROWN, size, (*pinhole, *k, *tangential), where)
    return checked_lens(
        "FULL_OPENCV", size, (*pinhole, *k[:2], *tangential, k[2], 0.0, 0.0, 0.0), where
    )


def world_from(rotation: np.ndarray, centre: ArrayLike) -> np.ndarray:
    """(4, 4) from camera-from-world (3, 3) and where the camera stands (3,)."""
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = np.asarray(rotation).T, centre
    return out


def camera_inverse(rotation: np.ndarray, translation: ArrayLike) -> np.ndarray:
    """(4, 4) world from camera, of the pose that takes world to camera."""
    turn = np.asarray(rotation, np.float64).T
    return world_from(turn.T, -turn @ np.asarray(translation, np.float64))


def geocentric_up(places: np.ndarray) -> tuple[float, float, float] | None:
    """The ellipsoid's normal where cameras (N, 3) stand, metres from the middle of the earth; None
    where they do not stand on it."""
    middle = np.median(np.asarray(places, np.float64), axis=0)
    if not EARTH[0] < np.linalg.norm(middle) < EARTH[1]:
        return None
    x, y, z = middle
    across, e2 = math.hypot(x, y), FLATTENING * (2 - FLATTENING)
    latitude = math.atan2(z, across * (1 - e2))
    for _ in range(5):  # converges to 1e-12 near the ellipsoid
        s = math.sin(latitude)
        latitude = math.atan2(z + e2 * EQUATOR / math.sqrt(1 - e2 * s * s) * s, across)
    longitude = math.atan2(y, x)
    c = math.cos(latitude)
    return (c * math.cos(longitude), c * math.sin(longitude), math.sin(latitude))
