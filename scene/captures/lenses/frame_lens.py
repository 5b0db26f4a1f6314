"""The lens of a frame in transforms.json, in the words of nerfstudio, instant-ngp and Blender."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from shapeshift.runtime_models.files.json_fields import Fields
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.capture_photos import image_size
from shapeshift.scene.captures.capture_rules import LARGEST_NUMBER
from shapeshift.scene.captures.colmap_tables import (
    BROWN,
    BROWN_FISHEYE,
    PANORAMA,
    ColmapCamera,
)
from shapeshift.scene.captures.lenses.panorama import PANORAMAS, VR180

NUMBERS = ("fl_x", "fl_y", "x_fov", "y_fov", "camera_angle_x", "camera_angle_y", "cx", "cy",
           "k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "w", "h")  # fmt: skip
BENDS = ("k1", "k2", "k3", "k4", "p1", "p2")  # nerfstudio's order in 'distortion_params'
ARIA = 12  # numbers of FISHEYE624: k0 to k5, p0, p1, s0 to s3
# Models of COLMAP whose numbers have no names in JSON that anybody writes.
NOT_IN_JSON = ("FOV", "THIN_PRISM_FISHEYE", "SIMPLE_DIVISION", "DIVISION", "EUCM")


def lens_of(entry: Mapping, path: Path, where: str) -> ColmapCamera:
    """The lens as the file states it, of the size that it states, else of the photo's.

    Of a panorama one whose focal lengths are pixels a radian.  Raises BadFile.
    """
    if isinstance(lens := entry.get("lens"), ColmapCamera):  # of another program; JSON has none
        return lens
    fields = Fields(entry, where)
    for key in filter(entry.__contains__, NUMBERS):
        fields.number(key, 0.0, low=-LARGEST_NUMBER, high=LARGEST_NUMBER)
    if "w" in entry and "h" in entry:
        width, height = size = int(entry["w"]), int(entry["h"])
        if not (width >= 1 and height >= 1 and size == (entry["w"], entry["h"])):
            raise BadFile(f"{where}: 'w' and 'h' are {entry['w']:g} and {entry['h']:g}, not pixels")
    else:
        width, height = size = image_size(path, None)
    model = str(entry.get("camera_model", "")).upper()
    if model == "ORTHOPHOTO":
        raise BadFile(
            f"{where} is of camera model ORTHOPHOTO, whose rays are side by side; training draws "
            "in perspective, so give it the photos that the orthophoto was made of"
        )
    if model in NOT_IN_JSON:
        raise BadFile(
            f"{where} is of camera model {model}, whose numbers are not read from JSON; give the "
            "COLMAP model (sparse/0), or undistort the photos"
        )
    if model in PANORAMAS:
        return panorama_lens(model, size, fields)
    fx, fy = focal_lengths(entry, size, where)
    pinhole = (fx, fy, float(entry.get("cx", width / 2)), float(entry.get("cy", height / 2)))
    return bent_lens(model, size, pinhole, fields)


def panorama_lens(model: str, size: tuple[int, int], fields: Fields) -> ColmapCamera:
    """Pixels a radian, and the middle, as nerfstudio means them: 'fl_x' of a whole one is half its
    width, for half a turn; that of VR180 half its width, too, for a quarter.  'fl_y': the height.
    """
    (width, height), entry, where = size, fields.data, fields.where
    if model.startswith(VR180):
        usual = (width / 2, float(height))
    elif abs(width - 2 * height) <= 1:
        return replace(ColmapCamera.panorama(size), model=model)
    elif model == PANORAMA and "fl_x" in entry:
        usual = (float(entry["fl_x"]), float(entry["fl_x"]))
    else:
        raise BadFile(
            f"{where} is a panorama of {width}x{height} pixels; whole ones, twice as wide as high, "
            "are read, and parts of them with 'fl_x': the pixels of half a turn"
        )
    across, down = (
        float(entry.get(key, value)) for key, value in zip(("fl_x", "fl_y"), usual, strict=True)
    )
    fx, fy = across * (2 if model.startswith(VR180) else 1) / math.pi, down / math.pi
    if not (2 * math.pi * fx >= width - 1 and math.pi * fy >= height - 1):
        raise BadFile(
            f"{where} is a panorama of more than 360 by 180 degrees; check its 'fl_x' and 'fl_y', "
            "the pixels of half a turn"
        )
    centre = (float(entry.get("cx", width / 2)), float(entry.get("cy", height / 2)))
    return ColmapCamera(model, size, (fx, fy, *centre))


def bent_lens(
    model: str, size: tuple[int, int], pinhole: tuple[float, ...], fields: Fields
) -> ColmapCamera:
    """The lens with its distortion: numbers of their own, or nerfstudio's list of them."""
    entry, fisheye = fields.data, "FISHEYE" in model or fields.data.get("is_fisheye") is True
    crop = fields.number("fisheye_crop_radius", 0.0, low=0.0, high=LARGEST_NUMBER) if fisheye else 0
    if "FISHEYE624" in model or model == "RAD_TAN_THIN_PRISM_FISHEYE":
        numbers = fields.numbers("distortion_params", ARIA)
        return ColmapCamera("RAD_TAN_THIN_PRISM_FISHEYE", size, (*pinhole, *numbers), crop or None)
    each = tuple(float(entry.get(key, 0)) for key in BENDS)
    if fields.has("distortion_params"):
        each = fields.numbers("distortion_params", len(BENDS))
    k1, k2, k3, k4, p1, p2 = each
    if fisheye and not (p1 or p2):
        return ColmapCamera("OPENCV_FISHEYE", size, (*pinhole, k1, k2, k3, k4), crop or None)
    if fisheye:
        return ColmapCamera(BROWN_FISHEYE, size, (*pinhole, *each), crop or None)
    k5, k6 = (float(entry.get(key, 0)) for key in ("k5", "k6"))
    if model == "FULL_OPENCV" or k5 or k6:  # OpenCV's rational lens: a denominator of k4 to k6
        return ColmapCamera("FULL_OPENCV", size, (*pinhole, k1, k2, p1, p2, k3, k4, k5, k6))
    if k4:
        return ColmapCamera(BROWN, size, (*pinhole, *each))
    return ColmapCamera("FULL_OPENCV", size, (*pinhole, k1, k2, p1, p2, k3, 0.0, 0.0, 0.0))


def focal_lengths(entry: Mapping, size: tuple[int, int], where: str) -> tuple[float, float]:
    """Pixels across and down, of focal lengths or of angles of view; one stands for both."""
    across = focal_of(entry, ("fl_x", "x_fov", "camera_angle_x"), size[0], where)
    if across is None:
        raise BadFile(f"{where} has no focal length; give 'fl_x' in pixels or 'camera_angle_x'")
    # An angle of view down beside a focal length across is not looked at: instant-ngp writes both,
    # and rounds the angle.
    keys = ("fl_y",) if "fl_x" in entry else ("fl_y", "y_fov", "camera_angle_y")
    down = focal_of(entry, keys, size[1], where)
    return across, across if down is None else down


def focal_of(entry: Mapping, keys: tuple[str, ...], side: int, where: str) -> float | None:
    """Pixels of focal length by the first of `keys` that there is; `side`: pixels of the angles."""
    key = next((key for key in keys if key in entry), None)
    if key is None:
        return None
    if key.startswith("fl_"):
        return float(entry[key])
    degrees = key.endswith("_fov")
    angle = math.radians(entry[key]) if degrees else entry[key]
    if not 0 < angle < math.pi:
        wanted = "degrees between 0 and 180" if degrees else "radians between 0 and pi"
        raise BadFile(f"{where}: '{key}' is {entry[key]:g}; {wanted} are wanted")
    return side / 2 / math.tan(angle / 2)
