"""runtime_models/stop_weights.py: blends of stops, ways between them, paces, and their text."""

import math
from itertools import permutations

import numpy as np
import pytest

from shapeshift.runtime_models.model import ControlEncoding, Stop
from shapeshift.runtime_models.stop_weights import (
    Pace,
    StopBlend,
    StopWeights,
    check_control,
    control_text,
    encode_control,
    parse_control,
)

STOPS = (Stop("RGB", 0.1), Stop("Thermal", 0.4, "thermal"), Stop("Opened", 0.9))
PACE = (Pace("RGB", "Thermal", (0, 0.1, 0.3, 1)), Pace("Opened", "RGB", (0, 0.7, 1)))
EVEN, PACED = StopBlend(STOPS), StopBlend(STOPS, PACE)
ENCODING = ControlEncoding(16, 1 / 15, 0.04)


def psi(x: float) -> np.ndarray:
    """Equations 6 and 7, written out."""
    t = [i / 15 for i in range(16)]
    return np.array([math.exp(-((a - x) ** 2) / (2 * 0.04**2)) for a in t])


@pytest.mark.parametrize("blend", (EVEN, PACED, StopBlend(STOPS, direct=True)))
def test_a_stop_is_itself_to_the_bit(blend):
    for row, stop in zip(np.eye(3), STOPS, strict=True):
        for control in (stop.x, StopWeights(((stop.name, 1.0),))):
            assert np.array_equal(blend.weights(control), row)
            assert np.array_equal(
                encode_control(ENCODING, blend, control)[0], ENCODING.encode(stop.x)
            )


@pytest.mark.parametrize("x, row", (
    (0.25, (0.5, 0.5, 0)), (0.15, (5 / 6, 1 / 6, 0)), (0.65, (0, 0.5, 0.5)),
    (0.0, (1, 0, 0)), (0.1 - 1e-12, (1, 0, 0)), (1.0, (0, 0, 1)),
))  # fmt: skip
def test_x_is_a_blend_of_its_two_neighbours(x, row):
    np.testing.assert_allclose(EVEN.weights(x), row, atol=1e-15)


def test_psi_of_a_blend_is_the_blend_of_the_psis():
    for control in (0.25, 0.7, StopWeights((("RGB", 0.2), ("Opened", 0.8)))):
        expected = sum(w * psi(s.x) for w, s in zip(EVEN.weights(control), STOPS, strict=True))
        np.testing.assert_allclose(encode_control(ENCODING, EVEN, control)[0], expected, atol=1e-7)


@pytest.mark.parametrize("x", (0.0, 0.05, 0.95, 1.0))
def test_outside_of_the_outermost_stops_x_is_encoded_as_it_is(x):
    assert np.array_equal(encode_control(ENCODING, PACED, x)[0], ENCODING.encode(x))


@pytest.mark.parametrize("blend", (
    StopBlend(()), StopBlend(STOPS[1:2]), StopBlend(STOPS, direct=True),
))  # fmt: skip
def test_without_neighbours_or_when_asked_for_x_is_encoded_as_it_is(blend):
    for x in (0.0, 0.25, 0.4, 1.0):
        assert np.array_equal(encode_control(ENCODING, blend, x)[0], ENCODING.encode(x))


def test_one_control_an_anchor_is_what_each_alone_is():
    xs = np.linspace(0, 1, 101)
    for blend in (EVEN, PACED, StopBlend(STOPS, direct=True), StopBlend(STOPS[:1])):
        together = encode_control(ENCODING, blend, xs)
        alone = [encode_control(ENCODING, blend, float(x))[0] for x in xs]
        np.testing.assert_allclose(together, alone, atol=2e-6)  # float32 where it is direct
        np.testing.assert_allclose(
            blend.weights(xs), [blend.weights(float(x)) for x in xs], atol=1e-15
        )


@pytest.mark.parametrize("blend", (EVEN, PACED))
@pytest.mark.parametrize("a, b", list(permutations(range(3), 2)))
def test_a_way_passes_no_third_stop_and_comes_back_the_same(blend, a, b):
    parts = np.linspace(0, 1, 21)
    there = [blend.between(STOPS[a].x, STOPS[b].x, t) for t in parts]
    back = [blend.between(STOPS[b].x, STOPS[a].x, t) for t in parts[::-1]]
    rows = np.array([blend.weights(control) for control in there])
    third = 3 - a - b
    assert not rows[:, third].any()
    np.testing.assert_allclose(rows.sum(axis=1), 1, atol=1e-12)
    assert (np.diff(rows[:, b]) > 0).all()
    np.testing.assert_allclose([blend.weights(c) for c in back], rows, atol=1e-12)
    places = STOPS[a].x + (STOPS[b].x - STOPS[a].x) * parts
    np.testing.assert_allclose([blend.slider_x(c) for c in there], places, atol=1e-12)


def test_a_way_follows_the_pace_of_its_pair():
    row = PACED.weights(PACED.between(0.9, 0.1, 0.25))  # a quarter of the way: half of 0.7
    np.testing.assert_allclose(row, (0.35, 0, 0.65), atol=1e-12)
    np.testing.assert_allclose(PACED.weights(0.1 + 0.3 / 3), (0.9, 0.1, 0), atol=1e-12)


@pytest.mark.parametrize("blend", (EVEN, PACED))
def test_two_halves_of_a_way_are_the_way(blend):
    for a, b in permutations((0.1, 0.4, 0.9), 2):
        for t, rest in ((0.25, 0.5), (0.5, 0.1), (0.9, 0.99)):
            halfway = blend.between(a, b, t)
            on = blend.weights(blend.between(halfway, b, rest))
            np.testing.assert_allclose(
                on, blend.weights(blend.between(a, b, t + (1 - t) * rest)), atol=1e-12
            )


@pytest.mark.parametrize("blend", (EVEN, PACED))
def test_from_a_blend_of_three_a_way_leads_straight_to_its_end(blend):
    start = StopWeights((("RGB", 0.5), ("Thermal", 0.25), ("Opened", 0.25)))
    rows = np.array([blend.weights(blend.between(start, 0.9, t)) for t in np.linspace(0, 1, 11)])
    assert np.array_equal(rows[0], (0.5, 0.25, 0.25)) and np.array_equal(rows[-1], (0, 0, 1))
    assert (np.diff(rows[:, 2]) > 0).all()
    np.testing.assert_allclose(rows[:-1, 0], 2 * rows[:-1, 1], atol=1e-12)
    np.testing.assert_allclose(rows.sum(axis=1), 1, atol=1e-12)


@pytest.mark.parametrize("blend", (EVEN, PACED))
def test_a_way_with_a_part_for_each_anchor_is_each_alone(blend):
    parts = np.array([0, 0.3, 0.5, 1.0])
    three = StopWeights((("RGB", 0.5), ("Thermal", 0.25), ("Opened", 0.25)))
    rows = blend.weights(np.array([0.1, 0.2, 0.65, 1.0]))
    for start in (0.1, 0.25, three, rows):
        for end in (0.4, 0.9, three, 0.3):
            together = blend.weights(blend.between(start, end, parts))
            for i, part in enumerate(parts):
                first = start
                if isinstance(start, np.ndarray):
                    first = StopWeights(tuple(zip(blend.names, start[i].tolist(), strict=True)))
                alone = blend.weights(blend.between(first, end, part))
                np.testing.assert_allclose(together[i], alone, atol=1e-9)


@pytest.mark.parametrize("blend", (EVEN, PACED))
def test_where_a_part_is_0_or_1_both_ends_are_what_was_given_to_the_bit(blend):
    """Those of a section are, but for the splats at its edge."""
    part = np.array([0, 0.3, 1, 5e-324, 0, 1, np.nextafter(1, 0)])
    start, end = 0.23, StopWeights((("RGB", 0.3), ("Opened", 0.7)))
    each = np.linspace(0.1, 0.9, len(part))
    for given in (start, each):
        got = blend.between(given, end, part)
        starts = np.broadcast_to(blend.weights(given), got.shape)
        assert np.array_equal(got[part == 0], starts[part == 0])
        assert np.array_equal(got[part == 1], blend.weights(end)[None].repeat(2, 0))
        np.testing.assert_allclose(got[3], starts[3], atol=1e-12)
        np.testing.assert_allclose(got[6], blend.weights(end), atol=1e-12)
        alone = blend.between(float(each[1]) if given is each else start, end, 0.3)
        np.testing.assert_allclose(got[1], blend.weights(alone), atol=1e-12)


def test_the_ends_of_a_way_are_what_was_given():
    start, end = StopWeights((("RGB", 0.3), ("Opened", 0.7))), 0.4
    assert PACED.between(start, end, 0.0) is start and PACED.between(start, end, 1.0) is end


def test_where_x_is_direct_a_way_walks_through_x():
    assert StopBlend(STOPS, direct=True).between(0.1, 0.9, 0.25) == pytest.approx(0.3)
    assert StopBlend(STOPS[:1]).between(0.0, 1.0, 0.25) == 0.25


def test_stops_in_any_order_mean_the_same():
    turned = StopBlend(STOPS[::-1], PACE)
    for x in np.linspace(0, 1, 33):
        np.testing.assert_allclose(turned.weights(x)[::-1], PACED.weights(x), atol=1e-15)


@pytest.mark.parametrize("parts", (
    (), (("RGB", 0.5),), (("RGB", 0.5), ("RGB", 0.5)), (("RGB", 1.5), ("Opened", -0.5)),
    (("RGB", math.nan), ("Opened", 1.0)), (("RGB", 0.5), ("Opened", 0.50001)),
))  # fmt: skip
def test_what_is_no_blend_is_refused(parts):
    with pytest.raises(ValueError, match="no blend"):
        StopWeights(parts)


@pytest.mark.parametrize("blend", (
    (), (0,), (0, 0.5), (0.1, 1), (0, 0.5, 0.5, 1), (0, 0.7, 0.6, 1), (0, math.nan, 1), (0, 2),
))  # fmt: skip
def test_what_is_no_pace_is_refused(blend):
    with pytest.raises(ValueError, match="does not rise from 0 to 1"):
        Pace("A", "B", blend)


def test_a_stop_that_is_not_there_is_named():
    with pytest.raises(ValueError, match=r"no stop 'Bone'; there are RGB, Thermal, Opened\."):
        EVEN.weights(StopWeights((("Bone", 1.0),)))


@pytest.mark.parametrize("text, control", (
    ("0", 0.0), ("1", 1.0), ("1e-3", 0.001), ("Thermal", 0.4), (" thermal ", 0.4),
    ("RGB..Thermal:0.5", 0.25), ("rgb..opened:0", 0.1), ("RGB..Opened:1", 0.9),
    ("RGB..Opened:0.5", StopWeights((("RGB", 0.5), ("Opened", 0.5)))),
    ("Opened..RGB:0.25", StopWeights((("RGB", 0.25), ("Opened", 0.75)))),
    ("RGB:0.5,Opened:0.5", StopWeights((("RGB", 0.5), ("Opened", 0.5)))),
    ("rgb:1, opened:3", StopWeights((("RGB", 0.25), ("Opened", 0.75)))),
    ("RGB:0,Opened:0.2", StopWeights((("Opened", 1.0),))),
))  # fmt: skip
def test_texts_that_say_a_control(text, control):
    assert parse_control(text, STOPS) == control


@pytest.mark.parametrize("text", (
    "", " ", "nan", "inf", "-0.1", "1.0001", "Bone", "RGB..", "RGB..Opened", "RGB..Opened:1.1",
    "RGB..Opened:nan", "RGB..Bone:0.5", "RGB:0.5;Opened:0.5", "RGB:0,Opened:0", "RGB:-1,Opened:2",
    "RGB:1,RGB:1", "RGB:inf,Opened:1", "RGB:nan,Opened:1", "RGB:", "sweep:5", "0,5",
))  # fmt: skip
def test_texts_that_say_none_are_refused_in_one_sentence(text):
    with pytest.raises(ValueError) as caught:
        parse_control(text, STOPS)
    assert str(caught.value).count(".\n") == 0 and str(caught.value).endswith(".")


def test_names_with_signs_of_the_grammar_in_them_are_found():
    stops = (Stop("a:b", 0.0), Stop("a", 0.5), Stop("x..y, z", 1.0))
    assert parse_control("a:b..x..y, z:0.5", stops) == StopWeights((("a:b", 0.5), ("x..y, z", 0.5)))
    assert parse_control("x..y, z:1,a:b:1", stops) == StopWeights((("x..y, z", 0.5), ("a:b", 0.5)))
    assert parse_control("a..x..y, z:0.5", stops) == 0.75


def test_a_way_as_text_is_at_even_pace():
    row = PACED.weights(parse_control("Opened..RGB:0.5", STOPS, PACE))
    np.testing.assert_allclose(row, (0.7, 0, 0.3), atol=1e-12)


def test_what_is_told_is_read_back():
    for control in (0.25, 0.123457, StopWeights((("RGB", 0.25), ("Opened", 0.75)))):
        assert parse_control(control_text(control), STOPS) == control


@pytest.mark.parametrize("x", (-1e-9, 1 + 1e-9, math.nan, math.inf))
def test_numbers_outside_are_refused(x):
    with pytest.raises(ValueError, match=r"it has x = .*; from 0 to 1 is wanted"):
        check_control(x, "it")
    check_control(0.0, "it")
    check_control(1.0, "it")
