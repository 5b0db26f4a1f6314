"""resolve: the bytes of a window against numpy, with and without a palette, at every width."""

import numpy as np
import pytest
from rasterizer_scenes import device

from rasterizer.resolve import resolve
from renderer.palette import apply_palette, palette_colors


def image(height: int, width: int, seed: int = 0) -> np.ndarray:
    """(H, W, 4) premultiplied, with empty and opaque pixels, colours below 0 and above 1."""
    rng = np.random.default_rng(seed)
    alpha = rng.uniform(-0.2, 1.2, (height, width, 1)).clip(0, 1)
    return np.concatenate([rng.uniform(-0.1, 1.1, (height, width, 3)) * alpha, alpha], 2).astype(
        np.float32
    )


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (5, 16), (7, 17), (33, 250)])
@pytest.mark.parametrize(("name", "weight"), [("", 0.0), ("ironbow", 0.4), ("turbo", 1.0)])
def test_it_equals_the_picture_that_numpy_resolves(size, name, weight):
    rgba, background = image(*size), (0.1, 0.5, 0.9)
    palette = palette_colors(name) if name else None
    got = resolve(device(), rgba, background, palette, weight)
    rgba = apply_palette(rgba.astype(np.float64), name, weight)
    shown = rgba[..., :3] + (1 - rgba[..., 3:]) * background
    want = shown.clip(0, 1)[::-1] * 255
    assert got.dtype == np.uint8 and got.shape == (*size, 4)
    assert np.abs(got[..., :3] - want).max() < 0.501  # the nearest step but for float rounding
    assert (got[..., 3] == 255).all()


def test_a_palette_without_weight_is_none():
    rgba = image(4, 9)
    plain = resolve(device(), rgba, (0, 0, 0))
    np.testing.assert_array_equal(
        resolve(device(), rgba, (0, 0, 0), palette_colors("gray"), 0.0), plain
    )
