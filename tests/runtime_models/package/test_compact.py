"""What is taken out of a model changes nothing that its stops show."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.model import HEADS
from shapeshift.runtime_models.package.drop_unused import LEAST_ALPHA, drop_unused, visible_slots
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import write_package
from tests.support.models import make_random_model, without_control

EYE = np.array([0.4, 0.2, 2.0])


def faint(model, slots=(), everywhere=0.0):
    """The model with some slots absent in every anchor, and less opacity in all others."""
    mlp = model.networks["opacity"]
    bias = mlp.biases[-1] - np.float32(everywhere)
    bias[list(slots)] = -50
    networks = model.networks | {"opacity": replace(mlp, biases=(*mlp.biases[:-1], bias))}
    return replace(model, networks=networks)


def drawn(model, x, eye=EYE):
    """Rows of numbers of the splats that are there, in order."""
    splats = evaluate(model, x, eye)
    there = splats.opacity >= LEAST_ALPHA
    fields = (splats.means, splats.scales, splats.wxyz, splats.opacity[:, None], splats.color)
    return np.concatenate(fields, axis=1)[there]


@pytest.mark.parametrize("hidden", [(), (32,), (7, 64, 9)])
@pytest.mark.parametrize("everywhere", [0.0, 0.8, 3.0])
def test_every_stop_shows_what_it_showed(hidden, everywhere):
    model = faint(make_random_model(200, k=4, hidden=hidden), (1, 3), everywhere)
    smaller, removed = drop_unused(model)
    living = visible_slots(model)
    assert removed.slots == 4 - living.any(axis=0).sum() >= 2
    assert removed.anchors == 200 - living.any(axis=1).sum()
    assert smaller.splats_per_anchor == 4 - removed.slots
    assert removed.splats == model.splat_count - smaller.splat_count
    assert removed.anchors or not everywhere
    for stop in model.stops:
        before = drawn(model, stop.x)
        assert len(before)
        np.testing.assert_allclose(drawn(smaller, stop.x), before, atol=2e-6)
    assert drop_unused(smaller)[1].splats == 0


def test_shown_is_what_some_stop_draws():
    model = faint(make_random_model(50, k=3), everywhere=0.5)
    by_hand = np.zeros((50, 3), bool)
    for stop in model.stops:
        by_hand |= evaluate(model, stop.x, EYE).opacity.reshape(50, 3) >= 1 / 255
    np.testing.assert_array_equal(visible_slots(model), by_hand)
    assert (
        visible_slots(model, [0.0]).sum()
        < visible_slots(model).sum()
        <= visible_slots(model, [0, 0.5, 1]).sum()
    )


@pytest.mark.parametrize("names", [(), ("color",), HEADS])
def test_silent_units_go_and_no_number_changes_anywhere(names):
    model = without_control(make_random_model(100, k=2, hidden=(24, 8)), *names)
    networks = {}
    for name, mlp in model.networks.items():
        bias = mlp.biases[0].copy()
        bias[:5] = -40  # asleep whatever comes
        bias[5] = -1e-3  # awake for some
        networks[name] = replace(mlp, biases=(bias, *mlp.biases[1:]))
    model = replace(model, networks=networks)
    smaller, removed = drop_unused(model, np.ones((100, 2), bool))
    assert (removed.anchors, removed.slots, removed.splats) == (0, 0, 0)
    assert removed.units == 25
    rng = np.random.default_rng(1)
    for x in (0.0, 0.03, 0.51, 1.0):
        eye = rng.normal(size=3)
        ours, whole = evaluate(smaller, x, eye), evaluate(model, x, eye)
        for name in ("means", "scales", "wxyz", "opacity", "color"):
            np.testing.assert_allclose(getattr(ours, name), getattr(whole, name), atol=2e-6)


def test_a_model_that_shows_nothing_keeps_a_splat(tmp_path):
    model = faint(make_random_model(20, k=3), range(3))
    smaller, removed = drop_unused(model)
    assert smaller.splat_count == 1 and removed.splats == 59
    write_package(smaller, tmp_path / "nothing.shift")
    assert read_package(tmp_path / "nothing.shift").splat_count == 1


def test_networks_whose_units_all_sleep_keep_one():
    model = make_random_model(10, k=1, hidden=(6,))
    networks = {
        n: replace(m, biases=(m.biases[0] - 100, m.biases[1])) for n, m in model.networks.items()
    }
    smaller, removed = drop_unused(replace(model, networks=networks), np.ones((10, 1), bool))
    assert removed.units == 25 and all(len(m.biases[0]) == 1 for m in smaller.networks.values())
