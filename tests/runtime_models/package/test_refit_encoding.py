"""A package's encoding written anew: nothing moves at the stops, and no jump is left between."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from shapeshift.app import cli
from shapeshift.renderer.pace import largest_step
from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.model import BadFile, ControlEncoding, Stop
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.refit_encoding import (
    encoding_findings,
    encoding_for,
    refit_encoding,
    untaught_units,
)
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.read_scene import read_model
from tests.support.models import make_random_model, without_control

EYE = np.array([0.3, -0.2, 2.0])
FIELDS = ("means", "scales", "wxyz", "opacity", "color")
PLACES = {
    "even": (0.0, 0.5, 1.0), "two": (0.0, 1.0), "one": (0.4,), "uneven": (0.0, 0.1, 0.45, 1.0),
    "inside": (0.2, 0.3, 0.9), "near": (0.0, 1 / 63, 1.0), "many": tuple(np.linspace(0, 1, 16)),
}  # fmt: skip


def model_of(places: tuple, **changes):
    stops = tuple(Stop(str(i), float(x)) for i, x in enumerate(places))
    return replace(make_random_model(80, k=3, **changes), stops=stops)


@pytest.mark.parametrize("hidden", [(), (32,), (7, 9)])
@pytest.mark.parametrize("name", PLACES)
def test_every_stop_is_what_it_was(name, hidden):
    """Float32 rounding of sums of a few dozen products of up to about 3: some 1e-6 of each."""
    model = model_of(PLACES[name], hidden=hidden)
    fitted = refit_encoding(model)
    for stop in model.stops:
        before, after = (evaluate(m, stop.x, EYE) for m in (model, fitted))
        for field in FIELDS:
            a, b = getattr(before, field), getattr(after, field)
            np.testing.assert_allclose(b, a, atol=2e-5 * max(1, np.abs(a).max()), err_msg=field)


@pytest.mark.parametrize("name", ["even", "two", "uneven", "inside"])
def test_what_is_shown_between_stays_and_who_knows_no_blends_comes_near_it(name):
    """The blend is of what stands at the stops; with x itself encoded it is met within a fifth of
    the way that there is between two stops (before: one and a half times that way off).
    """
    model = model_of(PLACES[name], hidden=(32,))
    fitted = refit_encoding(model)
    direct = [replace(m, between_stops="encoding") for m in (model, fitted)]
    xs = [stop.x for stop in model.stops]
    off = {0: 0.0, 1: 0.0}
    for low, high in pairwise(xs):
        ends = [evaluate(model, x, EYE).color for x in (low, high)]
        apart = np.abs(ends[0] - ends[1]).mean()
        for x in np.linspace(low, high, 9)[1:-1]:
            shown = evaluate(model, x, EYE).color
            np.testing.assert_allclose(evaluate(fitted, x, EYE).color, shown, atol=2e-5)
            for i, one in enumerate(direct):
                away = np.abs(evaluate(one, x, EYE).color - shown).mean() / apart
                off[i] = max(off[i], away)
    assert off[1] < 0.2 and off[1] < 0.5 * off[0], off


def test_a_jump_is_gone_for_who_encodes_x_itself():
    """As training leaves it that never saw the units between: they do nothing."""
    model = model_of((0.0, 0.5, 1.0), hidden=(32,), seed=2)
    networks = {}
    for name, mlp in model.networks.items():
        first = mlp.weights[0].copy()
        units = np.arange(16) / 15
        away = np.abs(units[:, None] - [0, 0.5, 1]).min(axis=1) > 0.08
        first[:, -16:][:, away] = 0
        networks[name] = replace(mlp, weights=(first, *mlp.weights[1:]))
    model = replace(model, networks=networks)
    before, after = (
        largest_step(replace(m, between_stops="encoding")) for m in (model, refit_encoding(model))
    )
    assert before > 2.5 > after


def test_a_head_that_sees_no_control_stays_as_it_is():
    model = without_control(model_of((0.0, 0.5, 1.0)), "offset", "scale")
    fitted = refit_encoding(model)
    for name in ("offset", "scale"):
        assert fitted.networks[name] is model.networks[name]


@pytest.mark.parametrize(("places", "units", "sigma"), [
    ((0.0, 1.0), 2, 0.5), ((0, 0.5, 1), 3, 0.25), ((0.2, 0.3), 11, 0.05), ((0.4,), 2, 0.5),
    ((0, 0.001, 1), 64, 0.5 / 63),
])  # fmt: skip
def test_an_encoding_has_a_unit_for_each_stop(places, units, sigma):
    encoding = encoding_for(list(places))
    assert (encoding.d, encoding.sigma) == (units, pytest.approx(sigma))
    assert encoding.spacing == pytest.approx(1 / (units - 1))


def test_stops_too_near_to_be_told_apart_are_refused():
    with pytest.raises(BadFile, match="so near each other that no encoding tells them apart"):
        refit_encoding(model_of((0.0, 1e-7, 1.0)))
    known = replace(model_of((0.0, 1.0)), between_stops="encoding")
    with pytest.raises(BadFile, match="know what lies between"):
        refit_encoding(known)


@pytest.mark.parametrize(("encoding", "places", "units"), [
    (ControlEncoding(), (0, 0.5, 1), 10),  # 2 sigmas either way of a stop are taught: 6 of 16
    (ControlEncoding(), (0.0, 1.0), 12), (ControlEncoding(), (0.4,), 0),
    (ControlEncoding(3, 0.5, 0.25), (0, 0.5, 1), 0), (ControlEncoding(8, 0.5, 0.1), (0, 1), 1),
])  # fmt: skip
def test_units_that_stand_at_no_stop_are_counted(encoding, places, units):
    model = model_of(places, encoding=encoding)
    assert untaught_units(model) == units
    assert len(encoding_findings(model, "a.shift")) == (units > 0)
    assert untaught_units(refit_encoding(model)) == 0
    assert untaught_units(replace(model, between_stops="encoding")) == 0


def test_it_is_offered_where_a_package_is_opened_and_done_by_export(tmp_path, capsys):
    old, new = tmp_path / "old.shift", tmp_path / "new.shift"
    write_package(model_of((0.0, 0.5, 1.0)), old)
    (finding,) = read_model(old).findings
    assert "10 of the 16 units" in finding.what and not finding.repaired
    assert "launch.py export old.shift --encoding stops" in finding.done
    assert cli.main(["info", "--json", str(old)]) == 0
    told = capsys.readouterr()
    assert "10 of the 16 units" in told.out and told.err.count("10 of the 16 units") == 1
    assert cli.main(["export", str(old), "--out", str(new), "--encoding", "stops"]) == 0
    fitted = read_package(new)
    assert fitted.encoding.d == 3 and not read_model(new).findings
    before, after = (evaluate(m, 0.5, EYE) for m in (read_package(old), fitted))
    np.testing.assert_allclose(after.color, before.color, atol=5e-6)
    assert new.stat().st_size < old.stat().st_size + 2000  # fewer columns, and three paces


def test_plain_splats_have_no_encoding(tmp_path, capsys):
    old = tmp_path / "old.shift"
    write_package(model_of((0.0, 1.0)), old)
    out = ["--out", str(tmp_path / "a.ply"), "--encoding", "stops"]
    assert cli.main(["export", str(old), *out]) == 2
    assert "--encoding is of packages" in capsys.readouterr().err
    assert not (tmp_path / "a.ply").exists()
