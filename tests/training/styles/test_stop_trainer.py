"""What trains a new stop, against onnxruntime on the finished package, and finite differences."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.model import HEADS, BadFile
from shapeshift.runtime_models.stops.change_stops import insert_stop
from shapeshift.training.heads.gaussians import Gaussians
from shapeshift.training.styles.stop_trainer import StopSettings, StopTrainer
from tests.support.models import without_control, without_direction
from tests.support.new_stops import framed_model

EYE = np.array([0.3, -0.2, 2.0], np.float32)
FIELDS = ("means", "scales", "wxyz", "opacity", "color")
ALL = StopSettings(heads=HEADS, units=12, features=3)
MODELS = {
    "as trained": framed_model,
    "two hidden layers": lambda: framed_model(hidden=(7, 9)),
    "no hidden layer": lambda: framed_model(hidden=()),
    "shapes that see no x": lambda: without_control(framed_model(), "offset", "scale"),
    "colours alike from everywhere": lambda: without_direction(framed_model()),
    "one anchor": lambda: framed_model(1),
}


def begun(device, model, settings=ALL, inside=None) -> StopTrainer:
    return StopTrainer(device, insert_stop(model, "New", "RGB", "RGB"), "New", settings, inside)


def wild_weights(trainer: StopTrainer, seed: int = 3) -> None:
    """Random numbers wherever the trainer may learn something; features as halves hold them."""
    rng = np.random.default_rng(seed)
    state = trainer.adam.state()
    for name in ("weights", "features"):
        rates = trainer.device.download(trainer.adam.groups[name].rates).reshape(
            state[f"{name}.value"].shape
        )
        wild = rng.normal(0, 0.4, rates.shape).astype(np.float16)
        state[f"{name}.value"] = np.where(rates > 0, wild, state[f"{name}.value"])
    trainer.adam.load(state)


def decoded(trainer: StopTrainer, eye=EYE) -> dict[str, np.ndarray]:
    splats = trainer.step.decode(np.zeros(1), eye)
    return {n: trainer.device.download(getattr(splats, n)) for n in FIELDS}


@pytest.mark.parametrize("name", MODELS)
def test_what_trains_is_what_the_finished_package_shows(device, name):
    """The device's splats beside onnxruntime's on the networks that are written: two ways to sum
    the same products in float32.
    """
    trainer = begun(device, MODELS[name]())
    source = decoded(trainer)
    before = evaluate(trainer.source, 0.0, EYE)
    np.testing.assert_allclose(source["color"], before.color, atol=2e-5)  # it starts as its source
    wild_weights(trainer)
    found, made = decoded(trainer), trainer.finished()
    shown = evaluate(made, next(s.x for s in made.stops if s.name == "New"), EYE)
    length = np.linalg.norm(found["wxyz"], axis=1, keepdims=True)
    found["wxyz"] = found["wxyz"] / length
    for field in FIELDS:
        wanted = getattr(shown, field)
        atol = 1e-4 * max(1, np.abs(wanted).max())
        np.testing.assert_allclose(found[field], wanted, atol=atol, err_msg=field)
    assert np.abs(found["color"] - source["color"]).mean() > 0.05


def test_heads_that_are_not_asked_for_stay(device):
    trainer = begun(device, framed_model(), StopSettings(("color",), 12, 3))
    source = decoded(trainer)
    wild_weights(trainer)
    found = decoded(trainer)
    for field in FIELDS[:4]:
        np.testing.assert_array_equal(found[field], source[field])
    made = trainer.finished()
    for head in HEADS[:4]:
        assert len(made.networks[head].biases[0]) == len(trainer.source.networks[head].biases[0])


@pytest.mark.parametrize("name", ["as trained", "colours alike from everywhere"])
def test_gradients_of_all_that_learns(device, name):
    """Along a random direction, of a loss with known weights on every number of every splat.

    Central differences of float32 sums of some thousand numbers: within a hundredth.
    """
    inside = np.arange(120) % 4 > 0
    trainer, rng = begun(device, MODELS[name](), inside=inside), np.random.default_rng(1)
    wild_weights(trainer)
    weights = {n: rng.normal(size=a.shape).astype(np.float32) for n, a in decoded(trainer).items()}
    grads = trainer.step.backward(Gaussians(*map(device.upload, weights.values())))
    state = trainer.adam.state()
    for group in ("weights", "features"):
        rates = device.download(trainer.adam.groups[group].rates)
        value = state[f"{group}.value"]
        way = rng.normal(size=value.shape) * (rates.reshape(value.shape) > 0)
        if group == "features":
            assert (device.download(grads[group])[~inside] == 0).all()
        analytic = float((device.download(grads[group]) * way).sum())
        step, losses = 2e-3, []
        for sign in (1, -1):
            moved = value + sign * step * way / np.linalg.norm(way)
            trainer.adam.load(state | {f"{group}.value": moved.astype(np.float32)})
            splats = decoded(trainer)
            losses.append(
                sum(float((weights[n] * a).sum(dtype=np.float64)) for n, a in splats.items())
            )
        numeric = (losses[0] - losses[1]) / (2 * step) * np.linalg.norm(way)
        assert numeric == pytest.approx(analytic, rel=1e-2), group
        trainer.adam.load(state)


def test_networks_of_other_ends_are_refused(device):
    model = framed_model(3)
    other = replace(model.networks["color"], head="none")
    with pytest.raises(BadFile, match="the color network of this scene ends in none"):
        begun(device, replace(model, networks=model.networks | {"color": other}))
    with pytest.raises(BadFile, match="the scale network of this scene ends in exp"):
        wide = replace(model.networks["scale"], clip=(-9.0, 3.0))
        begun(device, replace(model, networks=model.networks | {"scale": wide}))


def test_numbers_that_are_none_are_not_written(device):
    trainer = begun(device, framed_model(3))
    state = trainer.adam.state()
    trainer.adam.load(state | {"weights.value": np.full_like(state["weights.value"], np.nan)})
    with pytest.raises(BadFile, match="was lost while it learned"):
        trainer.finished()


@pytest.mark.parametrize(("name", "value"), [("units", 0), ("features", -1), ("seed", -1)])
def test_settings_out_of_range_are_refused(name, value):
    with pytest.raises(ValueError, match=name):
        StopSettings(**{name: value})
