"""Dynamic resolution against simulated loads: it arrives, stays, and takes no nonsense."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapeshift.renderer.resolution import OVER, SEEN, STEP, Resolution


def run(control, load, frames):
    """Scales of `frames` frames whose time is load(scale, frame number)."""
    scales = []
    for number in range(frames):
        scales.append(control.scale)
        control.seen(load(control.scale, number))
    return scales


def changes(scales):
    return sum(a != b for a, b in pairwise(scales))


LOADS = st.tuples(st.floats(0, 40), st.floats(0.01, 60), st.floats(0, 0.25))  # fixed, pixels, noise


@settings(max_examples=200)
@given(LOADS, st.floats(4, 40), st.sampled_from([0.25, 0.5, 0.75, 1.0]), st.integers(0, 99))
def test_it_arrives_and_stays(load, target, least, seed):
    """After it has settled it holds the target, or stands at its least; it does not swing."""
    fixed, pixels, noise = load
    rng = np.random.default_rng(seed)
    control = Resolution(target, least)
    scales = run(
        control,
        lambda scale, _: (fixed + pixels * scale**2) * rng.uniform(1, 1 + noise),
        frames=100 * SEEN,
    )
    assert all(least <= scale <= 1 and scale % STEP == 0 for scale in scales)
    settled = scales[50 * SEEN :]
    assert changes(settled) <= 6  # a rare try to grow, never a swing every few frames
    most = max(settled)
    if most > least:
        assert fixed + pixels * min(settled) ** 2 <= OVER * target


@settings(max_examples=200)
@given(st.floats(0, 30), st.floats(0.01, 60), st.floats(4, 40))
def test_without_noise_it_stands_still(fixed, pixels, target):
    """And as high as it may: one step more would be over what it aims at."""
    control = Resolution(target, 0.25)
    scales = run(control, lambda scale, _: fixed + pixels * scale**2, 100 * SEEN)
    assert changes(scales[50 * SEEN :]) == 0
    now, ms = scales[-1], fixed + pixels * scales[-1] ** 2
    assert ms <= OVER * target or now == 0.25
    larger = min(now + STEP, 1.0)
    fits = ms < 0.85 * target and ms * (larger / now) ** 2 <= 0.95 * target
    assert now == 1.0 or not fits


def test_it_comes_back_when_the_load_goes():
    control = Resolution(10.0, 0.5)
    scales = run(control, lambda s, n: (30 if n < 200 else 5) * s**2, 1000)
    assert scales[150] <= 0.5625 and scales[-1] == 1.0


def test_it_shrinks_within_a_few_frames():
    control = Resolution(10.0, 0.25)
    scales = run(control, lambda s, n: 40 * s**2, 3 * SEEN)
    assert scales[SEEN] <= 0.5 and 40 * scales[-1] ** 2 <= OVER * 10


def test_one_slow_frame_is_nothing():
    control = Resolution(10.0, 0.25)
    assert set(run(control, lambda s, n: 500 if n % 20 == 7 else 9.0, 400)) == {1.0}


@pytest.mark.parametrize("nonsense", [0, 0.0, -3.0, math.nan, math.inf, -math.inf])
def test_times_that_are_none_are_ignored(nonsense):
    """Mixed in or alone they change nothing that the others would not have done."""
    alone = Resolution(10.0, 0.25)
    assert set(run(alone, lambda s, n: nonsense, 100)) == {1.0}
    plain, mixed = Resolution(10.0, 0.25), Resolution(10.0, 0.25)
    for _ in range(100):
        mixed.seen(nonsense)
        assert plain.seen(30 * plain.scale**2) == mixed.seen(30 * mixed.scale**2)


def test_least_is_on_a_step_and_above_what_was_asked():
    control = Resolution(1.0, 0.3)
    run(control, lambda s, n: 100.0, 100)
    assert control.scale == 0.3125
    assert Resolution(1.0, 1.0).scale == 1.0
    assert Resolution(1.0, 0.5, scale=0.1).scale == 0.5


@pytest.mark.parametrize(("target", "least"), [(0, 0.5), (math.nan, 0.5), (math.inf, 0.5),
                                               (9, 0), (9, 1.5), (9, math.nan)])  # fmt: skip
def test_refused(target, least):
    with pytest.raises(ValueError, match="expected"):
        Resolution(target, least)


def growths(lasts: int, frames: int = 900) -> list[int]:
    """Frames after which it grows; the larger scale is fast enough for its first `lasts` alone."""
    control, larger, grown = Resolution(10.0, 0.25, scale=0.5), 0, []
    for frame in range(frames):
        before = control.scale
        larger = larger + 1 if before > 0.5 else 0
        control.seen(7.0 if before == 0.5 else 9.0 if larger <= lasts else 12.0)
        if control.scale > before:
            grown.append(frame)
    return grown


def test_growth_that_is_taken_back_waits_twice_as_long_unless_it_has_lasted():
    """Five slow frames of eight are a median that is; then so many frames until the next try."""
    waits = [gap - 5 - 10 for gap in np.diff(growths(10))]
    assert waits[:5] == [2 * SEEN, 4 * SEEN, 8 * SEEN, 16 * SEEN, 16 * SEEN]  # and no longer
    assert {gap - 5 - 20 for gap in np.diff(growths(20))} == {SEEN}
