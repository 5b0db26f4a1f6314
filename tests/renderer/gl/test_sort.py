"""Both back ends of the sort against numpy's stable argsort, at the sizes where blocks end."""

import numpy as np
import pytest

from shapeshift.renderer import layout
from shapeshift.renderer.gl.buffers import Arena
from shapeshift.renderer.gl.sort_check import Sorter, quantize, stable_order
from tests.support.renderer.gl_models import read

BLOCK = layout.WORKGROUP
GROUP = layout.WORKGROUP * layout.SORT_BLOCKS
SIZES = (1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 5, GROUP - 1, GROUP, GROUP + 1, 3 * GROUP + 77)


def patterns(n: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(n)
    anything = rng.integers(0, 2**32, n, dtype=np.uint32)
    some_culled = np.where(rng.random(n) < 0.3, np.uint32(layout.CULLED_KEY), anything)
    depths = rng.choice(np.array([0.05, 1.0, 1.0000001, 2.5, 1e-40, 3e38], np.float32), n).astype(
        np.float32
    )
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
            drawn = np.count_nonzero(keys != layout.CULLED_KEY)
            order = read(arena.order, np.uint32)[:drawn]  # what lies behind them is nobody's
            np.testing.assert_array_equal(order, expected[:drawn], name)
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
    there = np.flatnonzero(keys != layout.CULLED_KEY)
    order = order[: len(there)]
    assert sorted(order.tolist()) == there.tolist()
    step = np.ptp(depth) / 65534 * 1.01
    assert np.all(np.diff(depth[order]) >= -step)


def test_both_back_ends_make_the_same_steps(gpu):
    rng = np.random.default_rng(5)
    depth = rng.uniform(0.05, 100.0, 5000).astype(np.float32)
    keys = np.where(rng.random(5000) < 0.2, np.uint32(layout.CULLED_KEY), depth.view(np.uint32))
    with Arena(gpu, [5000]) as arena:
        set_keys(arena, keys)
        Sorter(gpu, "gl").sort(arena, 16)
        order, steps = read(arena.order, np.uint32), read(arena.keys, np.uint32)
    drawn = np.count_nonzero(keys != layout.CULLED_KEY)
    order, steps, expected = order[:drawn].astype(int), steps[:drawn].astype(int), quantize(keys)
    assert np.abs(steps - expected[order].astype(int)).max() <= 1  # last digit
    assert steps.max() < 65535
    rises, later = np.diff(steps), np.diff(order) > 0
    assert np.all((rises > 0) | ((rises == 0) & later))  # stable


@pytest.mark.parametrize("bits", [16, 32])
def test_passes_after_the_first_have_what_is_sorted_alone(gpu, bits):
    """Groups of the indirect dispatch, where blocks and groups end; one arena, more and fewer."""
    n, rng = 3 * GROUP + 77, np.random.default_rng(bits)
    with Arena(gpu, [n]) as arena:
        sorter = Sorter(gpu, "gl")
        for drawn in (n, 0, 1, GROUP - 1, GROUP, GROUP + 1, 2 * GROUP, n - 1):
            keys = np.full(n, layout.CULLED_KEY, np.uint32)
            here = np.sort(rng.permutation(n)[:drawn])
            keys[here] = rng.uniform(0.5, 4.0, drawn).astype(np.float32).view(np.uint32)
            set_keys(arena, keys)
            sorter.sort(arena, bits)
            groups = [-(-drawn // GROUP), 1, 1, layout.RADIX if drawn else 0, 1, 1]
            told = read(arena.dispatch, np.uint32).reshape(-1, 3)[:6].reshape(3, 6)
            passes = told[:, 0].astype(bool).sum() + 1
            for later in range(3):
                none = later >= passes - 1
                assert told[later].tolist() == ([0, 1, 1, 0, 1, 1] if none else groups)
            assert passes <= bits // 8
            order = read(arena.order, np.uint32)[:drawn]
            if bits == 32:
                np.testing.assert_array_equal(order, np.argsort(keys, kind="stable")[:drawn])
            np.testing.assert_array_equal(np.sort(order), here)


@pytest.mark.parametrize(
    ("span", "passes"), [(0, 1), (255, 1), (256, 2), (65535, 2), (65536, 3), (2**24 - 1, 3),
                         (2**24, 4), (2**32 - 2, 4)],
)  # fmt: skip
def test_as_many_passes_as_the_range_of_the_keys_asks_for(gpu, span, passes):
    """The last key has all bits set but one where the range is the largest."""
    n, rng = GROUP + 1, np.random.default_rng(span)
    least = min(0x3F000001, 2**32 - 2 - span)
    keys = (least + rng.integers(0, span + 1, n)).astype(np.uint32)
    keys[[7, 5]] = least, least + span
    with Arena(gpu, [n]) as arena:
        set_keys(arena, keys)
        Sorter(gpu, "gl").sort(arena, 32)
        told = read(arena.dispatch, np.uint32)
        assert told[layout.DISPATCH["PASSES"]] == passes
        np.testing.assert_array_equal(read(arena.order, np.uint32), np.argsort(keys, kind="stable"))


def test_more_groups_than_one_round_of_the_scan_adds_up(gpu):
    n = layout.WORKGROUP * GROUP + 1
    keys = np.random.default_rng(n).integers(0, 700, n).astype(np.uint32)
    with Arena(gpu, [n]) as arena:
        set_keys(arena, keys)
        Sorter(gpu, "gl").sort(arena, 32)
        np.testing.assert_array_equal(read(arena.order, np.uint32), np.argsort(keys, kind="stable"))


def test_a_range_that_nobody_found_takes_all_passes(gpu):
    keys = np.random.default_rng(3).integers(0, 700, 300).astype(np.uint32)
    with Arena(gpu, [300]) as arena:
        arena.keys.write(keys)
        counts = np.zeros(layout.COUNTS_SIZE, np.uint32)
        counts[[layout.COUNTS["SORTED"], layout.COUNTS["NEAREST"]]] = 300, layout.CULLED_KEY
        arena.counts.write(counts)
        Sorter(gpu, "gl").sort(arena, 32)
        assert read(arena.dispatch, np.uint32)[layout.DISPATCH["PASSES"]] == 4
        np.testing.assert_array_equal(read(arena.order, np.uint32), np.argsort(keys, kind="stable"))


def test_quantize_spans_the_range_and_survives_one_depth():
    keys = np.array([2.0, 4.0, 3.0], np.float32).view(np.uint32)
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
