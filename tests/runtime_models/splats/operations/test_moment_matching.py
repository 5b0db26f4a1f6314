"""One splat for several: its moments against samples, its area against shadows, its alpha."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import multivariate_normal

from shapeshift.runtime_models.colors.spherical_harmonics import basis
from shapeshift.runtime_models.files import blocks
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.runtime_models.splats.operations.moment_matching import (
    MERGED_AT_ONCE,
    mean_area,
    merge_groups,
    shown_area,
)
from tests.support.splat_scenes import FIELDS, random_layers

SAMPLES = 400_000


def merge(layers: SplatLayers, group: np.ndarray) -> SplatLayers:
    return merge_groups(layers, group)[0]


def covariances(layers: SplatLayers) -> np.ndarray:
    """(N, 3, 3) by scipy's rotations."""
    axes = Rotation.from_quat(layers.wxyz, scalar_first=True).as_matrix()
    return np.einsum("nij,nj,nkj->nik", axes, layers.scales.astype(np.float64) ** 2, axes)


def six(matrices: np.ndarray) -> np.ndarray:
    return np.stack([matrices[:, i, j] for i in range(3) for j in range(i, 3)])


def test_the_mean_area_is_that_of_shadows_from_all_sides():
    """A shadow along a direction is the ellipse of the covariance in the plane across it."""
    layers = random_layers(20)
    rng = np.random.default_rng(0)
    turns = Rotation.random(20_000, rng=rng).as_matrix()[:, :2]  # two axes across a direction
    for each in range(20):
        across = turns @ covariances(layers)[each] @ turns.transpose(0, 2, 1)
        squares = np.linalg.det(across)  # of the area by pi
        expected, error = squares.mean(), squares.std() / len(squares) ** 0.5
        found = mean_area(six(covariances(layers)[each : each + 1]))[0] ** 2
        assert abs(found - expected) < 5 * error
    area = mean_area(six(covariances(layers)))
    np.testing.assert_allclose(shown_area(layers.scales, layers.opacity), area * layers.opacity,
                               rtol=1e-5)  # fmt: skip


@pytest.mark.parametrize("count", [2, 3, 7])
def test_a_merged_splat_has_the_moments_of_what_it_stands_for(count):
    """Against points drawn from the mixture: each as often as its opacity times area says."""
    layers = replace(random_layers(count, seed=count), opacity=np.full(count, 0.1, np.float32))
    merged, into = merge_groups(layers, np.zeros(count, int))
    assert into.tolist() == [0] * count
    assert merged.splat_count == 1
    weight = layers.opacity * mean_area(six(covariances(layers)))
    weight /= weight.sum()
    rng = np.random.default_rng(0)
    drawn = rng.multinomial(SAMPLES, weight)
    points = np.concatenate([
        multivariate_normal(mean, matrix).rvs(n, random_state=rng)
        for mean, matrix, n in zip(layers.means, covariances(layers), drawn, strict=True)
    ])  # fmt: skip
    sample, spread = np.cov(points.T), covariances(merged)[0]
    sigma = np.sqrt(np.diag(spread))
    # The standard error of a mean is sigma / sqrt(n), of a covariance some of sigma^2 / sqrt(n):
    # the kurtosis of a mixture is not that of one Gaussian, but below 10 here.
    assert (np.abs(points.mean(axis=0) - merged.means[0]) < 5 * sigma / SAMPLES**0.5).all()
    assert (np.abs(sample - spread) < 5 * 3 * np.outer(sigma, sigma) / SAMPLES**0.5).all()


def test_colours_of_every_direction_are_the_weighted_mean():
    layers = random_layers(3, coefficients=16)
    merged = merge(layers, np.zeros(3, int))
    directions = np.random.default_rng(0).normal(size=(50, 3))
    values = basis(directions / np.linalg.norm(directions, axis=1, keepdims=True), 16)
    weight = shown_area(layers.scales, layers.opacity)
    colors = np.einsum("dm,nmc->ndc", values, layers.sh)
    mean = np.einsum("n,ndc->dc", weight / weight.sum(), colors)
    np.testing.assert_allclose(values @ merged.sh[0], mean, atol=1e-5)


def test_what_is_shown_is_kept_up_to_an_opacity_of_one():
    """Opacity times area of groups is the sum of its members'; above 1 half of it, in logarithms,
    goes into the area.
    """
    layers = random_layers(4000, coefficients=1)
    near = np.repeat([0.01, 1.0], 2000)[:, None]  # half of the groups lie over each other
    layers = replace(layers, means=(layers.means * near).astype(np.float32))
    group = np.arange(4000) // 4  # the order of the leaders is that of the groups
    merged = merge(layers, group)
    before = np.bincount(group, shown_area(layers.scales, layers.opacity))
    after = shown_area(merged.scales, merged.opacity)
    full = merged.opacity == 1
    assert 0 < full.sum() < len(full)
    np.testing.assert_allclose(after[~full], before[~full], rtol=1e-5)
    assert (after[full] <= before[full] * (1 + 1e-5)).all()
    two = replace(random_layers(2), opacity=np.array([0.9, 0.9], np.float32))
    two = two.with_rows([0, 0])  # one over the other: 1.8 of one area
    (one,) = merge(two, np.zeros(2, int)).opacity
    assert one == 1
    np.testing.assert_allclose(merge(two, np.zeros(2, int)).scales[0],
                               np.sort(two.scales[0]) * 1.8**0.25, rtol=1e-5)  # fmt: skip


def test_equal_splats_keep_place_shape_and_colour():
    """Of opacity 0.3 each, three of them have 0.9 together."""
    one = replace(random_layers(1, seed=3), opacity=np.array([0.3], np.float32))
    merged = merge(one.with_rows([0, 0, 0]), np.zeros(3, int))
    np.testing.assert_allclose(covariances(merged), covariances(one), rtol=1e-5, atol=1e-12)
    np.testing.assert_allclose(merged.opacity, 0.9, rtol=1e-6)
    np.testing.assert_allclose(merged.sh, one.sh, rtol=1e-6)
    np.testing.assert_array_equal(merged.means, one.means)


def test_who_is_alone_keeps_every_bit_and_columns_are_of_who_shows_most():
    layers = random_layers(6, layers=2)
    layers = replace(
        layers, labels=np.arange(6, dtype=np.int32), extra={"own": np.arange(6, dtype=np.uint8)},
        opacity=np.array([0.1, 0.1, 0.9, 0.1, 0.1, 0.1], np.float32),
        scales=np.full((6, 3), 0.1, np.float32),
        antialiased=True, origin=(1e6, 0.0, 5.0),
    )  # fmt: skip
    merged = merge(layers, np.array([5, 1, 5, 3, 1, 5]))
    assert merged.labels.tolist() == [1, 2, 3] and merged.extra["own"].tolist() == [1, 2, 3]
    assert merged.layer.tolist() == layers.layer[[1, 2, 3]].tolist()
    assert merged.antialiased and merged.origin == layers.origin
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(merged, name)[2], getattr(layers, name)[3])
    same = merge(layers, np.arange(6))
    for name in FIELDS:
        assert getattr(same, name).tobytes() == getattr(layers, name).tobytes()


@pytest.mark.parametrize("count", [1, MERGED_AT_ONCE - 1, MERGED_AT_ONCE, MERGED_AT_ONCE + 1])
def test_blocks_and_threads_do_not_show(count, monkeypatch):
    """Each group alone is what it is among others."""
    layers = random_layers(2 * count)
    group = np.random.default_rng(0).permutation(2 * count) // 2
    whole = merge(layers, group)
    monkeypatch.setattr(blocks, "THREADS", 1)
    again = merge(layers, group)
    for name in FIELDS:
        assert getattr(whole, name).tobytes() == getattr(again, name).tobytes()
    by = {tuple(np.flatnonzero(group == g)): g for g in group[:: max(count // 5, 1)]}
    for rows in by:
        alone = merge(layers.with_rows(list(rows)), np.zeros(2, int))
        there = (whole.means == alone.means[0]).all(axis=1)
        assert there.sum() == 1
        np.testing.assert_array_equal(whole.scales[there], alone.scales)


def test_what_shows_nothing_or_reaches_far_stays_finite():
    """SplatLayers refuses what is not finite: that it is made is the proof; and nothing is lost."""
    layers = random_layers(8)
    huge, none = np.float32(3e38), np.float32(0)
    for name, value in (("scales", huge), ("scales", none), ("opacity", none), ("means", huge)):
        odd = replace(layers, **{name: np.full_like(getattr(layers, name), value)})
        assert merge(odd, np.arange(8) // 2).splat_count == 4
    ends = replace(layers.with_rows([0, 1]), means=np.array([[-3e38] * 3, [3e38] * 3], np.float32))
    assert merge(ends, np.zeros(2, int)).splat_count == 1
    unseen = replace(layers, opacity=np.zeros(8, np.float32))
    middle = merge(unseen, np.arange(8) // 2)
    np.testing.assert_allclose(middle.means, layers.means.reshape(4, 2, 3).mean(1), rtol=1e-5)
    assert (middle.opacity == 0).all()
    needles = replace(layers, scales=np.array([[10, 1e-5, 1e-5]] * 8, np.float32))
    assert (merge(needles, np.arange(8) // 2).scales.max(axis=1) > 5).all()
