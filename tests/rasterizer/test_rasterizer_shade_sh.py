"""shade_sh against runtime_models' spherical harmonics: block edges, what is not seen, NaN."""

import numpy as np
import pytest

from shapeshift.rasterizer.colors import shade_sh, upload_sh
from shapeshift.runtime_models.colors.spherical_harmonics import shade
from shapeshift.runtime_models.evaluate import directions
from tests.support.renderer.rasterizer_scenes import device

EYE = np.array([0.3, -0.2, 2.0], np.float32)
BEFORE, AFTER = 3, 5  # rows of other objects


def shaded(means, sh, seen=None) -> np.ndarray:
    """(BEFORE + n + AFTER, 3): -7 where nothing was written."""
    d, n = device(), len(means)
    mean_opacity = np.full((BEFORE + n + AFTER, 4), np.nan, np.float32)
    mean_opacity[BEFORE : BEFORE + n, :3] = means
    color = d.upload(np.full((BEFORE + n + AFTER, 4), -7, np.float32))
    rows = slice(BEFORE, BEFORE + n)
    shade_sh(d, upload_sh(d, sh), EYE, rows, d.upload(mean_opacity), color, seen)
    d.queue.finish()
    return d.download(color)[:, :3]


def splats(count: int, coefficients: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(count)
    means = rng.normal(size=(count, 3)).astype(np.float32)
    return means, (rng.normal(size=(count, coefficients, 3)) * 0.4).astype(np.float32)


@pytest.mark.parametrize("coefficients", [1, 4, 9, 16])
@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 255, 256, 257, 1000])
def test_it_is_the_formula_and_writes_its_own_rows_only(count, coefficients):
    means, sh = splats(count, coefficients)
    got = shaded(means, sh)
    np.testing.assert_allclose(
        got[BEFORE : BEFORE + count], shade(sh, directions(means, EYE)), atol=3e-6
    )
    assert (got[:BEFORE] == -7).all() and (got[BEFORE + count :] == -7).all()


@pytest.mark.parametrize("count", [0, 1, 8, 9, 1000])
def test_what_is_seen_is_coloured_and_blocks_that_are_not_stay(count):
    means, sh = splats(count, 16)
    seen = np.arange(count) % 40 == 3
    got, whole = (shaded(means, sh, s)[BEFORE : BEFORE + count] for s in (seen, None))
    np.testing.assert_array_equal(got[seen], whole[seen])
    blocks = np.arange(count) // 8
    kept = ~np.isin(blocks, blocks[seen])
    assert (got[kept] == -7).all()


def test_numbers_that_are_none_are_handed_on_and_the_eye_itself_has_a_colour():
    means, sh = splats(9, 4)
    sh[2, 1, 0] = np.nan
    means[4] = np.inf
    means[8] = EYE
    got = shaded(means, sh)[BEFORE : BEFORE + 9]
    assert np.isnan(got[2, 0]) and not np.isfinite(got[4]).any()
    good = [0, 1, 3, 5, 6, 7, 8]
    np.testing.assert_allclose(got[good], shade(sh, directions(means, EYE))[good], atol=3e-6)
