"""Metashape's cameras.xml (File, Export, Export Cameras, Agisoft XML), of PhotoScan as well.

Poses are camera to chunk with OpenCV axes; the transform of their component, or of the chunk, takes
them to its coordinate system: metres of the earth's middle where that is geographic or projected.
"""

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.colmap_tables import (
    BROWN,
    BROWN_EQUISOLID,
    BROWN_FISHEYE,
    ColmapCamera,
)
from shapeshift.scene.captures.foreign.foreign_frames import (
    Z_UP,
    Gathered,
    PhotoIndex,
    checked_lens,
    checked_size,
    geocentric_up,
)
from shapeshift.scene.captures.foreign.read_blocks import (
    number_of,
    numbers_in,
    read_xml,
    text_of,
)
from shapeshift.scene.captures.scans.posed_frames import PosedFrames

LENSES = {
    "frame": BROWN, "fisheye": BROWN_FISHEYE, "equidistant_fisheye": BROWN_FISHEYE,
    "equisolid_fisheye": BROWN_EQUISOLID,
}  # fmt: skip
NO_POSE = "are not aligned"
OF_A_RIG = "belong to a rig and have no pose of their own (export the cameras as COLMAP instead)"
NO_LENS = "have a lens that is not read here (cylindrical or RPC)"
MOST_SCALE = 1e12
DOWN = -0.7  # of the cameras' mean line of sight along z: photos from the air


def metashape_frames(path: Path, photos: PhotoIndex) -> PosedFrames:
    """Raises BadFile."""
    root = read_xml(path)
    chunks = [root] if root.tag == "chunk" else root.findall("chunk")
    with_cameras = [chunk for chunk in chunks if chunk.find("cameras") is not None]
    if not with_cameras:
        raise BadFile(f"{path} holds no chunk with cameras; in Metashape: File, Export Cameras")
    chunk = max(with_cameras, key=lambda c: len(list(cameras_of(c))))
    out = Gathered(path, "Metashape", photos)
    if len(with_cameras) > 1:
        out.doubts.append(
            f"The file has {len(with_cameras)} chunks; the one with most cameras is used, "
            f"{chunk.get('label', 'without a name')!r:.60}."
        )
    sensors = {s.get("id"): s for s in chunk.iterfind("sensors/sensor")}
    lenses: dict[str | None, ColmapCamera | None] = {}  # of those that are used
    worlds = transforms_of(chunk, str(path))
    poses = []
    for camera, group in cameras_of(chunk):
        label = camera.get("label") or ""
        where = f"{path}: camera {label!r:.60}"
        if not label:
            continue
        text = text_of(camera, "transform")
        if not text or camera.get("enabled") in ("false", "0"):
            out.leave(label, why_not(camera, text))
            continue
        number = camera.get("sensor_id")
        if number in sensors and number not in lenses:
            lenses[number] = lens_of(sensors[number], str(path))
        if (lens := lenses.get(number)) is None:
            out.leave(label, NO_LENS)
            continue
        matrix = np.array(numbers_in(text, 16, where)).reshape(4, 4)
        world = worlds.get(camera.get("component_id"), worlds[None])
        poses.append(pose := world @ matrix)
        out.add(label, pose, lens, hint=group)
    if poses:
        out.up = up_of(np.array(poses))
    return out.finished()


def why_not(camera: Element, pose: str) -> str:
    """Why a camera is not used."""
    if pose:
        return "are switched off"
    return OF_A_RIG if camera.get("master_id") not in (None, camera.get("id")) else NO_POSE


def cameras_of(chunk: Element) -> list[tuple[Element, str]]:
    """Cameras and the groups that they are in."""
    found = [(camera, "") for camera in chunk.iterfind("cameras/camera")]
    for group in chunk.iterfind("cameras/group"):
        found += [(camera, group.get("label", "")) for camera in group.iterfind("camera")]
    return found


def transforms_of(chunk: Element, where: str) -> dict[str | None, np.ndarray]:
    """By the component's number; None: of the chunk, for cameras of no component."""
    out: dict[str | None, np.ndarray] = {None: transform_of(chunk.find("transform"), where)}
    for component in chunk.iterfind("components/component"):
        if component.find("transform") is not None:
            out[component.get("id")] = transform_of(component.find("transform"), where)
    return out


def transform_of(element: Element | None, where: str) -> np.ndarray:
    """(4, 4) scale, turn and shift; as it is without one."""
    out = np.eye(4)
    if element is None:
        return out
    if text := text_of(element, "rotation"):
        out[:3, :3] = np.array(numbers_in(text, 9, f"{where}: rotation")).reshape(3, 3)
    scale = number_of(element, "scale", where, 1.0)
    if not 0 < scale < MOST_SCALE:
        raise BadFile(f"{where}: scale is {scale:g}; a number above 0 is wanted")
    out[:3, :3] *= scale
    if text := text_of(element, "translation"):
        out[:3, 3] = numbers_in(text, 3, f"{where}: translation")
    return out


def lens_of(sensor: Element, where: str) -> ColmapCamera | None:
    """By the manual's formula; None of what is no lens of these."""
    where = f"{where}: sensor {sensor.get('label', '')!r:.60}"
    each = sensor.findall("calibration")
    chosen = [c for c in each if c.get("class") == "adjusted"] or each
    resolution = sensor.find("resolution")
    if resolution is None and chosen:
        resolution = chosen[0].find("resolution")
    if resolution is None:
        return None
    width, height = (whole(resolution.get(key)) for key in ("width", "height"))
    size = checked_size(width, height, where)
    if sensor.get("type") == "spherical":
        return ColmapCamera.panorama(size)
    kind = chosen[0].get("type", sensor.get("type", "frame")) if chosen else ""
    if kind == "frame":  # a calibration may say less than its sensor
        kind = sensor.get("type", "frame")
    if kind not in LENSES:
        return None
    calibration = chosen[0]

    def number(name: str) -> float:
        return number_of(calibration, name, where, 0.0)

    if text_of(calibration, "f"):
        f = number("f")
        fx, fy, skew = f + number("b1"), f, number("b2")
    else:  # of PhotoScan before 1.2
        fx, fy, skew = number("fx"), number("fy"), number("skew")
    centre = [size[i] / 2 + number(key) for i, key in enumerate(("cx", "cy"))]
    if not text_of(calibration, "f") and text_of(calibration, "cx"):
        centre = [number("cx"), number("cy")]
    bends = [number(key) for key in ("k1", "k2", "k3", "k4")]
    # Its P1 goes with x: OpenCV's p2.
    bends += [number(key) for key in ("p2", "p1", "p3", "p4")]
    return checked_lens(LENSES[kind], size, (fx, fy, *centre, *bends, skew / (fx or 1)), where)


def whole(text: str | None) -> float | str | None:
    return int(text) if text is not None and text.isdecimal() and len(text) < 8 else text


def up_of(poses: np.ndarray) -> tuple[float, float, float] | None:
    """What points up: away from the earth's middle, or against a line of sight from the air."""
    if (up := geocentric_up(poses[:, :3, 3])) is not None:
        return up
    ahead = poses[:, :3, 2]
    length = np.linalg.norm(ahead, axis=1)
    mean = (ahead / np.where(length > 0, length, 1)[:, None]).mean(axis=0)
    return Z_UP if mean[2] < DOWN else None
