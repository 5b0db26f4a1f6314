"""The pixels of photos and masks."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Photo
from shapeshift.scene.captures.photo import area_weights, load_photo
from shapeshift.scene.pose import Pose, View
from tests.captures import (
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
        rgb, mask = load_photo(photo_at(tmp_path / name))
        assert (rgb.dtype, rgb.shape, mask) == (np.float32, (2, 2, 3), None)
        np.testing.assert_allclose(rgb, np.repeat(eight[..., None] / 255, 3, 2), atol=1e-7)


def test_alpha_is_the_mask_and_black_lies_behind(tmp_path):
    path = save_image(tmp_path / "a.png", mode="RGBA")
    rgba = np.asarray(Image.open(path)) / np.float32(255)
    rgb, mask = load_photo(photo_at(path))
    np.testing.assert_allclose(mask, rgba[..., 3], atol=1e-6)
    np.testing.assert_allclose(rgb, rgba[..., :3] * rgba[..., 3:], atol=1e-6)
    file = save_image(tmp_path / "m.png", seed=3, mode="L")
    _, mask = load_photo(photo_at(path, file))
    np.testing.assert_allclose(mask, np.asarray(Image.open(file)) / 255, atol=1e-6)
    with pytest.raises(BadFile, match="mask has 5x5"):
        load_photo(photo_at(path, save_image(tmp_path / "s.png", (5, 5), mode="L")))


@pytest.mark.parametrize("old, new", [(8, 4), (7, 3), (5, 5), (4, 7), (1, 3), (3, 1)])
def test_shrinking_is_the_mean_over_the_area(old, new):
    """The twin: every old pixel as many equal cells, the new ones their plain means."""
    row = np.random.default_rng(old).random(old)
    cells = np.repeat(row, new)  # old * new cells, so both grids fall on them
    np.testing.assert_allclose(area_weights(old, new) @ row, cells.reshape(new, old).mean(1), 1e-6)
    np.testing.assert_allclose(area_weights(old, new).sum(1), 1, 1e-6)


def test_load_photo_shrinks_photo_and_mask(tmp_path):
    path, mask = save_image(tmp_path / "a.png"), save_image(tmp_path / "m.png", mode="L")
    rgb, small = load_photo(photo_at(path, mask), (8, 4))
    full, full_mask = load_photo(photo_at(path, mask))
    assert (rgb.shape, rgb.dtype, small.dtype) == ((4, 8, 3), np.float32, np.float32)
    np.testing.assert_allclose(rgb, full.reshape(4, 3, 8, 2, 3).mean((1, 3)), atol=1e-6)
    np.testing.assert_allclose(small, full_mask.reshape(4, 3, 8, 2).mean((1, 3)), atol=1e-6)


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
