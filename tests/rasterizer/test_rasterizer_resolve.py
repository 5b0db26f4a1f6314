"""resolve: the bytes of a window against numpy, with and without a palette, at every width."""

import numpy as np
import pytest

from shapeshift.rasterizer.resolve import resolve
from shapeshift.renderer.colors.palette import apply_palette, overlay_heat, palette_colors
from tests.support.renderer.rasterizer_scenes import device


def image(height: int, width: int, seed: int = 0) -> np.ndarray:
    """(H, W, 4) premultiplied, with empty and opaque pixels, colours below 0 and above 1."""
    rng = np.random.default_rng(seed)
    alpha = rng.uniform(-0.2, 1.2, (height, width, 1)).clip(0, 1)
    return np.concatenate([rng.uniform(-0.1, 1.1, (height, width, 3)) * alpha, alpha], 2).astype(
        np.float32
    )


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (5, 16), (7, 17), (33, 250)])
@pytest.mark.parametrize(
    ("name", "beside"), [("", False), ("ironbow", False), ("turbo", False), ("ironbow", True)]
)
def test_it_equals_the_picture_that_numpy_resolves(size, name, beside):
    rgba, background = image(*size), (0.1, 0.5, 0.9)
    rng = np.random.default_rng(1)
    heat = rgba[..., 3:] * rng.random((*size, 1)) * [[[1.0, 1.0]]]
    heat[..., 0] *= rng.uniform(-0.1, 1.1, size)
    heat = heat.astype(np.float32) if beside else None
    palette = palette_colors(name) if name else None
    got = resolve(device(), rgba, background, palette, heat)
    rgba = rgba.astype(np.float64)
    if name:
        rgba = overlay_heat(rgba, heat, name) if beside else apply_palette(rgba, name)
    shown = rgba[..., :3] + (1 - rgba[..., 3:]) * background
    want = shown.clip(0, 1)[::-1] * 255
    assert got.dtype == np.uint8 and got.shape == (*size, 4)
    assert np.abs(got[..., :3] - want).max() < 0.501  # the nearest step but for float rounding
    assert (got[..., 3] == 255).all()
    window = resolve(device(), image(*size), background, palette, heat, as_window=True)
    np.testing.assert_array_equal(window[::-1, :, [2, 1, 0, 3]], got)


def test_heat_without_weight_is_none():
    rgba = image(4, 9)
    plain = resolve(device(), rgba, (0, 0, 0))
    nothing = np.zeros((4, 9, 2), np.float32)
    shown = resolve(device(), rgba, (0, 0, 0), palette_colors("gray"), nothing)
    np.testing.assert_array_equal(shown, plain)
