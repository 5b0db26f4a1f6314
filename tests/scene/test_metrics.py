"""PSNR and SSIM against their definitions, written as loops over pixels and taps."""

import math

import numpy as np
import pytest

from shapeshift.scene.metrics import psnr, ssim, ssim_map, window
from shapeshift.training.evaluation import metrics as training_metrics


def pair(height, width, channels=3, seed=0, noise=0.1):
    rng = np.random.default_rng(seed)
    a = rng.uniform(size=(height, width, channels))
    return a, a + rng.normal(size=a.shape) * noise


def slow_ssim(a, b):
    """Wang et al., 2004, equation 13, pixel by pixel; zeros beyond the border."""
    height, width, channels = a.shape
    line = [math.exp(-((i - 5) ** 2) / (2 * 1.5**2)) for i in range(11)]
    total = sum(line) ** 2
    out = np.zeros(a.shape)
    for y in range(height):
        for x in range(width):
            for c in range(channels):
                sums = np.zeros(5)  # a, b, a^2, b^2, ab
                for i in range(11):
                    for j in range(11):
                        v, u = y + i - 5, x + j - 5
                        if 0 <= v < height and 0 <= u < width:
                            p, q = a[v, u, c], b[v, u, c]
                            weight = line[i] * line[j] / total
                            sums += weight * np.array([p, q, p * p, q * q, p * q])
                ma, mb, aa, bb, ab = sums
                top = (2 * ma * mb + 1e-4) * (2 * (ab - ma * mb) + 9e-4)
                low = (ma**2 + mb**2 + 1e-4) * (aa - ma**2 + bb - mb**2 + 9e-4)
                out[y, x, c] = top / low
    return out


@pytest.mark.parametrize("size", [(1, 1), (1, 12), (5, 6), (10, 3), (11, 11), (12, 23)], ids=str)
def test_ssim_is_its_definition(size):
    for noise in (0.01, 0.5):
        a, b = pair(*size, noise=noise)
        np.testing.assert_allclose(ssim_map(a, b), slow_ssim(a, b), atol=1e-12)
        assert ssim(a, b) == pytest.approx(slow_ssim(a, b).mean(), abs=1e-12)


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_channels_do_not_mix(channels):
    a, b = pair(14, 9, channels)
    for c in range(channels):
        alone = ssim_map(a[..., c : c + 1], b[..., c : c + 1])[..., 0]
        np.testing.assert_array_equal(alone, ssim_map(a, b)[..., c])


def test_ssim_of_equal_pictures_is_one_and_it_is_symmetric():
    a, b = pair(30, 20)
    assert ssim(a, a) == 1
    assert ssim(np.zeros((8, 8, 3)), np.zeros((8, 8, 3))) == 1
    assert ssim(a, b) == ssim(b, a) < 1


def test_ssim_of_bytes_and_floats_is_taken_in_float64():
    a, b = pair(16, 16)
    near = ssim(a.astype(np.float32), b.astype(np.float32))
    assert near == pytest.approx(ssim(a, b), abs=1e-6)


def test_the_window_is_a_gaussian_of_sum_one():
    taps = window()
    assert len(taps) == 11 and taps.sum() == pytest.approx(1, abs=1e-15)
    np.testing.assert_array_equal(taps, taps[::-1])
    assert np.log(taps[5] / taps[8]) == pytest.approx(3**2 / (2 * 1.5**2))


def test_training_reports_the_same_numbers():
    a, b = pair(40, 33)
    a, b = a.clip(0, 1), b.clip(0, 1)
    assert training_metrics.ssim(a, b) == pytest.approx(ssim(a, b), abs=1e-12)
    assert training_metrics.psnr(a, b) == pytest.approx(psnr(a, b), abs=1e-9)


@pytest.mark.parametrize(("peak", "error", "db"), [(1, 0.1, 20), (1, 1, 0), (255, 25.5, 20)])
def test_psnr_of_a_known_error(peak, error, db):
    a = np.full((3, 5, 3), 0.25)
    assert psnr(a, a + error, peak) == pytest.approx(db, abs=1e-12)


def test_psnr_of_equal_pictures_is_infinite_and_of_nan_is_nan():
    a, b = pair(4, 4)
    assert psnr(a, a) == math.inf
    assert psnr(a, b) == psnr(b, a)
    b[0, 0, 0] = np.nan
    assert math.isnan(psnr(a, b)) and math.isnan(ssim(a, b))


def test_psnr_sees_what_float32_would_lose():
    """Squares of 1e-24 vanish in half precision, their decibels must not."""
    a = np.zeros((8, 8, 3), np.float32)
    assert psnr(a, a + np.float32(1e-12)) == pytest.approx(240, abs=1e-3)


def test_bytes_do_not_wrap_around():
    black, white = np.zeros((2, 2, 3), np.uint8), np.full((2, 2, 3), 255, np.uint8)
    assert psnr(black, white, 255) == 0 == psnr(white, black, 255)


@pytest.mark.parametrize("measure", [psnr, ssim])
def test_pictures_of_two_sizes_are_refused(measure):
    with pytest.raises(ValueError, match=r"4.*3"):
        measure(np.zeros((4, 4, 3)), np.zeros((4, 3, 3)))
    with pytest.raises(ValueError):
        measure(np.zeros((4, 4, 3)), np.zeros((4, 1, 3)))  # would broadcast
