"""Bytes into a real window: every pixel where it belongs, whatever part of it they are for."""

import numpy as np
import pytest

from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.gl.layered import GlFunctions, NoFunction
from shapeshift.renderer.gl.resolve import Resolve


def shown_in(window) -> np.ndarray:
    """(H, W, 3) uint8 of the whole window, row 0 on top."""
    screen = window.ctx.screen
    width, height = window.size
    raw = screen.read(viewport=(0, 0, width, height), components=3, alignment=1)
    return np.frombuffer(raw, np.uint8).reshape(height, width, 3)[::-1]


def noise(width: int, height: int) -> np.ndarray:
    """(H, W, 4) uint8, opaque, blue first, row 0 on top: no two rows, columns, channels alike."""
    pixels = np.random.default_rng(width).integers(0, 256, (height, width, 4), np.uint8)
    pixels[..., 3] = 255
    return pixels


@pytest.fixture
def resolve(window):
    gpu = Gpu(window.ctx)
    found = Resolve(gpu)
    yield found
    found.release()
    gpu.release()


def test_bytes_fill_a_window_and_any_part_of_it(window, resolve):
    screen, (width, height) = window.ctx.screen, window.size
    assert resolve.is_window(screen)
    parts = [(0, 0, width, height), (0, 0, 1, 1), (width - 1, height - 1, 1, 1),
             (17, 5, 33, 64), (0, height // 2, width // 3, 7)]  # fmt: skip
    screen.clear()
    want = np.zeros((height, width, 3), np.uint8)
    for left, below, across, along in parts:
        screen.viewport = (left, below, across, along)
        pixels = noise(across, along)
        assert resolve.takes_bytes(screen, (across, along))
        assert not resolve.takes_bytes(screen, (across + 1, along))
        resolve.copy(lambda pixels=pixels, **_: pixels, screen)
        top = height - below - along
        want[top : top + along, left : left + across] = pixels[..., 2::-1]
        screen.viewport = (0, 0, width, height)
        np.testing.assert_array_equal(shown_in(window), want)


def test_a_window_is_filled_without_those_functions_too(window, monkeypatch):
    def none(self) -> None:
        raise NoFunction("none is found")

    monkeypatch.setattr(GlFunctions, "__init__", none)
    screen, (width, height) = window.ctx.screen, window.size
    screen.viewport = (0, 0, width, height)
    with Gpu(window.ctx) as gpu, Resolve(gpu) as resolve:
        assert not resolve.is_window(screen) and resolve.takes_bytes(screen, (width, height))
        pixels = noise(width, height)
        from_below = np.ascontiguousarray(pixels[::-1, :, [2, 1, 0, 3]])  # red first
        resolve.copy(lambda from_below=from_below, **_: from_below, screen)
        np.testing.assert_array_equal(shown_in(window), pixels[..., 2::-1])
