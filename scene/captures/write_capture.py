"""Writes a capture in our own form: transforms.json beside its photos (docs/capture.md)."""

import json
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.npy import write_arrays
from shapeshift.runtime_models.files.whole_file import whole_file, write_whole
from shapeshift.runtime_models.package.write_package import describe_stop
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.capture_rules import OWN_FORM
from shapeshift.scene.captures.radiometric.no_value import SAID_NOTHING

VERSION = 1


def write_capture(capture: Capture) -> Path:
    """Writes transforms.json and points.npz into capture.folder; the photos are there already.

    Returns the path of transforms.json.  Paths in it are relative to the folder.
    """
    folder = capture.folder
    data = {
        "format": OWN_FORM,
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
            | no_value_of(capture, stop.name)
            | band_of(capture, stop.name)
            | ({"date": stop.date} if stop.date else {})
            for stop in capture.stops
        ]
        + [describe_stop(stop) for stop in capture.formulas],
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


def band_of(capture: Capture, modality: str) -> dict:
    """Which band of their files a modality's photos are."""
    band = next((p.band for p in capture.photos if p.modality == modality), 0)
    return {"band": band} if band else {}


def no_value_of(capture: Capture, modality: str) -> dict:
    """What a modality's photos, which share it, say of numbers that are no values."""
    said = next((p.no_value for p in capture.photos if p.modality == modality), SAID_NOTHING)
    out: dict = {"no_data": list(said.numbers)} if said.numbers else {}
    return out | ({"valid_range": list(said.valid_range)} if said.valid_range else {})


def frame(photo: Photo, folder: Path) -> dict:
    out = {
        "file_path": photo.path.relative_to(folder).as_posix(),
        "modality": photo.modality,
        "split": photo.split,
        "transform_matrix": photo.view.world_from_eye.matrix().tolist(),
        "w": photo.file_size[0],
        "h": photo.file_size[1],
    }
    out |= intrinsics(photo)
    if photo.mask is not None:
        out["mask_path"] = photo.mask.relative_to(folder).as_posix()
        out["mask_means"] = photo.mask_means
    if photo.depth is not None:
        out["depth_path"] = photo.depth.relative_to(folder).as_posix()
        out["depth_unit"] = photo.depth_unit
        if photo.float_depth_unit != 1:
            out["depth_unit_scale_factor"] = photo.float_depth_unit
    if photo.normals is not None:
        out["normal_path"] = photo.normals.relative_to(folder).as_posix()
        out["normal_convention"] = photo.normal_axes
    return out


def intrinsics(photo: Photo) -> dict:
    """Of the photo's file.  Raises ValueError for lenses that the form has no numbers for."""
    names = ("fl_x", "fl_y", "cx", "cy")
    if photo.lens is None:
        return dict(zip(names, photo.view.pinhole()[1:], strict=True))
    model, params = photo.lens.model, photo.lens.params
    if model == "OPENCV_FISHEYE":
        numbers = dict(zip((*names, "k1", "k2", "k3", "k4"), params, strict=True))
        return numbers | {"camera_model": model}
    if model not in ("OPENCV", "FULL_OPENCV") or any(params[9:]):
        raise ValueError(f"{photo.path}: a lens of model {model} cannot be written.")
    numbers = dict(zip((*names, "k1", "k2", "p1", "p2", "k3"), params, strict=False))
    return numbers | {"camera_model": "OPENCV"}


def write_points(path: Path, capture: Capture) -> None:
    arrays: dict[str, np.ndarray] = {"xyz": np.asarray(capture.points, np.float32)}
    if capture.point_colors is not None:
        arrays["rgb"] = np.round(np.asarray(capture.point_colors) * 255).astype(np.uint8)
    with whole_file(path) as file:
        write_arrays(file, arrays)
