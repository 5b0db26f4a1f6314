"""Heat over shape: numpy and GL against the formula, and what it must and must not change."""

import numpy as np
import pytest

from shapeshift.renderer.colors.heat_over_shape import SIGMA, blur_weights, heat_over_shape
from shapeshift.renderer.colors.palette import LUMINANCE
from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.gl.over_picture import HeatOverShape

SIZES = [(1, 1), (5, 1), (1, 7), (40, 30), (64, 480)]  # width, height


def pictures(size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Heat and photo (H, W, 3), of 8 bits as float32."""
    rng = np.random.default_rng(1)
    shape = (*size[::-1], 3)
    heat, photo = (rng.integers(0, 256, shape).astype(np.float32) / 255 for _ in range(2))
    return heat * 0.4 + 0.3, photo


def by_the_formula(heat: np.ndarray, photo: np.ndarray, detail: float) -> np.ndarray:
    """A Gaussian of the whole plane at once, pixel by pixel, cut off at 3 sigma."""
    height, width = photo.shape[:2]
    sigma = SIGMA * height
    reach = int(3 * sigma + 0.5)
    luminance = photo.astype(np.float64) @ LUMINANCE
    out = np.zeros(heat.shape)
    steps = np.arange(-reach, reach + 1)
    bell = np.exp(-(steps[:, None] ** 2 + steps**2) / (2 * sigma**2))
    bell /= bell.sum()
    for y in range(height):
        for x in range(width):
            rows, columns = np.clip(y + steps, 0, height - 1), np.clip(x + steps, 0, width - 1)
            broad = (bell * luminance[np.ix_(rows, columns)]).sum()
            out[y, x] = heat[y, x] + detail * (luminance[y, x] - broad)
    return out.clip(0, 1)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("detail", [0.0, 0.7, 3.0])
def test_numpy_is_the_formula(size, detail):
    heat, photo = pictures(size)
    found = heat_over_shape(heat, photo, detail)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, by_the_formula(heat, photo, detail), atol=2e-6)


@pytest.mark.parametrize("size", SIZES)
def test_gl_is_numpy(ctx, size):
    heat, photo = pictures(size)
    textures = []
    for picture in (photo, heat):
        texture = ctx.texture(size, 3, dtype="f4")
        texture.write(np.ascontiguousarray(picture[::-1]))  # row 0 at the bottom
        textures.append(texture)
    target = ctx.framebuffer([ctx.texture(size, 4, dtype="f4")])
    with Gpu(ctx) as gpu:
        passes = HeatOverShape(gpu)
        passes.draw(*textures, target, 1.5)
        passes.release()
    found = np.frombuffer(target.read(components=4, dtype="f4"), np.float32)
    found = found.reshape(*size[::-1], 4)[::-1]
    np.testing.assert_allclose(found[..., :3], heat_over_shape(heat, photo, 1.5), atol=1e-5)
    assert (found[..., 3] == 1).all()
    for made in (*textures, *target.color_attachments, target):
        made.release()


def test_weights_are_whole():
    for height in (1, 30, 720, 4320):
        weights = blur_weights(height)
        assert 2 * weights.astype(np.float64).sum() - weights[0] == pytest.approx(1, abs=1e-6)
        assert (np.diff(weights) <= 0).all()


def test_broad_brightness_of_the_photo_does_not_change_heat():
    """A ramp over the picture and any even grey leave colours: values are still to be read."""
    heat, _ = pictures((120, 240))
    heat = np.full_like(heat, 0.5)
    for photo in (np.zeros_like(heat), np.ones_like(heat)):
        np.testing.assert_allclose(heat_over_shape(heat, photo), heat, atol=1e-6)
    ramp = np.broadcast_to(np.linspace(0, 1, 120)[None, :, None], heat.shape)
    inner = heat_over_shape(heat, ramp)[5:-5, 5:-5]
    np.testing.assert_allclose(inner, 0.5, atol=1e-5)


def test_an_edge_of_the_photo_is_grey_and_on_both_sides():
    heat = np.broadcast_to(np.array([0.5, 0.3, 0.4], np.float32), (240, 120, 3))
    photo = np.zeros((240, 120, 3), np.float32)
    photo[:, 60:] = 0.4
    added = heat_over_shape(heat, photo) - heat
    np.testing.assert_allclose(added[..., 0], added[..., 2], atol=1e-6)
    assert added[:, 59].max() < -0.05 and added[:, 60].min() > 0.05
    np.testing.assert_allclose(added[:, :50], 0, atol=1e-6)
