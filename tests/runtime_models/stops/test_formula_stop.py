"""A stop by formula in a model: its splats' values, all other stops, the package, its removal."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import AnchorModel, BadFile, Stop
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.stops.change_stops import remove_stop
from shapeshift.runtime_models.stops.formula_stop import (
    LUMINANCE,
    with_formula_stop,
    with_placed_formulas,
)
from tests.support.band_model import EYES, band_model

EYE = np.array([3.0, 1.0, 2.0])
NDVI = Stop("NDVI", 0.0, "values", "turbo", (-1.0, 1.0), "", "", "(nir - red) / (NIR + red)")


def x_of(model: AnchorModel, name: str) -> float:
    return next(stop.x for stop in model.stops if stop.name == name)


def index_of(model: AnchorModel) -> np.ndarray:
    """(N,) of each splat, by numpy alone: means of two eyes, NaN where one is absent."""
    found = {}
    for name, (low, high) in (("Red", (0, 1)), ("NIR", (0.1, 2.1))):
        run, x = Evaluator(model), x_of(model, name)
        grey = np.mean([np.clip(run.color(x, np.array(e)) @ LUMINANCE, 0, 1) for e in EYES], axis=0)
        there = run.geometry(x)[3] > 0
        found[name] = np.where(there, low + (high - low) * grey, np.nan)
    return (found["NIR"] - found["Red"]) / (found["NIR"] + found["Red"])


@pytest.mark.parametrize("framed", [False, True])
@pytest.mark.parametrize(("kind", "bound"), [("float32", 2e-5), ("float16", 4e-4), ("uint8", 4e-5)])
def test_splats_have_the_index_and_other_stops_what_they_had(tmp_path, kind, bound, framed):
    """A half has 11 bits: 2.4e-4 of a share below 1, less behind a sigmoid; two bytes have 16."""
    model, path = band_model(kind, framed), tmp_path / "a.shift"
    write_package(with_formula_stop(model, NDVI, "Red"), path, "exact")
    made, wanted = read_package(path), index_of(model)
    assert [stop.name for stop in made.stops] == ["Red", "NDVI", "NIR", "RGB"]
    stop = made.stops[1]
    assert stop == replace(NDVI, x=stop.x)
    run, known = Evaluator(made), np.isfinite(wanted)
    for eye in (EYE, -EYE):  # from every side the same
        shown = run.color(stop.x, eye)
        share = np.clip((wanted + 1) / 2, 0, 1)
        assert np.abs(shown[known] - share[known, None]).max() < bound + 1e-4  # NEAR_END
    opacity = run.geometry(stop.x)[3]
    assert (opacity[~known] <= 0).all()  # what is unknown is absent
    assert known.any() and not known.all()
    before = Evaluator(model)
    shape = before.geometry(x_of(model, "NIR"))
    for one, other in zip(shape[:3], run.geometry(stop.x)[:3], strict=True):
        np.testing.assert_allclose(other, one, atol=2e-5)  # the first in the formula: NIR
    np.testing.assert_allclose(opacity[known], shape[3][known], atol=2e-5)
    for old in model.stops:
        at = x_of(made, old.name)
        np.testing.assert_allclose(run.color(at, EYE), before.color(old.x, EYE), atol=2e-5)
        for one, other in zip(before.geometry(old.x), run.geometry(at), strict=True):
            np.testing.assert_allclose(other, one, atol=2e-5)


def test_the_usual_range_holds_nearly_all_values_in_round_numbers():
    model = band_model()
    made = with_formula_stop(model, replace(NDVI, value_range=None, palette=""))
    low, high = made.stops[-1].value_range
    wanted = index_of(model)
    wanted = wanted[np.isfinite(wanted)]
    assert low < np.percentile(wanted, 1) and high > np.percentile(wanted, 99)
    assert round(low, 3) == low and round(high, 3) == high
    assert made.stops[-1].palette == "viridis"


def test_stops_by_formula_stand_where_a_capture_says():
    model = band_model()
    half = Stop("Half", 0.25, "values", "gray", (0.0, 1.0), "", "", "nir / 2")
    made = with_placed_formulas(model, (half, replace(NDVI, x=0.9)))
    places = [(stop.name, stop.x) for stop in made.stops]
    assert places == [("Red", 0.0), ("Half", 0.25), ("NIR", 0.5), ("NDVI", 0.9), ("RGB", 1.0)]
    run, before = Evaluator(made), Evaluator(model)
    for old in model.stops:
        np.testing.assert_allclose(run.color(old.x, EYE), before.color(old.x, EYE), atol=5e-5)
    with pytest.raises(BadFile, match="where another one is"):
        with_placed_formulas(model, (replace(half, x=0.5),))


def test_it_goes_out_again_and_keeps_its_stops():
    model = band_model()
    made = with_formula_stop(model, NDVI)
    with pytest.raises(BadFile, match="'NDVI' is by formula of 'NIR'"):
        remove_stop(made, "NIR")
    left = remove_stop(made, "NDVI")
    assert left.features.shape == model.features.shape
    run, before = Evaluator(left), Evaluator(model)
    for stop in model.stops:
        np.testing.assert_allclose(run.color(stop.x, EYE), before.color(stop.x, EYE), atol=2e-5)
    assert remove_stop(made, "RGB").stops[-1].name == "NDVI"


def test_what_cannot_be_a_formula_stop():
    model = band_model()
    for stop, words in (
        (replace(NDVI, formula="x / red"), "no stop 'x'"),
        (replace(NDVI, formula="rgb"), "no values in a range"),
        (replace(NDVI, formula="red / 0"), "no value anywhere"),
        (replace(NDVI, name="nir"), "has a stop 'nir'"),
    ):
        with pytest.raises(BadFile, match=words):
            with_formula_stop(model, stop)
