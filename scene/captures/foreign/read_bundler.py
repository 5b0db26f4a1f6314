"""Bundler's bundle.out with its list of photos, and VisualSFM's NVM: text, word after word."""

import math
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture_rules import LARGEST_NUMBER
from shapeshift.scene.captures.colmap_tables import RADIAL_BACKWARDS, ColmapCamera
from shapeshift.scene.captures.foreign.foreign_frames import (
    Gathered,
    PhotoIndex,
    brown_lens,
    camera_inverse,
    checked_lens,
    text_in,
    world_from,
)
from shapeshift.scene.captures.scans.posed_frames import PosedFrames

LISTS = ("list.txt", "images.txt", "{stem}.list.txt", "{stem}_list.txt", "{stem}.out.list.txt")
BUNDLER_FROM_OPENCV = np.diag([1.0, -1.0, -1.0])  # its cameras look along -z, y up
AGAIN = "copy or export it again"


class TableWords:
    """The words of a text file, one after the other."""

    def __init__(self, path: Path, text: str) -> None:
        self.path, self.words = path, iter(text.split())

    def number(self) -> float:
        word = next(self.words, None)
        try:
            value = math.nan if word is None else float(word)
        except ValueError:
            value = math.nan
        if not abs(value) <= LARGEST_NUMBER:  # NaN is not
            found = "the file ends" if word is None else f"{word[:40]!r} stands"
            raise BadFile(f"{self.path}: {found} where a number is wanted; {AGAIN}.")
        return value

    def numbers(self, count: int) -> list[float]:
        return [self.number() for _ in range(count)]

    def skip(self, count: int) -> None:
        """Raises BadFile at the end, so that no count in a file makes this long."""
        if sum(1 for _ in islice(self.words, count)) < count:
            raise BadFile(f"{self.path} ends before its last row; {AGAIN}.")

    def count(self, most: int) -> int:
        value = self.number()
        if not (0 <= value <= most and value == int(value)):
            raise BadFile(f"{self.path} claims {value:g} rows; its bytes hold fewer; {AGAIN}.")
        return int(value)


def bundler_frames(path: Path, photos: PhotoIndex) -> PosedFrames:
    """x right, y up, z back; pixels from the photo's middle; radial distortion alone (its manual).

    Raises BadFile.
    """
    head, _, rest = text_in(path, photos).lstrip().partition("\n")
    if not head.startswith("# Bundle file"):
        raise BadFile(f"{path} does not begin with '# Bundle file'; {AGAIN}.")
    words = TableWords(path, rest)
    most = path.stat().st_size
    cameras, points = words.count(most), words.count(most)
    names = listed_names(path, cameras, photos)
    out = Gathered(path, "Bundler", photos)
    for name in names:
        f, k1, k2 = words.numbers(3)
        rotation = BUNDLER_FROM_OPENCV @ np.reshape(words.numbers(9), (3, 3))
        shift = BUNDLER_FROM_OPENCV @ words.numbers(3)
        if not f:  # as it marks those that it could not place
            out.leave(name, "have no pose")
            continue
        out.add(name, camera_inverse(rotation, shift), radial_lens(out, name, f, k1, k2))
    out.points, out.colors = np.zeros((points, 3)), np.zeros((points, 3))
    for i in range(points):
        out.points[i], out.colors[i] = words.numbers(3), words.numbers(3)
        words.skip(4 * words.count(most))
    out.colors /= 255
    return out.finished()


def radial_lens(out: Gathered, name: str, f: float, k1: float, k2: float) -> ColmapCamera | None:
    if (size := out.size_of(name)) is None:
        return None
    pinhole = (f, f, size[0] / 2, size[1] / 2)
    return brown_lens(size, pinhole, (k1, k2), (0.0, 0.0), f"{out.path}: {name}")


def listed_names(path: Path, count: int, photos: PhotoIndex) -> list[str]:
    """The photos, in the cameras' order: one a line, of which the first word counts."""
    for place in (path.parent, path.parent.parent):
        for form in LISTS:
            table = place / form.format(stem=path.stem)
            if not table.is_file() or table == path:
                continue
            names = list(first_words(text_in(table, photos)))
            if len(names) == count:
                return names
    raise BadFile(
        f"{path}: its list of {count} photos (list.txt) is not beside it; put it there, a photo a "
        "line in the order of the cameras"
    )


def first_words(text: str) -> Iterator[str]:
    """Names of a list: up to an ending of a photo where names have blanks, then "0 FOCAL"."""
    for line in text.splitlines():
        words = line.strip()
        if not words or words.startswith("#"):
            continue
        head, _, tail = words.rpartition(" 0 ")
        yield head if head and is_float(tail) else words


def is_float(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def nvm_frames(path: Path, photos: PhotoIndex) -> PosedFrames:
    """VisualSFM's: focal length, quaternion wxyz camera from world with OpenCV axes, centre, a
    radial number that makes measured places straight, 0.  Its first model.  Raises BadFile.
    """
    from scipy.spatial.transform import Rotation

    lines = iter([line for line in text_in(path, photos).splitlines() if line.strip()])
    head = next(lines, "")
    if not head.startswith("NVM_V3"):
        raise BadFile(f"{path} does not begin with NVM_V3; {AGAIN}.")
    fixed = head.split()[1:]  # "FixedK fx cx fy cy r": one lens for all photos
    most = path.stat().st_size
    out = Gathered(path, "VisualSFM", photos)
    for _ in range(TableWords(path, next(lines, "")).count(most)):
        line = next(lines, "")
        words = line.rsplit(maxsplit=10)  # names may have blanks
        if len(words) != 11:
            raise BadFile(f"{path}: {line[:40]!r} is no name with ten numbers; {AGAIN}.")
        f, w, x, y, z, *more = TableWords(path, " ".join(words[1:])).numbers(10)
        name = words[0].replace('"', " ").strip()  # as it writes blanks
        if not math.hypot(w, x, y, z) > 0.5:
            raise BadFile(f"{path}: {name}: its quaternion has no direction; {AGAIN}.")
        rotation = Rotation.from_quat([x, y, z, w]).as_matrix()
        lens = nvm_lens(out, name, f, more[3], fixed)
        out.add(name, world_from(rotation, np.array(more[:3])), lens)
    add_nvm_points(out, path, lines, most)
    return out.finished()


def nvm_lens(out: Gathered, name: str, f: float, k: float, fixed: list[str]) -> ColmapCamera | None:
    if (size := out.size_of(name)) is None:
        return None
    pinhole = [f, f, size[0] / 2, size[1] / 2]
    if fixed and fixed[0].startswith("FixedK"):
        fx, cx, fy, cy, *_ = TableWords(out.path, " ".join(fixed[1:])).numbers(4)
        pinhole = [fx, fy, cx, cy]
    # The sign is that of a place as it is measured; 0 leaves a pinhole.
    return checked_lens(RADIAL_BACKWARDS, size, (*pinhole, k), f"{out.path}: {name}")


def add_nvm_points(out: Gathered, path: Path, lines: Iterator[str], most: int) -> None:
    line = next(lines, "0")
    rows = []
    for _ in range(TableWords(path, line).count(most)):
        rows.append(TableWords(path, " ".join(next(lines, "").split(maxsplit=6)[:6])).numbers(6))
    if rows:
        table = np.array(rows)
        out.points, out.colors = table[:, :3], table[:, 3:] / 255
