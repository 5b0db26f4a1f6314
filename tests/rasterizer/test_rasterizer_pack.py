"""pack against float64 covariances: vector edges, rows of others, lengths out of range."""

import numpy as np
import pytest

from shapeshift.rasterizer.pack import pack, pack_color, pack_opacity
from shapeshift.rasterizer.reference import rotations
from tests.support.renderer.rasterizer_scenes import device

BEFORE, AFTER = 3, 5  # rows of other objects


def packed(means, scales, wxyz, opacity) -> tuple[np.ndarray, np.ndarray]:
    """mean_opacity (n, 4) and covariance (n, 8); rows before and after must stay."""
    d, n = device(), len(means)
    arrays = [d.upload(np.full((BEFORE + n + AFTER, k), -7, np.float32)) for k in (4, 8)]
    pack(d, (means, scales, wxyz, opacity), BEFORE, *arrays)
    mean_opacity, covariance = (d.download(a) for a in arrays)
    for a in (mean_opacity, covariance):
        assert (a[:BEFORE] == -7).all() and (a[BEFORE + n :] == -7).all()
    return mean_opacity[BEFORE : BEFORE + n], covariance[BEFORE : BEFORE + n]


def splats(n: int) -> list[np.ndarray]:
    rng = np.random.default_rng(n)
    arrays = (
        rng.normal(size=(n, 3)),
        np.exp(rng.normal(size=(n, 3)) - 3),
        rng.normal(size=(n, 4)) * 2,
        rng.uniform(-0.2, 1, n),
    )
    return [a.astype(np.float32) for a in arrays]


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 511, 512, 513, 1300])
def test_it_is_the_covariance_and_writes_its_own_rows_only(count):
    means, scales, wxyz, opacity = splats(count)
    mean_opacity, covariance = packed(means, scales, wxyz, opacity)
    np.testing.assert_array_equal(mean_opacity, np.column_stack([means, opacity]))
    root = rotations(wxyz.astype(np.float64)) * scales[:, None, :]
    full = root @ root.transpose(0, 2, 1)
    wanted = full[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    size = np.max(scales, axis=1, initial=0)[:, None] ** 2
    assert (np.abs(covariance[:, :6] - wanted) <= 2e-6 * size).all()
    assert not covariance[:, 6:].any()


@pytest.mark.parametrize("length", [1e-42, 1e-30, 1e-10, 1.0, 1e10, 1e30])
def test_quaternions_of_any_length_turn_alike(length):
    means, scales, wxyz, opacity = splats(20)
    _, unit = packed(means, scales, wxyz, opacity)
    _, other = packed(means, scales, (wxyz * np.float64(length)).astype(np.float32), opacity)
    if length > 1e-40:  # denormals keep but a few digits
        np.testing.assert_allclose(other, unit, rtol=1e-4, atol=1e-9)
    assert np.isfinite(other).all()


def test_no_turn_for_zero_and_nan_stays_nan():
    means, scales, wxyz, opacity = splats(9)
    wxyz[3], wxyz[5, 2] = 0, np.nan
    _, covariance = packed(means, scales, wxyz, opacity)
    np.testing.assert_allclose(covariance[3, [0, 3, 5]], scales[3] ** 2, rtol=1e-6)
    assert np.isnan(covariance[5, :6]).any() and np.isfinite(np.delete(covariance, 5, 0)).all()


@pytest.mark.parametrize("count", [0, 1, 64, 65])
def test_opacities_or_colours_alone(count):
    d = device()
    rows = np.arange((BEFORE + count + AFTER) * 4, dtype=np.float32).reshape(-1, 4)
    array, opacity = d.upload(rows), np.linspace(0, 1, count).astype(np.float32)
    pack_opacity(d, opacity, BEFORE, array)
    rows[BEFORE : BEFORE + count, 3] = opacity
    np.testing.assert_array_equal(d.download(array), rows)
    color = np.random.default_rng(0).uniform(size=(count, 3)).astype(np.float32)
    pack_color(d, color, BEFORE, array)
    rows[BEFORE : BEFORE + count] = np.column_stack([color, np.zeros(count)])
    np.testing.assert_array_equal(d.download(array), rows)
