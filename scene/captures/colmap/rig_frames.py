"""Poses that stand in a second place: COLMAP's frames (3.12 on), and text beside binary tables."""

import mmap
import struct
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.colmap.text_lines import AGAIN, image_rows, numbers_of, rows_of_table
from shapeshift.scene.captures.colmap_tables import COUNT, Posed, count_of, mapped, short_of
from shapeshift.scene.pose import Pose

TABLES = ("rigs", "frames")  # beside the three that every version writes
CAMERA = 0  # the sensor type of a photo; 1 is an accelerometer
RIG, FRAME = struct.Struct("<II"), struct.Struct("<II7dI")
SENSOR, DATUM, POSE = struct.Struct("<iI"), struct.Struct("<iIQ"), struct.Struct("<7d")
TURN = 1e-3  # of a rotation's entries, and of the distance from the eyes' middle: more is another
MOST_TEXT = 1 << 26  # bytes of a table of text that is read to be compared
Sensors = dict[tuple[int, int], np.ndarray]  # (rig, camera) -> (4, 4) camera from rig


def refused_poses(folder: Path, ending: str, posed: list[Posed]) -> tuple[str, ...]:
    """A sentence where the frames beside a model put its images elsewhere than these say.

    posed: whose poses are known to be some.
    """
    frames, rigs = folder / f"frames{ending}", folder / f"rigs{ending}"
    if not (frames.is_file() and rigs.is_file()):
        return ()
    try:
        found = frame_poses(rigs, frames)
    except BadFile as error:
        return (f"What its frames say is not known, and not needed: {error}",)
    other = with_other_pose(posed, found)
    if not other:
        return ()
    return (
        f"{len(other)} of {len(posed)} images have another pose in images{ending} than in "
        f"frames{ending} beside it, for example {path_end(other[0].name)}; that of images{ending} "
        f"is taken, COLMAP takes the other: remove rigs{ending} and frames{ending} if they are "
        "older.",
    )


def refused_text(folder: Path, ending: str, posed: list[Posed]) -> tuple[str, ...]:
    """A sentence where tables of text beside binary ones, which are read, are of other images."""
    path = folder / "images.txt"
    if ending != ".bin" or not path.is_file() or path.stat().st_size > MOST_TEXT:
        return ()
    try:
        found = {int(v[0]): (v, name) for v, name in image_rows(path)}
    except BadFile as error:
        return (f"images.bin is read, and what lies beside it is not: {error}",)
    as_text = {n: Posed(n, "", tuple(v[1:5]), tuple(v[5:8]), 0) for n, (v, _) in found.items()}
    poses = {n: p.camera_from_world() for n, p in as_text.items() if p.length > 0}
    other = with_other_pose(posed, poses)
    more = len(found.keys() - {image.number for image in posed})
    if not (other or more):
        return ()
    return (
        f"images.bin is read, as COLMAP does, and images.txt beside it is not, which has {more} "
        f"images more and {len(other)} that are missing or have another pose; remove the tables "
        "that are older.",
    )


def with_other_pose(posed: list[Posed], found: dict[int, np.ndarray]) -> list[Posed]:
    """Those whose pose is another in `found`, (4, 4) camera from world by number, or not there."""
    ours = np.array([image.camera_from_world() for image in posed])
    theirs = np.array([found.get(image.number, np.full((4, 4), np.nan)) for image in posed])
    eyes = [-np.einsum("nji,nj->ni", m[:, :3, :3], m[:, :3, 3]) for m in (ours, theirs)]
    spread = float(np.linalg.norm(eyes[0] - np.median(eyes[0], axis=0), axis=1).max())
    same = np.abs(ours[:, :3, :3] - theirs[:, :3, :3]).max(axis=(1, 2)) <= TURN
    same &= np.linalg.norm(eyes[0] - eyes[1], axis=1) <= TURN * max(spread, TURN)
    return [image for image, alike in zip(posed, same, strict=True) if not alike]


def frame_poses(rigs: Path, frames: Path) -> dict[int, np.ndarray]:
    """(4, 4) camera from world of each image, by its number.  Raises BadFile."""
    if frames.suffix == ".bin":
        with mapped(rigs) as rig_bytes, mapped(frames) as frame_bytes:
            return poses_of_bytes(frame_bytes, frames, sensors_of_bytes(rig_bytes, rigs))
    return poses_of_text(frames, sensors_of_text(rigs))


def sensors_of_bytes(data: bytes | mmap.mmap, path: Path) -> Sensors:
    found: Sensors = {}
    count, at = count_of(data, RIG.size, path), COUNT.size
    try:
        for _ in range(count):
            rig, sensors = RIG.unpack_from(data, at)
            at += RIG.size
            for number in range(sensors):
                kind, sensor = SENSOR.unpack_from(data, at)
                at += SENSOR.size
                pose = np.eye(4)
                if number > 0:  # the first is the rig's own origin
                    posed, at = data[at] != 0, at + 1
                    if not posed:
                        continue
                    pose, at = matrix_of(POSE.unpack_from(data, at)), at + POSE.size
                if kind == CAMERA:
                    found[rig, sensor] = pose
    except (struct.error, IndexError):
        raise short_of(path, count, "rigs") from None
    return found


def poses_of_bytes(data: bytes | mmap.mmap, path: Path, sensors: Sensors) -> dict[int, np.ndarray]:
    found: dict[int, np.ndarray] = {}
    count, at = count_of(data, FRAME.size, path), COUNT.size
    try:
        for _ in range(count):
            _, rig, *values, images = FRAME.unpack_from(data, at)
            at += FRAME.size
            rig_from_world = matrix_of(values)
            for _ in range(images):
                kind, sensor, image = DATUM.unpack_from(data, at)
                at += DATUM.size
                if kind == CAMERA and (rig, sensor) in sensors:
                    found[image] = sensors[rig, sensor] @ rig_from_world
    except struct.error:
        raise short_of(path, count, "frames") from None
    return found


def sensors_of_text(path: Path) -> Sensors:
    found: Sensors = {}
    for where, words in rows_of_table(path):
        rig = whole(words[0], where)
        left = iter(words[2:])
        first = True
        for kind in left:
            sensor, pose = whole(next(left, b""), where), np.eye(4)
            if not first:
                if next(left, b"") != b"1":
                    continue
                pose = matrix_of(numbers_of([next(left, b"") for _ in range(7)], where))
            first = False
            if kind == b"CAMERA":
                found[rig, sensor] = pose
    return found


def poses_of_text(path: Path, sensors: Sensors) -> dict[int, np.ndarray]:
    found: dict[int, np.ndarray] = {}
    for where, words in rows_of_table(path):
        if len(words) < 10:
            raise BadFile(f"{where}: two numbers, a pose and its images wanted; {AGAIN}.")
        rig, rig_from_world = whole(words[1], where), matrix_of(numbers_of(words[2:9], where))
        for kind, sensor, image in zip(words[10::3], words[11::3], words[12::3], strict=False):
            key = rig, whole(sensor, where)
            if kind == b"CAMERA" and key in sensors:
                found[whole(image, where)] = sensors[key] @ rig_from_world
    return found


def whole(word: bytes, where: str) -> int:
    if not (word.isdigit() and len(word) < 20):
        raise BadFile(f"{where}: what should be a whole number is not; {AGAIN}.")
    return int(word)


def matrix_of(values: object) -> np.ndarray:
    """(4, 4) of a quaternion and a place; NaN where that is no turn."""
    wxyz, place = np.split(np.array(values, np.float64), [4])
    with np.errstate(all="ignore"):
        return Pose(place, wxyz / np.linalg.norm(wxyz)).matrix()
