"""The fast parts of judging against plain row-by-row forms: what is odd, our units, turns."""

import numpy as np
import pytest

from shapeshift.runtime_models.colors.spherical_harmonics import shade
from shapeshift.runtime_models.files.blocks import BLOCK, WORTH_A_THREAD, each_block
from shapeshift.runtime_models.lint.lint import judge
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.rotation import covariance
from shapeshift.runtime_models.splats.formats import read_plain
from shapeshift.runtime_models.splats.operations.activate import activate
from shapeshift.runtime_models.splats.operations.rotate_splats import ours_from_file, rotate_splats
from shapeshift.runtime_models.splats.plain_splats import AXES, RawSplats, Reading
from tests.support.splats.lint_scenes import invalid_rows
from tests.support.splats.ply_files import some_splats

COUNTS = (1, 256, 257, BLOCK, BLOCK + 1, WORTH_A_THREAD * BLOCK + 1)
POISON = (np.nan, np.inf, -np.inf, 3e38, -3e38, 1e-42, 0.0, 81.0, 79.0)


def raw_splats(count: int, coefficients: int = 4, seed: int = 0, **coding) -> RawSplats:
    plain = some_splats(count, coefficients, seed)
    arrays = [plain.means, plain.scales, plain.wxyz * 3, plain.opacity, plain.sh]
    return RawSplats(*(a.copy() for a in arrays), file="a.ply", format="ply", **coding)


def odd_row(raw: RawSplats, i: int) -> bool:
    """What invalid_rows says in words, for one row."""
    numbers = [*raw.means[i], *raw.scales[i], *raw.wxyz[i], raw.opacity[i], *raw.sh[i].ravel()]
    if not all(np.isfinite(numbers)):
        return True
    length = sum(float(q) ** 2 for q in raw.wxyz[i])
    if not 1e-30 <= length <= 1e30:
        return True
    scales, opacity = raw.scales[i], raw.opacity[i]
    return not (
        (all(s <= 80 for s in scales) if raw.log_scales else all(s >= 0 for s in scales))
        and (raw.logits or 0 <= opacity <= 1)
    )


@pytest.mark.parametrize("coded", [True, False])
@pytest.mark.parametrize("count", COUNTS)
def test_odd_rows_are_those_of_the_words(count, coded):
    raw = raw_splats(count, log_scales=coded, logits=coded)
    assert len(invalid_rows(raw)) == 0
    rng = np.random.default_rng(count)
    arrays = [raw.means, raw.scales, raw.wxyz, raw.opacity[:, None], raw.sh.reshape(count, -1)]
    touched = {0, count - 1, *rng.integers(0, count, 60).tolist()}
    touched |= {i for i in (BLOCK - 1, BLOCK) if i < count}
    for i in touched:
        array = arrays[rng.integers(len(arrays))]
        array[i, rng.integers(array.shape[1])] = rng.choice(POISON)
    raw.wxyz[count // 2] = 0
    want = [i for i in sorted(touched | {count // 2}) if odd_row(raw, i)]
    assert invalid_rows(raw).tolist() == want and want


@pytest.mark.parametrize("coefficients", [1, 4, 9, 16])
@pytest.mark.parametrize("count", COUNTS[:-1])
def test_own_units_are_the_formulas(count, coefficients):
    raw, was = raw_splats(count, coefficients), raw_splats(count, coefficients)
    raw.scales[0] = was.scales[0] = [-np.inf, -80, 80]
    raw.opacity[0] = was.opacity[0] = np.inf
    raw.opacity[-1] = was.opacity[-1] = -200 if count > 1 else np.inf
    activate(raw, ours_from_file("-Y"))
    np.testing.assert_array_equal(raw.means, was.means * [1, -1, -1])
    np.testing.assert_allclose(raw.scales, np.exp(was.scales.astype(float)), rtol=2e-7)
    want = 1 / (1 + np.exp(-np.clip(was.opacity.astype(float), -700, 700)))
    np.testing.assert_allclose(raw.opacity, want, rtol=3e-7, atol=1e-38)
    np.testing.assert_allclose(np.linalg.norm(raw.wxyz, axis=1), 1, atol=2e-7)
    w, x, y, z = was.wxyz.T / np.linalg.norm(was.wxyz, axis=1)
    np.testing.assert_allclose(raw.wxyz, np.stack([-x, w, -z, y], 1), atol=2e-7)
    d = np.random.default_rng(3).normal(size=(count, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    np.testing.assert_allclose(shade(raw.sh, d * [1, -1, -1]), shade(was.sh, d), atol=2e-5)


@pytest.mark.parametrize("up", AXES)
@pytest.mark.parametrize("flip", [False, True])
def test_every_turn_turns_places_shapes_and_colours_together(up, flip):
    rotation, was = ours_from_file(up, flip), some_splats(BLOCK + 1, 16)
    turned = rotate_splats(was, rotation)
    np.testing.assert_allclose(turned.means, was.means @ rotation.T, atol=1e-6)
    full = np.zeros((2, len(was.means), 3, 3))
    for i, splats in enumerate((was, turned)):
        c = covariance(splats.scales, splats.wxyz)
        full[i] = c[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    np.testing.assert_allclose(full[1], rotation @ full[0] @ rotation.T, atol=2e-6)
    d = np.random.default_rng(3).normal(size=(len(was.means), 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    np.testing.assert_allclose(shade(turned.sh, d @ rotation.T), shade(was.sh, d), atol=2e-5)


def test_arrays_that_may_not_be_written_are_copied():
    raw = raw_splats(3)
    before = raw.sh
    raw.sh.flags.writeable = raw.means.flags.writeable = False
    plain = judge(raw, Reading())
    assert plain.sh is not before and (plain.sh[:, 1] == -before[:, 1]).all()


def test_a_row_at_each_end_of_a_block_is_dropped_and_the_rest_stays(tmp_path):
    rows = [0, BLOCK - 1, BLOCK, 2 * BLOCK + 1]
    raw, was = raw_splats(2 * BLOCK + 2), raw_splats(2 * BLOCK + 2)
    raw.sh[rows, 2, 1] = [np.nan, np.inf, -np.inf, np.nan]
    raw.extra = {"kept": np.arange(2 * BLOCK + 2)}
    raw.labels = np.arange(2 * BLOCK + 2, dtype=np.int32)
    plain = judge(raw, Reading(allow_huge=True))
    kept = np.setdiff1d(np.arange(2 * BLOCK + 2), rows)
    np.testing.assert_array_equal(plain.means, was.means[kept] * np.array([1, -1, -1], np.float32))
    assert plain.extra["kept"].tolist() == plain.labels.tolist() == kept.tolist()
    (found,) = [f for f in plain.findings if f.done == "dropped"]
    assert found.count == 4 and found.rows == tuple(rows)


def test_errors_and_settings_cross_the_threads():
    count = 40 * BLOCK
    seen = np.zeros(count, int)

    def work(rows, own):
        seen[rows] += 1
        if rows.start == 17 * BLOCK:
            raise BadFile("block 17")

    with pytest.raises(BadFile, match="block 17"):
        each_block(count, work)
    assert seen.max() == 1
    with np.errstate(over="raise"), pytest.raises(FloatingPointError):
        each_block(count, lambda rows, own: np.exp(np.full(1, 1e4, np.float32)))
    with pytest.raises(KeyboardInterrupt):
        each_block(3 * BLOCK, lambda rows, own: None, progress=interrupt)


def interrupt(part: float) -> None:
    raise KeyboardInterrupt


def test_an_empty_range_is_no_block():
    each_block(0, lambda rows, own: pytest.fail("called"))


def test_a_real_file_is_the_same_by_the_plain_forms(data):
    path = data / "anatomy_leg_ml3dgs" / "layer0.ply"
    from shapeshift.runtime_models.splats.ply.read_ply import read_raw_ply

    raw, plain = read_raw_ply(path, Reading()), read_plain(path)
    np.testing.assert_array_equal(plain.means, raw.means * np.array([1, -1, -1], np.float32))
    np.testing.assert_allclose(plain.scales, np.exp(raw.scales.astype(float)), rtol=3e-7)
    np.testing.assert_allclose(
        plain.opacity, 1 / (1 + np.exp(-raw.opacity.astype(float))), rtol=3e-7
    )
