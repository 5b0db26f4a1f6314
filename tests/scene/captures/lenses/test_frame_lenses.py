"""Lenses as transforms.json has them: each by its own formula, and turned back."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from shapeshift.scene.capture_photos import of_size
from shapeshift.scene.captures.colmap_tables import BROWN, BROWN_FISHEYE, ColmapCamera
from shapeshift.scene.captures.lenses.brown import brown_tangents
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.undistort import pinhole_of, pixels_of
from shapeshift.training.photos import load_photos
from tests.support.scene.captures import simple, write_transforms
from tests.support.scene.lenses import (
    FISH,
    KEYS,
    brown,
    eighth_power,
    fisheye,
    leaning_fisheye,
    rational,
)

SIZE = (200, 150)
F, CENTRE = 160.0, (103.0, 72.0)
FILES = [
    (brown, KEYS, (620, 615, 410, 290, -0.28, 0.09, 0.002, -0.001, -0.01), {}),
    (fisheye, FISH, (330, 330, 395, 305, 0.04, -0.01, 0.002, 0), {"is_fisheye": True}),
    (eighth_power, (*KEYS, "k4"), (620, 615, 410, 290, -0.28, 0.09, 0.002, -0.001, -0.01, 0.03),
     {"camera_model": "opencv"}),
    (leaning_fisheye, (*KEYS, "k4"), (330, 330, 395, 305, 0.04, -0.01, 0.003, -0.002, 0.002, 1e-4),
     {"camera_model": "opencv_fisheye"}),
    (rational, ("fl_x", "fl_y", "cx", "cy", "k1", "k2", "k3", "k4", "k5", "k6"),
     (620, 615, 410, 290, 0.4, 0.1, 0.01, 0.6, 0.15, 0.02), {}),
    (rational, ("fl_x", "fl_y", "cx", "cy", "k1", "k2", "k3", "k4", "k5", "k6"),
     (620, 615, 410, 290, 0.4, 0.1, 0.01, 0.2, 0, 0), {"camera_model": "FULL_OPENCV"}),
]  # fmt: skip


@pytest.mark.parametrize("formula, keys, numbers, more", FILES)
def test_the_lens_of_a_file_is_its_formula(tmp_path, formula, keys, numbers, more):
    frames, _ = simple(tmp_path, 2)
    for path in (tmp_path / "images").iterdir():
        Image.new("RGB", (800, 600)).save(path)
    said = dict(zip(keys, numbers, strict=True)) | more
    write_transforms(tmp_path, frames, w=800, h=600, **said)
    lens = read_capture(tmp_path).photos[0].lens
    at = np.random.default_rng(0).uniform(-0.8, 0.8, (50, 2))
    want = formula(np.column_stack([at, np.ones(50)]), numbers)
    np.testing.assert_allclose(pixels_of(lens, at), want, atol=1e-9)


@pytest.mark.parametrize("model", [BROWN, BROWN_FISHEYE])
def test_lenses_of_nerfstudio_are_turned_back(model):
    """Pixels of tangents of pixels, and with k4, p1, p2 of 0 what pycolmap has."""
    numbers = (0.04, -0.02, 0.01, 0.005, 0.002, -0.001)
    lens = ColmapCamera(model, SIZE, (F, 1.01 * F, *CENTRE, *numbers))
    x, y = np.meshgrid(np.linspace(0, SIZE[0], 21), np.linspace(0, SIZE[1], 16))
    pixels = np.stack([x.ravel(), y.ravel()], axis=1)
    np.testing.assert_allclose(pixels_of(lens, brown_tangents(lens, pixels)), pixels, atol=1e-9)
    fisheye_of = model == BROWN_FISHEYE
    k1, k2, k3 = numbers[:3]
    theirs = ("OPENCV_FISHEYE", (k1, k2, k3, 0.0)) if fisheye_of else (
        "FULL_OPENCV", (k1, k2, 0.0, 0.0, k3, 0.0, 0.0, 0.0))  # fmt: skip
    same = replace(lens, params=(*lens.params[:4], k1, k2, k3, 0.0, 0.0, 0.0))
    other = ColmapCamera(theirs[0], SIZE, (*lens.params[:4], *theirs[1]))
    at = np.random.default_rng(0).uniform(-1, 1, (50, 2))
    np.testing.assert_allclose(pixels_of(same, at), pixels_of(other, at), atol=1e-9)
    assert np.isfinite(pixels_of(lens, np.zeros((1, 2)))).all()
    assert not np.isfinite(pixels_of(lens, np.full((1, 2), np.nan))).any()


def test_beyond_a_fisheyes_crop_radius_nothing_counts(tmp_path):
    frames, _ = simple(tmp_path, 2)
    for path in (tmp_path / "images").iterdir():
        Image.new("RGB", (200, 150), (200, 100, 50)).save(path)
    lens = {"w": 200, "h": 150, "fl_x": 110.0, "k1": 0.03, "camera_model": "OPENCV_FISHEYE"}
    write_transforms(tmp_path, frames, **lens, fisheye_crop_radius=60.0)
    for factor in (1, 2, 3):
        capture = read_capture(tmp_path)
        (photo, _) = load_photos(capture, "train", factor, "object")
        height, width = photo.weight.shape
        x, y = np.meshgrid(*((np.arange(side) + 0.5) * factor for side in (width, height)))
        straight = pinhole_of(capture.photos[0].lens)
        tangents = (np.stack([x, y], 2) - straight.centre) / straight.focal
        xyz = np.concatenate([tangents, np.ones((height, width, 1))], 2).reshape(-1, 3)
        off = np.hypot(*(fisheye(xyz, (110, 110, 0, 0, 0.03, 0, 0, 0))).T).reshape(height, width)
        np.testing.assert_array_equal(photo.weight > 0, off <= 60)
    half = of_size(capture.photos[0].lens, (100, 75), tmp_path)
    assert half.crop == 30
