"""What thumbsticks do to the panel: the carrying hand slides, the pointing one scrolls."""

import math

import pytest

from shapeshift.runtime_models.model import Stop
from shapeshift.vr.panel import (
    DEAD,
    MIDDLE,
    MOVES,
    RESTS,
    SCROLL_SPEED,
    SCROLLS,
    SLIDE_SPEED,
    SLIDES,
    scroll,
    slide,
)

STOPS = (Stop("normal", 0.0), Stop("ice", 0.25), Stop("fire", 0.5), Stop("charcoal", 1.0))


def test_the_thumbstick_rests_at_every_stop():
    does, x, rested = MIDDLE, 0.0, []
    for _ in range(400):
        does, x = slide(does, (1.0, 0.2), x, STOPS, 0.01)
        if does == RESTS:
            assert slide(does, (1.0, 0.2), x, STOPS, 0.01) == (RESTS, x)
            rested.append(x)
            does, x = slide(does, (0.0, 0.0), x, STOPS, 0.01)
            assert does == MIDDLE
    assert rested == [0.25, 0.5, 1.0]
    assert slide(MIDDLE, (DEAD, 0.0), 0.3, STOPS, 1.0) == (MIDDLE, 0.3)


def test_it_slides_as_fast_as_it_is_pushed():
    """A full push: SLIDE_SPEED of the range a second; half-way beyond the dead zone: half."""
    for push, part in ((1.0, 1.0), (DEAD + (1 - DEAD) / 2, 0.5), (-1.0, -1.0)):
        _, x = slide(MIDDLE, (push, 0.0), 0.7, STOPS, 0.1)
        assert x == pytest.approx(0.7 + part * SLIDE_SPEED * 0.1)


def test_a_thumbstick_that_began_to_walk_walks_on():
    does, x = slide(MIDDLE, (0.3, 0.9), 0.1, STOPS, 0.1)
    assert (does, x) == (MOVES, 0.1)
    does, x = slide(does, (0.9, 0.1), x, STOPS, 0.1)
    assert (does, x) == (MOVES, 0.1)
    does, x = slide(does, (0.1, 0.0), x, STOPS, 0.1)
    assert slide(does, (0.9, 0.1), x, STOPS, 0.1)[1] > 0.1


def test_the_thumbstick_ends_at_the_end_without_a_stop_there():
    assert slide(MIDDLE, (1.0, 0.0), 0.95, STOPS[:3], 1.0) == (SLIDES, 1.0)


def test_a_stick_scrolls_where_its_hand_points_at_the_panel():
    does, notches = scroll(MIDDLE, (0.2, -1.0), True, 0.5)
    assert does == SCROLLS and notches == pytest.approx(-0.5 * SCROLL_SPEED)
    does, more = scroll(does, (0.2, -1.0), False, 0.5)  # a trembling ray scrolls on
    assert does == SCROLLS and more == notches
    assert scroll(does, (0.0, 0.0), True, 0.5) == (MIDDLE, 0.0)


@pytest.mark.parametrize(
    ("stick", "on_panel"), [((0.2, -1.0), False), ((1.0, 0.2), True), ((-1.0, 1.0), True)]
)
def test_a_stick_that_began_to_turn_or_fly_scrolls_nothing(stick, on_panel):
    does, notches = scroll(MIDDLE, stick, on_panel, 0.5)
    assert (does, notches) == (MOVES, 0.0)
    assert scroll(does, (0.0, 1.0), True, 0.5) == (MOVES, 0.0)


@pytest.mark.parametrize("stick", [(math.nan, 0.0), (math.nan, math.nan), (0.0, math.nan)])
def test_a_stick_that_tells_no_number_rests(stick):
    assert slide(SLIDES, stick, 0.3, STOPS, 0.1) == (MIDDLE, 0.3)
    assert scroll(SCROLLS, stick, True, 0.1) == (MIDDLE, 0.0)
