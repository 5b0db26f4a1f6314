"""Writes a capture in our own form: transforms.json beside its photos (docs/capture.md)."""

import json
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.whole_file import whole_file, write_whole
from shapeshift.scene.captures.capture import Capture, Photo

FORMAT = "shapeshift-capture"
VERSION = 1


def write_capture(capture: Capture) -> Path:
    """Writes transforms.json and points.npz into capture.folder; the photos are there already.

    Returns the path of transforms.json.  Paths in it are relative to the folder.
    """
    folder = capture.folder
    data = {
        "format": FORMAT,
        "version": VERSION,
        "convention": "opengl",
        "up": [0, 1, 0],
        "background": list(capture.background) if capture.background else None,
        "points": "points.npz" if capture.points is not None else None,
        "notes": capture.notes,
        "modalities": [
            {
                "name": stop.name,
                "x": stop.x,
                "kind": stop.kind,
                "palette": stop.palette,
                "value_range": list(stop.value_range) if stop.value_range else None,
                "unit": stop.unit,
                "counts": counts_of(capture, stop.name),
            }
            for stop in capture.stops
        ],
        "frames": [frame(photo, folder) for photo in capture.photos],
    }
    if capture.points is not None:
        write_points(folder / "points.npz", capture)
    target = folder / "transforms.json"
    write_whole(target, json.dumps(data, indent=1, ensure_ascii=False).encode())
    return target


def counts_of(capture: Capture, modality: str) -> list[float] | None:
    """Of a modality's photos, which share them."""
    counts = next((p.counts for p in capture.photos if p.modality == modality), None)
    return None if counts is None else list(counts)


def frame(photo: Photo, folder: Path) -> dict:
    _, fx, fy, cx, cy = photo.view.pinhole()
    out = {
        "file_path": photo.path.relative_to(folder).as_posix(),
        "modality": photo.modality,
        "split": photo.split,
        "transform_matrix": photo.view.world_from_eye.matrix().tolist(),
        "w": photo.view.size[0],
        "h": photo.view.size[1],
        "fl_x": fx,
        "fl_y": fy,
        "cx": cx,
        "cy": cy,
    }
    if photo.mask is not None:
        out["mask_path"] = photo.mask.relative_to(folder).as_posix()
    if photo.depth is not None:
        out["depth_path"] = photo.depth.relative_to(folder).as_posix()
        out["depth_unit"] = photo.depth_unit
    return out


def write_points(path: Path, capture: Capture) -> None:
    arrays = {"xyz": np.asarray(capture.points, np.float32)}
    if capture.point_colors is not None:
        arrays["rgb"] = np.round(np.asarray(capture.point_colors) * 255).astype(np.uint8)
    with whole_file(path) as file:
        np.savez_compressed(file, **arrays)
