"""The pace between two stops: equal ways of the slider are equal changes of the picture."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app import cli
from shapeshift.renderer.pace import (
    EVEN_ENOUGH,
    MOST,
    STEPS,
    changes,
    even_curve,
    largest_step,
    measure_pace,
    views_of,
)
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.stop_weights import Pace
from tests.support.models import make_random_model
from tests.support.splat_scenes import random_layers

STOPS = (Stop("A", 0.0), Stop("B", 0.5, "thermal", "ironbow"), Stop("C", 1.0))


@pytest.fixture(scope="module")
def model():
    """Of three stops, between which random networks move as they like."""
    return replace(make_random_model(300, k=3, seed=4), stops=STOPS)


@pytest.fixture(scope="module")
def switch(model):
    """Nothing happens before two thirds of the way: units that open late, times large weights."""
    networks = dict(model.networks)
    psi = [model.encoding.encode(stop.x).astype(np.float64) for stop in STOPS]
    step = np.linalg.lstsq(np.stack(psi), [-8.0, 4.0, -8.0], rcond=None)[0]  # 4 at B, -8 elsewhere
    for name in ("color", "opacity"):
        mlp = networks[name]
        first, last = mlp.weights[0].copy(), mlp.weights[1].copy()
        first[:8] = 0
        first[:8, -model.encoding.d :] = step
        last[:, :8] = np.random.default_rng(0).choice([-0.6, 0.6], last[:, :8].shape)
        networks[name] = replace(mlp, weights=(first, last))
    return replace(model, networks=networks)


def test_a_curve_undoes_what_was_measured():
    shares = np.linspace(0, 1, MOST)
    steps = np.exp(-((shares[:-1] - 0.7) ** 2) / 0.01)  # all at once
    curve = even_curve(shares, steps)
    assert curve[0] == 0 and curve[-1] == 1 and (np.diff(curve) > 0).all()
    way = np.concatenate([[0], np.cumsum(steps)]) / steps.sum()
    moved = np.diff(np.interp(curve, shares, way))
    assert moved.max() < 1.3 / STEPS and moved[1:-1].min() > 0.4 / STEPS
    even = even_curve(shares, np.ones(MOST - 1))
    np.testing.assert_allclose(even, np.linspace(0, 1, STEPS + 1), atol=1e-4)


def test_a_switch_becomes_a_shift(switch):
    """Measured in other steps than the pace was made of."""
    plain = largest_step(switch)
    paced = largest_step(replace(switch, pace=measure_pace(switch)))
    assert plain > EVEN_ENOUGH > 1.8 > paced  # 4.9 and 1.6


def test_every_pair_has_a_pace_and_each_is_its_own(model):
    pace = measure_pace(model)
    assert [(p.start, p.end) for p in pace] == [("A", "B"), ("A", "C"), ("B", "C")]
    for one in pace:
        assert len(one.blend) == STEPS + 1
    assert measure_pace(replace(model, pace=pace)) == pace  # what there was does not count


def test_the_direct_way_between_two_that_are_no_neighbours_is_even_too(model):
    paced = replace(model, pace=measure_pace(model))
    with Renderer(None) as renderer:
        views = views_of(model)
        for made in (paced,):
            ways = [made.blend.between(0.0, 1.0, t) for t in np.linspace(0, 1, 11)]
            steps = changes(renderer, made, ways, views)
            assert steps.max() < 1.35 * steps.mean()


def test_where_there_is_no_way_there_is_no_pace(model):
    assert measure_pace(replace(model, stops=STOPS[:1])) == ()
    assert measure_pace(random_layers(20)) == ()
    assert measure_pace(replace(model, between_stops="encoding")) == ()
    plain = tuple(replace(stop, kind="rgb", palette="") for stop in STOPS)
    alike = replace(model, encoding=replace(model.encoding, sigma=1e4), stops=plain)
    assert measure_pace(alike) == () and largest_step(alike) == 0.0
    assert largest_step(replace(model, stops=STOPS[:1])) == 0.0


def test_of_many_stops_neighbours_have_a_pace():
    stops = tuple(Stop(str(i), i / 7) for i in range(8))
    pace = measure_pace(replace(make_random_model(300, k=3), stops=stops))
    assert [(int(p.start), int(p.end)) for p in pace] == [(i, i + 1) for i in range(7)]


def test_export_measures_a_pace_and_lint_finds_where_one_lacks(switch, tmp_path, capsys):
    write_package(switch, tmp_path / "a.shift")
    assert cli.main(["lint", str(tmp_path / "a.shift")]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "times as much as an" in told.replace("│", "").replace("  ", " ") or "0.01" in told
    out = tmp_path / "b.shift"
    assert cli.main(["export", str(tmp_path / "a.shift"), "--out", str(out)]) == 0
    assert len(read_package(out).pace) == 3
    capsys.readouterr()
    assert cli.main(["lint", "--json", str(out)]) == 0
    assert "0.01" not in capsys.readouterr().out
    plain = tmp_path / "c.shift"
    export = ["export", str(tmp_path / "a.shift"), "--out", str(plain), "--no-pace"]
    assert cli.main(export) == 0 and read_package(plain).pace == ()
    assert Path(plain).read_bytes() == Path(tmp_path / "a.shift").read_bytes()


def test_a_way_that_jumps_has_a_pace_too():
    """Nearly all of the change within a hundred-thousandth of the way, as between two palettes."""
    for shares in ([0, 1 - 1e-5, 1], [0, 1e-5, 1], [0, 0.5, 0.50001, 1]):
        steps = np.zeros(len(shares) - 1)
        steps[int(np.argmin(np.diff(shares)))] = 1.0
        curve = even_curve(np.array(shares), steps)
        assert Pace("a", "b", tuple(curve.tolist())).blend[1] > 0  # it rises: nothing is raised
