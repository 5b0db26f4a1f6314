"""Small captures on disk for the tests of the readers."""

import json
from pathlib import Path

import numpy as np
import pycolmap
from PIL import Image

from shapeshift.scene.cameras.upright import upright_rotation
from shapeshift.scene.pose import OPENCV_FROM_EYE, View, look_at

RANDOM = np.random.default_rng(7)
CLOUD = RANDOM.normal(0, 0.3, (20, 3))


def save_image(path: Path, size=(16, 12), seed=0, mode="RGB") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    channels = {"RGB": 3, "RGBA": 4}.get(mode)
    shape = (size[1], size[0]) if channels is None else (size[1], size[0], channels)
    pixels = np.random.default_rng(seed).integers(0, 256, shape, np.uint8)
    Image.fromarray(pixels, mode).save(path)
    return path


def opencv_pose(i: int, up=(0.0, -1.0, 0.0)) -> np.ndarray:
    """(4, 4) world_from_camera of a camera on a circle round the origin in a world with that up."""
    side = np.array([np.cos(i), 0.4, np.sin(i)]) * 3
    eye = upright_rotation(up, "test")[:3, :3].T @ side
    return look_at(eye, np.zeros(3), up).matrix() @ OPENCV_FROM_EYE


def projected(view: View, points: np.ndarray) -> np.ndarray:
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    p = points @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
    return np.stack([fx * p[:, 0] / p[:, 2] + cx, fy * p[:, 1] / p[:, 2] + cy], axis=1)


def write_transforms(folder: Path, frames: list[dict], **more) -> Path:
    path = folder / "transforms.json"
    path.write_text(json.dumps({"frames": frames} | more))
    return path


def simple(folder: Path, count: int = 4, **more) -> tuple[list[dict], dict]:
    """Frames of a nerfstudio file with its images, and what it says for all of them."""
    frames = []
    for i in range(count):
        save_image(folder / f"images/{i:03}.png", seed=i)
        pose = opencv_pose(i, (0.0, 0.0, 1.0)) @ OPENCV_FROM_EYE
        frames.append({"file_path": f"images/{i:03}.png", "transform_matrix": pose.tolist()})
    return frames, {"fl_x": 20.0, "w": 16, "h": 12} | more


def whole(folder: Path) -> tuple[list[dict], dict]:
    """The same with every key that our own form has, with masks and points."""
    frames, _ = simple(folder, 3)
    rng = np.random.default_rng(0)
    points = rng.normal(size=(20, 3)).astype(np.float32)
    colors = rng.integers(0, 256, (20, 3), np.uint8)
    np.savez_compressed(folder / "points.npz", xyz=points, rgb=colors)
    Image.new("L", (16, 12), 255).save(folder / "mask.png")
    lens = {"w": 16, "h": 12, "fl_x": 20.0, "fl_y": 21, "cx": 8, "cy": 6.0, "k1": 0.0, "p2": 0}
    for frame, modality in zip(frames, ("RGB", "Heat", "RGB"), strict=True):
        frame |= lens | {"modality": modality, "mask_path": "mask.png", "split": "train"}
    heat = {"name": "Heat", "x": 1, "kind": "thermal", "palette": "ironbow",
            "value_range": [10, 60], "unit": "K"}  # fmt: skip
    return frames, {
        "format": "shapeshift-capture", "version": 1, "convention": "opengl", "up": [0, 0, 1],
        "background": [0, 0.5, 1], "points": "points.npz", "notes": {"by": "hand"},
        "modalities": [{"name": "RGB", "x": 0.0, "kind": "rgb"}, heat],
    }  # fmt: skip


def colmap_model(folder: Path, text: bool, model="SIMPLE_PINHOLE", params=(20.0, 8.0, 6.0)):
    """Four colour photos and three thermal ones of another size, posed apart from each other."""
    model_folder = folder / "sparse" / "0"
    model_folder.mkdir(parents=True)
    out = pycolmap.Reconstruction()
    sizes = {1: (16, 12), 2: (10, 8)}
    kinds = {1: (model, params), 2: ("PINHOLE", (15.0, 14.0, 5.5, 4.0))}
    for number, (kind, values) in kinds.items():
        width, height = sizes[number]
        camera = pycolmap.Camera(
            model=kind, width=width, height=height, params=values, camera_id=number
        )
        out.add_camera_with_trivial_rig(camera)
    names = [f"rgb/{i}.png" for i in range(4)] + [f"thermal/{i}.png" for i in range(3)]
    for i, name in enumerate(names):
        number = 1 if name.startswith("rgb") else 2
        grey = number == 2
        save_image(folder / "images" / name, sizes[number], i, "L" if grey else "RGB")
        camera_from_world = pycolmap.Rigid3d(np.linalg.inv(opencv_pose(i))[:3])
        image = pycolmap.Image(name=name, camera_id=number, image_id=i + 1)
        out.add_image_with_trivial_frame(image, camera_from_world)
    for xyz in CLOUD:
        out.add_point3D(xyz, pycolmap.Track(), np.array([255, 128, 0], np.uint8))
    (out.write_text if text else out.write_binary)(model_folder)
    return out
