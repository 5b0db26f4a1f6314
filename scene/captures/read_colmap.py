"""A COLMAP folder (sparse/0 and images/, text or binary) -> Capture."""

from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.stop_names import guess_kind
from shapeshift.scene.cameras.read_colmap_cameras import camera_pose
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.capture_rules import (
    COLMAP_UP,
    CaptureWorld,
    background_from,
    counts_from,
    image_size,
    split_every_8th,
    spread_stops,
    stops_from,
    with_counts,
)
from shapeshift.scene.captures.colmap_points import read_colmap_points
from shapeshift.scene.captures.colmap_tables import Lens, find_model, read_tables
from shapeshift.scene.captures.read_transforms import STRAIGHT, read_json
from shapeshift.scene.json.json_values import shortened, shown, text_in
from shapeshift.scene.pose import View


def read_colmap(folder: Path) -> Capture:
    """Sub-folders of images/ are modalities; capture.json may say more (docs/capture.md)."""
    model, ending = find_model(folder)
    lenses, images = read_tables(model, ending)
    posed = sorted(images, key=lambda image: image.name)
    root = folder / "images" if (folder / "images").is_dir() else folder
    said = read_json(folder / "capture.json") if (folder / "capture.json").is_file() else {}
    stops, modality_of = modalities(said, [i.name for i in posed], folder)
    cameras = [camera_pose(image, f"{folder}: {image.name}") for image in posed]
    world = CaptureWorld.of(np.array(cameras), COLMAP_UP, said.get("up", COLMAP_UP), str(folder))
    photos = []
    for image, world_from_camera in zip(posed, cameras, strict=True):
        lens, path = lenses[image.lens], root / image.name
        if not path.is_file():
            raise BadFile(f"{path}: the image file is missing; put it there or drop it from COLMAP")
        size = image_size(path, lens.size)
        focal, centre = pinhole(lens, f"{folder}: camera {image.lens}")
        mask = find_mask(folder, image.name)
        if mask is not None:
            image_size(mask, size)
        view = View.from_pinhole(world.turned(world_from_camera), focal, centre, size)
        photos.append(Photo(view, path, modality_of[image.name], mask))
    xyz, rgb = read_colmap_points(model / f"points3D{ending}")
    points, colors = (xyz, rgb.astype(np.float32) / 255) if len(xyz) else (None, None)
    counts = counts_from(said.get("modalities"), f"{folder}/capture.json")
    photos = with_counts(split_every_8th(photos), counts)
    background = background_from(said, f"{folder}/capture.json")
    guessed = not said.get("modalities")
    return world.capture(folder, stops, photos, points, colors, background, guessed)


def modalities(
    said: dict, names: list[str], folder: Path
) -> tuple[tuple[Stop, ...], dict[str, str]]:
    """Stops, and image name -> stop name, from capture.json or else from the sub-folders."""
    if not said.get("modalities"):
        first = {n: n.split("/")[0] if "/" in n else "RGB" for n in names}
        # Visible light first, then heat, then the rest by name.
        order = {"rgb": 0, "thermal": 1, "layer": 2}
        found = sorted(set(first.values()), key=lambda n: (order[guess_kind(n, 2)], n))
        return spread_stops(found), first
    where, entries = f"{folder}/capture.json", said["modalities"]
    stops = stops_from(entries, where)
    of = {}
    for stop, entry in zip(stops, entries, strict=True):
        prefix = text_in(entry, "folder", where, stop.name).rstrip("/") + "/"
        mine = [n for n in names if n.startswith(prefix)]
        if not mine:
            raise BadFile(
                f"{where}: modality {shown(stop.name)} has no images under "
                f"images/{shortened(prefix)}; add them to the COLMAP model or drop the modality"
            )
        of |= dict.fromkeys(mine, stop.name)
    left = sorted(set(names) - set(of))
    if left:
        raise BadFile(f"{where}: image {left[0]} belongs to no listed modality")
    return tuple(sorted(stops, key=lambda s: s.x)), of


def pinhole(lens: Lens, where: str) -> tuple[tuple, tuple]:
    """(fx, fy), (cx, cy) of a camera without distortion, or with less than half a pixel."""
    import pycolmap

    width, height = lens.size
    focal, centre = lens.focal, lens.centre
    if not all(0 < f < np.inf for f in focal):
        raise BadFile(f"{where} has focal lengths {focal}; both must be above 0")
    camera = pycolmap.Camera(model=lens.model, width=width, height=height, params=lens.params)
    x, y = np.meshgrid([0, width / 2, width], [0, height / 2, height])
    corners = np.stack([x.ravel(), y.ravel()], axis=1)
    with np.errstate(over="ignore", invalid="ignore"):  # then the shift is NaN: refused
        straight = np.concatenate([(corners - centre) / focal, np.ones((9, 1))], axis=1)
        shift = np.abs(camera.img_from_cam(straight) - corners).max()
    if not shift <= STRAIGHT:
        raise BadFile(
            f"{where} ({lens.model}) shifts corners by {shift:.1f} pixels; undistort first: "
            "colmap image_undistorter --image_path images --input_path sparse/0 --output_path out"
        )
    return focal, centre


def find_mask(folder: Path, name: str) -> Path | None:
    """COLMAP's masks/NAME.jpg.png, or masks/NAME.png."""
    for path in (folder / "masks" / f"{name}.png", (folder / "masks" / name).with_suffix(".png")):
        if path.is_file():
            return path
    return None
