"""Formulas of stops: Python's own arithmetic as the judge, and everything that is no formula."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.stops.stop_formula import (
    DEEPEST,
    LARGEST_NUMBER,
    LONGEST_FORMULA,
    check_formulas,
    read_formula,
    sources_of,
)

KNOWN = {"a": 0.25, "b": -3.0, "c": 0.0, "d": math.nan}
NUMBERS = st.sampled_from(["0", "1", "2.5", ".5", "3.", "1e3", "7E-2", "a", "b", "c", "d"])
TEXTS = st.recursive(
    NUMBERS,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from("+-*/"), inner).map(" ".join),
        inner.map("({})".format), inner.map("- {}".format), inner.map("+{}".format),
    ),
    max_leaves=12,
)  # fmt: skip


def judged(text: str) -> float:
    """By Python itself: NaN where a step divides by zero or leaves the numbers."""
    try:
        found = eval(text, {"__builtins__": {}}, KNOWN)  # of texts made above
    except (ZeroDivisionError, OverflowError):
        return math.nan
    return found if math.isfinite(found) else math.nan


@settings(max_examples=300, deadline=None)
@given(TEXTS.filter(lambda text: any(name in text for name in "abcd")))
def test_it_is_what_python_makes_of_it(text):
    if len(text) > LONGEST_FORMULA:
        return
    values = {name: np.full(3, value) for name, value in KNOWN.items()}
    found = read_formula(text).value(values)
    np.testing.assert_allclose(found, np.full(3, judged(text)), rtol=1e-12)


def test_an_index_of_arrays():
    nir, red = np.array([0.6, 0.0, np.nan, 0.2, 1e300]), np.array([0.2, 0.0, 0.1, -0.2, 1e300])
    found = read_formula("(nir - red) / (nir + red)").value({"nir": nir, "red": red})
    np.testing.assert_allclose(found, [0.5, np.nan, np.nan, np.nan, 0.0])
    inner = read_formula("1 / (1 / red)").value({"red": red})  # IEEE alone would say 0
    assert np.isnan(inner[1]) and inner[0] == pytest.approx(0.2)
    assert np.isnan(read_formula("nir * nir - nir").value({"nir": nir})[4])


def test_names():
    said = "'Near-IR' + \"it's\" * b_2 + Ωmega"
    assert read_formula(said).names == ("Near-IR", "it's", "b_2", "Ωmega")
    stops = [Stop(n, i / 9, "values", "", (0, 1)) for i, n in enumerate(("Near-IR", "B", "b"))]
    found = sources_of(read_formula("'near-ir' + b + B"), stops)
    assert [stop.name for stop in found.values()] == ["Near-IR", "b", "B"]


@pytest.mark.parametrize(
    ("text", "words"),
    [("", "0 letters"), (" ", "at its end"), ("1 + 2", "names no stop"), ("a +", "at its end"),
     ("a b", "before 'b'"), ("a ** b", "instead of '*'"), ("(a", r"a \) is missing"),
     ("a)", r"before '\)'"), ("a ^ 2", r"'\^ 2' is none"), ("abs(a)", r"before '\('"),
     ("a.b", r"'\.b' is none"), ("__import__('os')", r"before '\('"), ("a[0]", "is none of its"),
     ("a if b else c", "before 'if'"), ("lambda: a", "is none"), ("a; b", "is none"),
     ("'a", "''a' is none"), ("''", "instead of ''"), ("1e999 * a", "too large"),
     (f"{LARGEST_NUMBER * 10:.0f} * a", "too large"), ("0x10 * a", "'0x10"), ("1_0 * a", "'1_0"),
     ("(" * (DEEPEST + 1) + "a" + ")" * (DEEPEST + 1), f"more than {DEEPEST}"),
     ("a" + " + a" * LONGEST_FORMULA, "letters"), ("a\x00b", "is none")],
)  # fmt: skip
def test_what_is_no_formula(text, words):
    with pytest.raises(ValueError, match=words) as error:
        read_formula(text)
    assert "\n" not in str(error.value).replace("\x00", "")


def test_its_bounds_are_reached():
    deep = "(" * DEEPEST + "a" + ")" * DEEPEST
    assert read_formula(deep).value({"a": np.float64(2)}) == 2
    long = "a" + "+a" * ((LONGEST_FORMULA - 1) // 2)
    assert read_formula(long).value({"a": np.float64(1)}) == (LONGEST_FORMULA + 1) // 2
    signs = "-" * (LONGEST_FORMULA - 1) + "a"  # no recursion for signs
    assert read_formula(signs).value({"a": np.float64(1)}) == -1
    assert read_formula(f"a * {LARGEST_NUMBER:g}").steps[1] == LARGEST_NUMBER


@pytest.mark.parametrize(
    ("formula", "words"),
    [("x", "no stop 'x'; of values there are NIR, Heat"), ("rgb", "shows no values in a range"),
     ("bare", "shows no values in a range"), ("other", "is by formula itself"),
     ("index", "no stop 'index'")],
)  # fmt: skip
def test_stops_that_it_cannot_be_of(formula, words):
    stops = (
        Stop("RGB", 0.0), Stop("NIR", 0.2, "values", "", (0, 1)),
        Stop("Heat", 0.4, "thermal", "", (0, 90)), Stop("Bare", 0.6, "thermal"),
        Stop("Other", 0.8, "values", "", (0, 1), formula="nir"),
        Stop("Index", 1.0, "values", "", (0, 1), formula=formula),
    )  # fmt: skip
    with pytest.raises(ValueError, match=words):
        check_formulas(stops)
    check_formulas((*stops[:5], Stop("I", 1.0, "values", "", (0, 1), formula="NIR / heat")))


def test_a_formula_is_of_a_stop_of_values():
    with pytest.raises(ValueError, match="'values' is wanted"):
        Stop("A", 0.0, "rgb", formula="b")
