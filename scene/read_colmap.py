"""A COLMAP folder (sparse/0 and images/, text or binary) -> Capture."""

from pathlib import Path

import numpy as np

from runtime_models.model import BadFile, Stop
from runtime_models.stop_names import guess_kind
from scene.capture import Capture, Photo
from scene.capture_rules import (
    COLMAP_UP,
    CaptureWorld,
    image_size,
    rigid,
    split_every_8th,
    spread_stops,
    stop_from,
)
from scene.colmap_tables import TABLES, check_points, find_model, read_tables
from scene.pose import View
from scene.read_transforms import STRAIGHT, read_json


def read_colmap(folder: Path) -> Capture:
    """Sub-folders of images/ are modalities; capture.json may say more (docs/capture.md)."""
    model = load_model(*find_model(folder))
    posed = sorted((i for i in model.images.values() if i.has_pose), key=lambda i: i.name)
    if not posed:
        raise BadFile(f"{folder}: the COLMAP model holds no posed image; run the mapper again")
    root = folder / "images" if (folder / "images").is_dir() else folder
    said = read_json(folder / "capture.json") if (folder / "capture.json").is_file() else {}
    stops, modality_of = modalities(said, [i.name for i in posed], folder)
    cameras = [rigid(i.cam_from_world().inverse().matrix(), f"{folder}: {i.name}") for i in posed]
    world = CaptureWorld.of(np.array(cameras), COLMAP_UP, said.get("up", COLMAP_UP), str(folder))
    photos = []
    for image, world_from_camera in zip(posed, cameras, strict=True):
        camera, path = model.cameras[image.camera_id], root / image.name
        if not path.is_file():
            raise BadFile(f"{path}: the image file is missing; put it there or drop it from COLMAP")
        size = image_size(path, (camera.width, camera.height))
        focal, centre = pinhole(camera, f"{folder}: camera {image.camera_id}")
        mask = find_mask(folder, image.name)
        if mask is not None:
            image_size(mask, size)
        view = View.from_pinhole(world.turned(world_from_camera), focal, centre, size)
        photos.append(Photo(view, path, modality_of[image.name], mask))
    cloud = [model.points3D[i] for i in sorted(model.points3D)]
    points = np.array([p.xyz for p in cloud]) if cloud else None
    colors = np.array([p.color for p in cloud], np.float32) / 255 if cloud else None
    photos = split_every_8th(photos)
    background, guessed = said.get("background"), not said.get("modalities")
    return world.capture(folder, stops, photos, points, colors, background, guessed)


def load_model(folder: Path, ending: str):
    """pycolmap's Reconstruction; the counts are checked first, which it takes memory for."""
    import pycolmap

    missing = [t + ending for t in TABLES if not (folder / (t + ending)).is_file()]
    if missing:
        raise BadFile(f"{folder}: {', '.join(missing)} missing; copy the whole COLMAP model")
    read_tables(folder, ending)
    if ending == ".bin":
        check_points(folder / "points3D.bin")
    try:
        return pycolmap.Reconstruction(folder)
    except (RuntimeError, ValueError, IndexError, MemoryError) as error:
        text = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise BadFile(f"{folder}: not a readable COLMAP model ({text}); export it again") from None


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
    entries = said["modalities"]
    stops = [stop_from(e, f"{folder}/capture.json") for e in entries]
    of = {}
    for stop, entry in zip(stops, entries, strict=True):
        prefix = entry.get("folder", stop.name).rstrip("/") + "/"
        mine = [n for n in names if n.startswith(prefix)]
        if not mine:
            raise BadFile(
                f"{folder}/capture.json: modality {stop.name!r} has no images under "
                f"images/{prefix}; add them to the COLMAP model or drop the modality"
            )
        of |= dict.fromkeys(mine, stop.name)
    left = sorted(set(names) - set(of))
    if left:
        raise BadFile(f"{folder}/capture.json: image {left[0]} belongs to no listed modality")
    return tuple(sorted(stops, key=lambda s: s.x)), of


def pinhole(camera, where: str) -> tuple[tuple, tuple]:
    """(fx, fy), (cx, cy) of a camera without distortion, or with less than half a pixel."""
    focal = (camera.focal_length_x, camera.focal_length_y)
    centre = (camera.principal_point_x, camera.principal_point_y)
    if not all(0 < f < np.inf for f in focal):
        raise BadFile(f"{where} has focal lengths {focal}; both must be above 0")
    x, y = np.meshgrid([0, camera.width / 2, camera.width], [0, camera.height / 2, camera.height])
    corners = np.stack([x.ravel(), y.ravel()], axis=1)
    straight = np.concatenate([(corners - centre) / focal, np.ones((9, 1))], axis=1)
    shift = np.abs(camera.img_from_cam(straight) - corners).max()
    if not shift <= STRAIGHT:
        raise BadFile(
            f"{where} ({camera.model_name}) shifts corners by {shift:.1f} pixels; undistort first: "
            "colmap image_undistorter --image_path images --input_path sparse/0 --output_path out"
        )
    return focal, centre


def find_mask(folder: Path, name: str) -> Path | None:
    """COLMAP's masks/NAME.jpg.png, or masks/NAME.png."""
    for path in (folder / "masks" / f"{name}.png", (folder / "masks" / name).with_suffix(".png")):
        if path.is_file():
            return path
    return None
