"""The pixels of photos and masks."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Photo
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.pose import Pose, View
from tests.support.scene.captures import (
    save_image,
)


def photo_at(path: Path, mask: Path | None = None) -> Photo:
    view = View(Pose(np.zeros(3), np.array([1.0, 0, 0, 0])), (-1, 1, -1, 1), 0.1, 9.0, (4, 4))
    return Photo(view, path, "RGB", mask)


def test_grey_photos_get_three_equal_channels(tmp_path):
    eight = np.array([[0, 255], [51, 102]], np.uint8)
    Image.fromarray(eight).save(tmp_path / "8.png")
    Image.fromarray(eight.astype(np.uint16) * 257).save(tmp_path / "16.png")
    for name in ("8.png", "16.png"):
        rgb, mask, lost = load_photo(photo_at(tmp_path / name))
        assert (rgb.dtype, rgb.shape, mask, lost) == (np.uint8, (2, 2, 3), None, None)
        np.testing.assert_array_equal(rgb, np.repeat(eight[..., None], 3, 2))


def test_alpha_is_the_mask_and_a_mask_file_goes_before_it(tmp_path):
    path = save_image(tmp_path / "a.png", mode="RGBA")
    rgba = np.asarray(Image.open(path))
    rgb, mask, _ = load_photo(photo_at(path))
    np.testing.assert_array_equal(mask, rgba[..., 3])
    np.testing.assert_array_equal(rgb, rgba[..., :3])  # its own colours, not times alpha
    file = save_image(tmp_path / "m.png", seed=3, mode="L")
    rgb, mask, _ = load_photo(photo_at(path, file))
    np.testing.assert_array_equal(mask, np.asarray(Image.open(file)))
    over_black = rgba[..., :3] * (rgba[..., 3:] / 255)
    assert np.abs(rgb - over_black).max() <= 1
    with pytest.raises(BadFile, match="mask has 5x5 pixels, the photo 16x12"):
        load_photo(photo_at(path, save_image(tmp_path / "s.png", (5, 5), mode="L")))


SIZES = [(16, 12), (17, 13), (19, 12), (7, 7), (3, 40), (1, 1)]


@pytest.mark.parametrize("factor", [1, 2, 3, 7, 8])
@pytest.mark.parametrize("size", SIZES)
def test_each_pixel_of_a_smaller_photo_is_the_mean_over_its_area(tmp_path, size, factor):
    """To the rounding of a byte, of halves downwards; what is less than a pixel is cut off."""
    path = save_image(tmp_path / "a.png", size)
    file = save_image(tmp_path / "m.png", size, mode="L", seed=5)
    whole = np.asarray(Image.open(path), float), np.asarray(Image.open(file), float)
    rgb, mask, _ = load_photo(photo_at(path, file), factor)
    width, height = (max(side // factor, 1) for side in size)
    assert rgb.shape == (height, width, 3) and mask.shape == (height, width)
    across, down = (min(factor, side) for side in size)
    for got, want in zip((rgb, mask), whole, strict=True):
        cells = want[: height * down, : width * across]
        cells = cells.reshape(height, down, width, across, -1).mean((1, 3))
        assert np.abs(got.reshape(cells.shape) - cells).max() <= 0.5 + 0.5 / (across * down) + 1e-9
    view = replace(photo_at(path).view, size=size).divided(factor)
    assert view.size == (width, height)


def test_a_smaller_photo_has_the_pixels_that_its_view_says():
    """Of 1000 pixels of which 7 make one, 994 are kept: the same focal length, in pixels of 7."""
    view = View.from_pinhole(np.eye(4), (800.0, 810.0), (490.0, 505.0), (1000, 1003))
    small = view.divided(7)
    _, fx, fy, cx, cy = small.pinhole()
    np.testing.assert_allclose((fx, fy, cx, cy), np.array([800, 810, 490, 505]) / 7, rtol=1e-12)
    assert small.size == (142, 143)
    assert view.divided(1) == view and view.divided(1003).size == (1, 1)
    assert replace(view, size=(994, 1001)).divided(7).tangents == view.tangents


@pytest.mark.parametrize("factor", [4, 6, 8, 16])
def test_a_jpeg_that_is_decoded_smaller_is_nearly_the_mean(tmp_path, factor):
    """Decoding at a half and more is a mean of frequencies, not of pixels.

    A photo is a sum of waves of all lengths; one byte in a hundred of the mean's, at most 6.
    """
    size, rng = (331, 243), np.random.default_rng(0)
    y, x = np.mgrid[: size[1], : size[0]]
    waves = [np.sin(rng.normal() / w * x + rng.normal() / w * y + i) for i, w in
             enumerate(np.geomspace(2, 60, 40))]  # fmt: skip
    grey = np.clip(128 + 16 * np.sum(waves, axis=0), 0, 255).astype(np.uint8)
    Image.fromarray(grey).convert("RGB").save(tmp_path / "a.jpg", quality=95)
    whole = np.asarray(Image.open(tmp_path / "a.jpg"), float)
    rgb, _, _ = load_photo(photo_at(tmp_path / "a.jpg"), factor)
    height, width = rgb.shape[:2]
    cells = whole[: height * factor, : width * factor]
    cells = cells.reshape(height, factor, width, factor, 3).mean((1, 3))
    assert np.abs(rgb - cells).mean() < 2.55 and np.abs(rgb - cells).max() < 6


def test_broken_photos_are_refused(tmp_path):
    with pytest.raises(BadFile, match="missing"):
        load_photo(photo_at(tmp_path / "no.png"))
    path = save_image(tmp_path / "cut.png", (64, 64))
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(BadFile, match="cut off"):
        load_photo(photo_at(path))
    path.write_text("hello")
    with pytest.raises(BadFile, match="not a readable image"):
        load_photo(photo_at(path))
