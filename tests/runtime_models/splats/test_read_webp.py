"""Pixels of a WebP: as Pillow's own picture has them, and nothing of what is damaged."""

import io

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.splats.sog.sog_files import webp_pixels, webp_size


def coded(pixels: np.ndarray, **how) -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "WEBP", **how)
    return file.getvalue()


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (64, 3), (15, 16), (176, 172)])
@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("how", [{"lossless": True, "exact": True}, {"quality": 60}])
def test_pixels_are_those_of_pillow(shape, channels, how):
    pixels = np.random.default_rng(0).integers(0, 256, (*shape, channels), np.uint8)
    data = coded(pixels, **how)
    found = webp_pixels(data)
    assert webp_size(data) == shape[::-1]
    with Image.open(io.BytesIO(data)) as picture:
        np.testing.assert_array_equal(found, np.asarray(picture.convert("RGBA")))
    if "lossless" in how:
        np.testing.assert_array_equal(found[..., :channels], pixels)
        assert channels == 4 or (found[..., 3] == 255).all()


def test_of_a_moving_picture_the_first_one():
    pictures = [np.full((9, 8, 3), value, np.uint8) for value in (10, 200)]
    first, second = map(Image.fromarray, pictures)
    file = io.BytesIO()
    first.save(file, "WEBP", save_all=True, append_images=[second], lossless=True)
    np.testing.assert_array_equal(webp_pixels(file.getvalue())[..., :3], pictures[0])


def test_damaged_ones_are_none():
    data = coded(np.random.default_rng(0).integers(0, 256, (40, 40, 4), np.uint8), lossless=True)
    for broken in (b"", b"RIFF", data[:20], data[:40], data[: len(data) // 2], b"x" + data[1:]):
        assert webp_pixels(broken) is None
