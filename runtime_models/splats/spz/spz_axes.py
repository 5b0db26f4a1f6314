"""Which axes an .spz is in: the format's text says right, up, back, and most writers do not.

splat-transform 3, gsply, gaussforge and the format's own library as it is usually called store a
PLY's numbers as they are: right, down, forward.  splat-transform 2 and Scaniverse turn them, as the
text has it.  Half a turn about x lies between the two, and only Adobe's extension tells them apart;
without it cameras beside the file or the scene's floor may, else the version is what is left.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import read_json
from shapeshift.runtime_models.lint.lint_whole import filed_sample
from shapeshift.runtime_models.model import BadFile, Finding
from shapeshift.runtime_models.splats.operations.rotate_splats import signs_of_harmonics
from shapeshift.runtime_models.splats.plain_splats import RawSplats
from shapeshift.runtime_models.splats.spz.spz_file import EXTENSION

AXES_EXTENSION = 0xADBE0003  # Adobe's: a number from 1 on for each of NAMED_AXES
NAMED_AXES = (
    "LDB", "RDB", "LUB", "RUB", "LDF", "RDF", "LUF", "RUF",
    "LFD", "RFD", "LFU", "RFU", "LBD", "RBD", "LBU", "RBU",
)  # fmt: skip
PLY_AXES, FORMAT_AXES = "RDF", "RUB"
TODAY = 4  # from this version on nearly all writers are those that turn nothing
WORDS = {"R": "right", "L": "left", "U": "up", "D": "down", "F": "forward", "B": "back"}
DIRECTIONS = {"R": (0, 1), "L": (0, -1), "U": (1, 1), "D": (1, -1), "B": (2, 1), "F": (2, -1)}

CAMERA_FILES = ("cameras.json", "transforms.json")
CAMERA_FOLDERS = 3  # that are searched upwards: 3DGS puts its splats two below its cameras.json
MOST_CAMERA_BYTES = 8 << 20
MOST_CAMERAS, MOST_SEEN = 64, 2048  # evenly chosen, of cameras and splats
IN_VIEW = 0.8  # cosine: within 37 degrees of where a camera looks
SEEN = 0.3  # of all splats, by a camera: the cameras are of this scene

BINS = 40  # of the scene's height
ENDS = 8  # bins at either end that may hold a floor, which is two of them thick
GRID = 8  # cells a side, of the scene's footprint
LEAST_SHARE, LEAST_COVER = 0.25, 0.6  # of what shows, and of the footprint, that a floor has
MOST_OTHER_COVER = 0.4  # at the other end: a ceiling, or the room's real floor
ON_ZERO = 0.03  # of the height: so near to y = 0 one end of a scene lies that was stood on it
TELLING = 200  # splats; fewer have no floor


@dataclass(frozen=True)
class Axes:
    """What an .spz is taken to be in, and why."""

    name: str  # one of NAMED_AXES
    reason: str
    sure: bool  # the file says it, or what holds the file


def axes_extension(axes: str) -> bytes:
    """The record that names them."""
    return EXTENSION.pack(AXES_EXTENSION, 4) + (NAMED_AXES.index(axes) + 1).to_bytes(4, "little")


def axes_said(extensions: dict[int, bytes]) -> str | None:
    """What the extension names, if there is one and it names any."""
    content = extensions.get(AXES_EXTENSION, b"")
    number = int.from_bytes(content, "little") if len(content) == 4 else 0
    return NAMED_AXES[number - 1] if 1 <= number <= len(NAMED_AXES) else None


def axes_of(raw: RawSplats, version: int, extensions: dict[int, bytes], path: Path | None) -> Axes:
    """By the extension, else by what else there is, else by the version."""
    if (said := axes_said(extensions)) is not None:
        return Axes(said, "its extension says so", True)
    if path is not None and (seen := axes_by_cameras(raw, path)) is not None:
        return seen
    if (floor := axes_by_floor(raw)) is not None:
        return floor
    if version >= TODAY:
        return Axes(PLY_AXES, f"a guess, as most writers of version {version} have it", False)
    return Axes(FORMAT_AXES, f"a guess, as the text of version {version} has it", False)


def put_axes(raw: RawSplats, axes: Axes, asked: bool) -> None:
    """Sets what of `raw` depends on its axes; mirrored ones are mirrored back, in place.

    asked: the user has named the axis that points up, so that nothing needs to be said.
    """
    name = axes.name
    if not right_handed(name):
        mirror_x(raw)
        name = ("L" if name[0] == "R" else "R") + name[1:]
    place = next(i for i, letter in enumerate(name) if letter in "UD")
    raw.up = ("+" if name[place] == "U" else "-") + "XYZ"[place]
    raw.front = name[0] == "L"
    if asked:
        return
    raw.axes = f"{', '.join(WORDS[letter] for letter in axes.name)}; {axes.reason}"
    if not axes.sure:
        other = "-Y" if raw.up == "+Y" else "+Y"
        words = ", ".join(WORDS[letter] for letter in axes.name)
        what = "it does not say which of the two axes in use it has"
        done = f"read as {words}, {axes.reason}; --up={other} turns it over"
        found = Finding(what, 0, done, file=raw.file, repaired=False)
        raw.findings = (*raw.findings, found)


def right_handed(axes: str) -> bool:
    """Whether axes such as RUB (right, up, back) are a right-handed frame."""
    frame = np.zeros((3, 3))
    for row, letter in enumerate(axes):
        column, sign = DIRECTIONS[letter]
        frame[row, column] = sign
    return float(np.linalg.det(frame)) > 0


def mirror_x(raw: RawSplats) -> None:
    """The mirror image in x, of places, rotations and harmonics, in place."""
    signs = np.array([-1.0, 1.0, 1.0])
    raw.means[:, 0] *= -1
    raw.wxyz[:, 2:] *= -1  # a turn about x stays, those about y and z go the other way
    raw.sh *= signs_of_harmonics(signs, raw.sh.shape[1])[:, None]


def axes_by_floor(raw: RawSplats) -> Axes | None:
    """Right, down, forward where a floor lies at the large end of y, right, up, back where at the
    small one; also where that end lies at zero, as of models that were stood on it.  None: neither,
    or the one against the other.
    """
    means, logs, opacity = filed_sample(raw)
    if len(means) < TELLING:
        return None
    low, high = np.percentile(means, (1, 99), axis=0)
    size = high - low
    if not (size > 0).all() or not np.isfinite(size).all():
        return None
    wide = wide_floor(means - low, size, shown_area(logs, opacity))
    on_zero = {
        FORMAT_AXES: abs(low[1]) <= ON_ZERO * size[1], PLY_AXES: abs(high[1]) <= ON_ZERO * size[1]
    }  # fmt: skip
    standing = next((name for name, stands in on_zero.items() if stands), None)
    if wide and standing in (None, wide):
        return Axes(wide, "as its floor lies", False)
    return Axes(standing, "as it stands on y = 0", False) if standing and not wide else None


def shown_area(logs: np.ndarray, opacity: np.ndarray) -> np.ndarray:
    """(S,) how much a splat shows; none counts for much more than the others."""
    area = np.sort(np.exp(np.clip(logs, -20, 20)), axis=1)[:, 1:].prod(axis=1)
    return np.minimum(area, np.percentile(area, 90)) * opacity


def wide_floor(places: np.ndarray, size: np.ndarray, shown: np.ndarray) -> str | None:
    """The axes of which a floor is at the lower end; places (S, 3) from the box's low corner.

    In a twentieth of the box's height (3,), near that end, lies a quarter of what shows (S,), over
    most of the footprint, and the other end has nothing as wide.
    """
    heights = (places[:, 1] / size[1] * BINS).clip(0, BINS - 1).astype(int)
    cells = np.floor(places[:, [0, 2]] / size[[0, 2]] * GRID).astype(int)
    inside = ((cells >= 0) & (cells < GRID)).all(axis=1)
    weight = np.bincount(heights, shown, BINS)
    found = {}
    for name, first, last in ((FORMAT_AXES, 0, ENDS), (PLY_AXES, BINS - ENDS, BINS)):
        slabs = weight[first : last - 1] + weight[first + 1 : last]
        at = first + int(slabs.argmax())
        slab = inside & ((heights == at) | (heights == at + 1))
        cover = len(np.unique(cells[slab] @ (GRID, 1))) / GRID**2
        found[name] = slabs.max(), cover
    for name, other in ((FORMAT_AXES, PLY_AXES), (PLY_AXES, FORMAT_AXES)):
        (share, cover), (share_there, cover_there) = found[name], found[other]
        wide = share >= LEAST_SHARE * weight.sum() > 0 and cover >= LEAST_COVER
        if wide and share_there <= share / 2 and cover_there <= MOST_OTHER_COVER:
            return name
    return None


def axes_by_cameras(raw: RawSplats, path: Path) -> Axes | None:
    """By cameras beside the file, which stand in the world of the PLY that it was made of.

    They see the scene as it is stored where nothing was turned, and turned over where it was.
    """
    for number, folder in enumerate(list(path.resolve().parents)[:CAMERA_FOLDERS]):
        for name in CAMERA_FILES if number == 0 else CAMERA_FILES[:1]:
            cameras = cameras_in(folder / name)
            if cameras is None:
                continue
            means, _, _ = filed_sample(raw)
            means = means[:: max(len(means) // MOST_SEEN, 1)]
            as_stored, turned = (part_seen(means * [1, s, s], *cameras) for s in (1, -1))
            reason = f"as the cameras of {name} see it"
            if as_stored >= SEEN and turned <= as_stored / 2:
                return Axes(PLY_AXES, reason, False)
            if turned >= SEEN and as_stored <= turned / 2:
                return Axes(FORMAT_AXES, reason, False)
    return None


def part_seen(means: np.ndarray, eyes: np.ndarray, ahead: np.ndarray) -> float:
    """How much of places (N, 3) a camera at (C, 3) has near the axis (C, 3) that it looks along."""
    if not len(means):
        return 0.0
    way = means[None] - eyes[:, None]  # (C, N, 3)
    along = np.einsum("cnk,ck->cn", way, ahead)
    return float((along > IN_VIEW * np.linalg.norm(way, axis=2)).mean())


def cameras_in(file: Path) -> tuple[np.ndarray, np.ndarray] | None:
    """Eyes (C, 3) and unit directions of view (C, 3) of 3DGS's cameras.json, or of nerfstudio's
    transforms.json; None where it is none of them."""
    if not file.is_file():
        return None
    try:
        data = read_json(file, most_bytes=MOST_CAMERA_BYTES)
        if isinstance(data, dict):
            frames = data["frames"]
            poses = np.array([frame["transform_matrix"] for frame in frames], np.float64)
            eyes, ahead = poses[:, :3, 3], -poses[:, :3, 2]  # x right, y up, z back
        else:
            eyes = np.array([row["position"] for row in data], np.float64)
            ahead = np.array([row["rotation"] for row in data], np.float64)[:, :, 2]
        length = np.linalg.norm(ahead, axis=1, keepdims=True)
        ahead = np.divide(ahead, length, out=np.full_like(ahead, np.nan), where=length > 0)
        whole = eyes.shape == ahead.shape == (len(eyes), 3)
        if not (whole and np.isfinite(eyes).all() and np.isfinite(ahead).all()):
            return None
    except (BadFile, OSError, KeyError, TypeError, ValueError, IndexError):
        return None  # no cameras, or broken ones: who reads them says so
    each = max(len(eyes) // MOST_CAMERAS, 1)
    return eyes[::each], ahead[::each]
