"""What colours of a model can be: no colour is ever outside, and the bound is no wild guess."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.colors.color_bounds import color_range, output_range
from shapeshift.runtime_models.evaluate import Evaluator, evaluate
from shapeshift.runtime_models.model import Mlp
from tests.support.splat_scenes import one_splat, random_layers, random_model

HEADS = ("none", "tanh", "sigmoid", "softplus", "exp")


def directions(count: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    out = rng.normal(size=(count, 3))
    return (out / np.linalg.norm(out, axis=1, keepdims=True)).astype(np.float32)


@pytest.mark.parametrize("coefficients", [1, 4, 9, 16])
def test_harmonics_are_never_brighter(coefficients):
    layers = random_layers(300, seed=coefficients, coefficients=coefficients)
    least, most = color_range(layers)
    evaluator, found = Evaluator(layers), 0.0
    for seed in range(40):
        colors = evaluator.color_along(0.0, directions(300, seed))
        assert colors.min() >= least and colors.max() <= most * (1 + 1e-6)
        found = max(found, float(colors.max()))
    assert most < 2 * found, "of 300 splats one is seen from near its brightest side"


def test_one_band_alone_reaches_its_bound():
    """l = 1 along its own axis: 0.5 + C0 c + C1 |c1|, the bound to the last digit."""
    sh = np.zeros((1, 4, 3), np.float32)
    sh[0, 0], sh[0, 1:, 0] = 0.2, (0.3, -0.5, 0.7)
    layers = one_splat(sh=sh)
    axis = np.array([[-0.7, -0.3, -0.5]]) / math.sqrt(0.83)  # -C1 y, C1 z, -C1 x
    brightest = Evaluator(layers).color_along(0.0, axis.astype(np.float32))[0, 0]
    assert color_range(layers) == (0.0, pytest.approx(float(brightest), rel=1e-6))


def test_what_is_no_number_is_not_drawn_and_does_not_count():
    layers = random_layers(50, coefficients=4)
    spoilt = replace(layers, sh=layers.sh.copy())
    most = color_range(layers)[1]
    spoilt.sh[3, 1, 0], spoilt.sh[7, 0, 2], spoilt.sh[9, 2, 1] = np.nan, np.inf, -np.inf
    assert 0 < color_range(spoilt)[1] <= most
    assert color_range(random_layers(0)) == (0.0, 0.0)
    assert color_range(one_splat(sh=np.full((1, 1, 3), -9))) == (0.0, 0.0)


@pytest.mark.parametrize("gain", [1.0, 2.5, -1.0])
@pytest.mark.parametrize("clip", [None, (-2.0, 3.0), (-900.0, 900.0), (0.5, 0.5)])
@pytest.mark.parametrize("head", HEADS)
def test_heads(head, clip, gain):
    mlp = Mlp((np.zeros((1, 1), np.float32),), (np.zeros(1, np.float32),), head, (), clip, gain)
    least, most = output_range(mlp)
    z = np.linspace(*(clip or (-50, 50)), 101)
    with np.errstate(over="ignore"):
        y = gain * {
            "none": lambda z: z, "tanh": np.tanh, "sigmoid": lambda z: 1 / (1 + np.exp(-z)),
            "softplus": lambda z: np.logaddexp(0, z), "exp": np.exp,
        }[head](z)  # fmt: skip
    assert least <= y.min() + 1e-12 and y.max() <= most + 1e-12 * abs(most)
    if clip and np.isfinite(y).all():  # monotone: the ends are reached
        assert (least, most) == pytest.approx((y.min(), y.max()), rel=1e-9, abs=1e-300)
    if clip is None:
        assert math.isinf(most - least) == (head not in ("tanh", "sigmoid"))


def test_networks():
    model = random_model(40)
    assert color_range(model) == (0.0, 1.0)
    colors = evaluate(model, 0.4, np.ones(3)).color
    assert 0 <= colors.min() and colors.max() <= 1
    mlp = replace(model.networks["color"], head="tanh", gain=2.0)
    other = replace(model, networks=model.networks | {"color": mlp})
    assert color_range(other) == (-2.0, 2.0)
