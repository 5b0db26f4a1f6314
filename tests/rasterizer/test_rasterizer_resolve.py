"""resolve: the bytes of a window against numpy, with and without a palette, at every width."""

import numpy as np
import pytest

from shapeshift.rasterizer.resolve import WindowOverlay, resolve
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


def laid_over(picture: np.ndarray, layer: np.ndarray) -> np.ndarray:
    """By the definition of premultiplied colours, not rounded: (H, W, 4) of 0..255."""
    hidden = layer[..., 3:] / 255
    return np.minimum(layer + (1 - hidden) * picture, 255)


@pytest.mark.parametrize("width", [1, 3, 4, 5, 16, 33])
def test_an_overlay_lies_over_a_windows_picture_in_its_boxes_alone(width):
    height, rng = 40, np.random.default_rng(width)
    rgba, background = image(height, width), (0.1, 0.5, 0.9)
    alpha = rng.integers(0, 256, (height, width, 1))
    alpha[::7], alpha[1::7] = 0, 255  # nothing, and all, of the picture is seen
    layer = np.concatenate([rng.integers(0, alpha + 1, (height, width, 3)), alpha], 2)
    layer = layer.astype(np.uint8)
    middle = (width + 1) // 2
    boxes = [(0, 0, middle, 9), (middle, 3, width, 40), (0, 20, middle, 21), (0, 30, 0, 40)]
    inside = np.zeros((height, width), bool)
    for left, top, right, low in boxes:
        inside[top:low, left:right] = True
    bare = resolve(device(), rgba, background, as_window=True).copy()
    overlay = WindowOverlay(layer, np.array(boxes, np.int32))
    got = resolve(device(), rgba, background, as_window=True, overlay=overlay)
    np.testing.assert_array_equal(got[~inside], bare[~inside])
    want = laid_over(bare.astype(np.float64), layer.astype(np.float64))
    # Halves of a step, and what (p + p / 256 + 128) / 256 is beside p / 255 + 1 / 2: 1 / 256.
    assert np.abs(got[inside] - want[inside]).max(initial=0) <= 0.5 + 1 / 255
    assert (got[..., 3] == 255).all()
    none = WindowOverlay(layer, np.zeros((0, 4), np.int32))
    np.testing.assert_array_equal(
        resolve(device(), rgba, background, as_window=True, overlay=none), bare
    )


def test_what_is_more_than_its_alpha_stays_white():
    """ImGui's layer is rounded once for each of what lies over another: a step may be too much."""
    picture = np.ones((1, 4, 4), np.float32)
    layer = np.full((1, 4, 4), 200, np.uint8)
    layer[..., 3] = 199
    overlay = WindowOverlay(layer, np.array([(0, 0, 4, 1)], np.int32))
    got = resolve(device(), picture, (1, 1, 1), as_window=True, overlay=overlay)
    assert (got == 255).all()
