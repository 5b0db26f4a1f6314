"""Both back ends of the sort against numpy's stable argsort, at the sizes where blocks end."""

import numpy as np
import pytest

from shapeshift.renderer import layout
from shapeshift.renderer.gl.buffers import Arena
from shapeshift.renderer.gl.sort import Sorter, quantize, stable_order
from tests.support.renderer.gl_models import read

BLOCK = layout.WORKGROUP
GROUP = layout.WORKGROUP * layout.SORT_BLOCKS
SIZES = (1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 5, GROUP - 1, GROUP, GROUP + 1, 3 * GROUP + 77)


def patterns(n: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(n)
    anything = rng.integers(0, 2**32, n, dtype=np.uint32)
    some_culled = np.where(rng.random(n) < 0.3, np.uint32(layout.CULLED_KEY), anything)
    depths = rng.choice(np.float32([0.05, 1.0, 1.0000001, 2.5, 1e-40, 3e38]), n).astype(np.float32)
    return {
        "anything": anything,
        "few values": rng.integers(0, 3, n).astype(np.uint32) << np.uint32(8),
        "all equal": np.full(n, 0x3F800000, np.uint32),
        "all culled": np.full(n, layout.CULLED_KEY, np.uint32),
        "some culled": some_culled,
        "sorted": np.sort(anything),
        "reversed": np.sort(anything)[::-1].copy(),
        "depths": depths.view(np.uint32),
    }


def set_keys(arena: Arena, keys: np.ndarray) -> None:
    """What project would have left: keys, how many are drawn, their range."""
    arena.keys.write(keys)
    drawn = keys[keys != layout.CULLED_KEY]
    counts = np.zeros(layout.COUNTS_SIZE, np.uint32)
    counts[layout.COUNTS["SORTED"]] = len(drawn)
    counts[layout.COUNTS["NEAREST"]] = drawn.min(initial=layout.CULLED_KEY)
    counts[layout.COUNTS["FARTHEST"]] = drawn.max(initial=0)
    arena.counts.write(counts)


@pytest.mark.parametrize("backend", ["gl", "numpy"])
@pytest.mark.parametrize("n", SIZES)
def test_32_bits_equal_the_stable_argsort(gpu, n, backend):
    sorter = Sorter(gpu, backend)
    with Arena(gpu, [n]) as arena:
        for name, keys in patterns(n).items():
            set_keys(arena, keys)
            sorter.sort(arena, 32)
            expected = np.argsort(keys, kind="stable")
            np.testing.assert_array_equal(read(arena.order, np.uint32), expected, name)
            drawn = np.count_nonzero(keys != layout.CULLED_KEY)
            assert read(arena.command, np.uint32).tolist() == [3 * drawn, 1, 0, 0, 0]


@pytest.mark.parametrize("backend", ["gl", "numpy"])
@pytest.mark.parametrize("n", SIZES)
def test_16_bits_sort_depths_by_steps_of_the_frame_s_range(gpu, n, backend):
    rng = np.random.default_rng(n)
    depth = rng.uniform(0.5, 4.0, n).astype(np.float32)
    keys = np.where(rng.random(n) < 0.2, np.uint32(layout.CULLED_KEY), depth.view(np.uint32))
    with Arena(gpu, [n]) as arena:
        set_keys(arena, keys)
        Sorter(gpu, backend).sort(arena, 16)
        order = read(arena.order, np.uint32)
    assert sorted(order.tolist()) == list(range(n))
    drawn = np.count_nonzero(keys != layout.CULLED_KEY)
    assert (keys[order[:drawn]] != layout.CULLED_KEY).all()
    step = np.ptp(depth) / 65534 * 1.01
    assert np.all(np.diff(depth[order[:drawn]]) >= -step)
    rest = order[drawn:].astype(int)
    assert np.all(np.diff(rest) > 0)  # stable: culled ones stay in their order


def test_both_back_ends_make_the_same_steps(gpu):
    rng = np.random.default_rng(5)
    depth = rng.uniform(0.05, 100.0, 5000).astype(np.float32)
    keys = np.where(rng.random(5000) < 0.2, np.uint32(layout.CULLED_KEY), depth.view(np.uint32))
    with Arena(gpu, [5000]) as arena:
        set_keys(arena, keys)
        Sorter(gpu, "gl").sort(arena, 16)
        order, steps = read(arena.order, np.uint32), read(arena.keys, np.uint32)
    expected = quantize(keys)
    assert np.abs(steps.astype(int) - expected[order].astype(int)).max() <= 1  # last digit
    assert np.all(np.diff(steps.astype(int)) >= 0)
    assert np.count_nonzero(steps == 65535) == np.count_nonzero(keys == layout.CULLED_KEY)


def test_quantize_spans_the_range_and_survives_one_depth():
    keys = np.float32([2.0, 4.0, 3.0]).view(np.uint32)
    np.testing.assert_array_equal(quantize(keys), [0, 65534, 32767])
    np.testing.assert_array_equal(quantize(keys[:1]), [0])
    culled = np.full(3, layout.CULLED_KEY, np.uint32)
    np.testing.assert_array_equal(quantize(culled), [65535] * 3)
    np.testing.assert_array_equal(quantize(np.append(keys, culled[:1])), [0, 65534, 32767, 65535])


@pytest.mark.parametrize("n", [0, 1, 2, 1000])
@pytest.mark.parametrize("nearest, farthest", [(0.05, 0.05), (1e-40, 3e-40), (1e-6, 3e38), (2, 6)])
def test_quantize_is_the_plain_formula_of_float32(n, nearest, farthest):
    rng = np.random.default_rng(n)
    depth = rng.uniform(nearest, farthest, n).astype(np.float32)
    for culled in (0.0, 0.3, 1.0):
        seen = rng.random(n) >= culled
        keys = np.where(seen, depth.view(np.uint32), np.uint32(layout.CULLED_KEY))
        expected = np.full(n, 65535)
        if seen.any():
            least, reach = depth[seen].min(), np.maximum(np.ptp(depth[seen]), np.float32(1e-30))
            expected[seen] = np.minimum((depth[seen] - least) * (np.float32(65534) / reach), 65534)
        steps = quantize(keys)
        np.testing.assert_array_equal(steps, expected)
        assert steps.dtype == np.uint16


def test_stable_order_of_nothing():
    assert stable_order(np.zeros(0, np.uint32)).shape == (0,)


@pytest.mark.parametrize("backend", ["gl", "numpy"])
def test_an_empty_arena_draws_nothing(gpu, backend):
    with Arena(gpu, []) as arena:
        Sorter(gpu, backend).sort(arena)
        assert read(arena.command, np.uint32).tolist() == [0, 1, 0, 0, 0]


def test_unknown_choices_are_refused(gpu):
    with pytest.raises(ValueError, match="choose gl or numpy"):
        Sorter(gpu, "bitonic")
    with Arena(gpu, [1]) as arena, pytest.raises(ValueError, match="choose 16 or 32"):
        Sorter(gpu, "gl").sort(arena, 24)
