"""Style losses: their values by numpy in float64, their gradients by complex steps of that."""

import numpy as np
import pytest

from shapeshift.training.gradients.onnx_graph import OnnxGraph
from shapeshift.training.gradients.reverse_mode import GradientSession
from shapeshift.training.style_features import nnfm_pictures

RNG = np.random.default_rng
CHANNELS, PLACES = 5, 12


def units(rows):
    return rows / np.sqrt((rows**2).sum(axis=1, keepdims=True))


def nnfm(f, wanted):
    """Of (C, N) features and (M, C) unit rows; the nearest one by the real parts."""
    u = f / np.sqrt((f**2).sum(axis=0) + 1e-8)
    nearest = np.argmax(wanted[0] @ u.real, axis=0)
    return 1 - (wanted[0][nearest].T * u).sum(axis=0).mean()


def moments(f, wanted):
    means = f.mean(axis=1, keepdims=True)
    deviations = np.sqrt(((f - means) ** 2).mean(axis=1, keepdims=True) + 1e-8)
    error = ((means - wanted[0]) ** 2).sum() + ((deviations - wanted[1]) ** 2).sum()
    return error / ((wanted[0] ** 2).sum() + (wanted[1] ** 2).sum() + 1e-8)


def gram(f, wanted):
    return ((f @ f.T / PLACES - wanted[0]) ** 2).sum() / ((wanted[0] ** 2).sum() + 1e-8)


def content(f, wanted):
    return ((f - wanted[0]) ** 2).sum() / ((wanted[0] ** 2).sum() + 1e-8)


LOSSES = {  # how it is written in ONNX, by numpy, and what it compares with
    "nnfm": (nnfm_pictures.add_nnfm, nnfm, (units(RNG(1).normal(size=(7, CHANNELS))),)),
    "moments": (nnfm_pictures.add_moments, moments,
                (RNG(1).normal(size=(CHANNELS, 1)), RNG(2).random((CHANNELS, 1)))),
    "gram": (nnfm_pictures.add_gram, gram, (RNG(1).normal(size=(CHANNELS, CHANNELS)),)),
    "content": (nnfm_pictures.add_content, content, (RNG(1).normal(size=(CHANNELS, PLACES)),)),
}  # fmt: skip


def in_onnx(add, wanted, features):
    """The loss and its gradient by the features."""
    graph = OnnxGraph("made", 17, 8)
    graph.add_input("features", features.shape)
    names = [graph.add_input(f"wanted{i}", w.shape) for i, w in enumerate(wanted)]
    value = add(graph, "features", *names)
    session = GradientSession(graph, {"loss": (value, 1.0)}, "features", threads=1)
    given = {"features": features, **dict(zip(names, wanted, strict=True))}
    found, gradient = session({n: np.asarray(v, np.float32) for n, v in given.items()})
    return found["loss"], gradient


@pytest.mark.parametrize("name", LOSSES)
def test_losses_and_gradients_against_numpy(name):
    add, formula, wanted = LOSSES[name]
    features = np.abs(RNG(3).normal(size=(CHANNELS, PLACES)))
    loss, gradient = in_onnx(add, wanted, features)
    assert loss == pytest.approx(formula(features, wanted), rel=1e-5)
    exact = np.zeros(features.shape)
    for i in np.ndindex(features.shape):
        stepped = features.astype(complex)
        stepped[i] += 1e-30j
        exact[i] = formula(stepped, wanted).imag / 1e-30
    np.testing.assert_allclose(gradient, exact, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("name", LOSSES)
def test_losses_of_the_style_itself_are_nothing(name):
    features = np.abs(RNG(3).normal(size=(CHANNELS, PLACES))).astype(np.float32)
    wanted = {
        "nnfm": (nnfm_pictures.unit_rows(features),),
        "moments": nnfm_pictures.moments_of(features),
        "gram": (nnfm_pictures.gram_of(features),),
        "content": (features,),
    }[name]
    loss, gradient = in_onnx(LOSSES[name][0], wanted, features)
    assert loss == pytest.approx(0, abs=1e-6) and abs(gradient).max() < 1e-3


@pytest.mark.parametrize("name", LOSSES)
def test_features_that_are_all_zero_give_finite_gradients(name):
    """Behind ReLU whole places, or whole channels, are 0."""
    add, _, wanted = LOSSES[name]
    for other in (wanted, tuple(np.zeros_like(w) for w in wanted)):
        loss, gradient = in_onnx(add, other, np.zeros((CHANNELS, PLACES)))
        assert np.isfinite(loss) and np.isfinite(gradient).all()


@pytest.mark.parametrize("name", ["nnfm", "moments", "gram", "content"])
def test_losses_do_not_depend_on_how_large_features_are(name):
    add, _, wanted = LOSSES[name]
    features = np.abs(RNG(3).normal(size=(CHANNELS, PLACES)))
    power = {"nnfm": 0, "moments": 1, "gram": 2, "content": 1}[name]
    large = in_onnx(add, [w * 1000.0**power for w in wanted], 1000 * features)[0]
    assert large == pytest.approx(in_onnx(add, wanted, features)[0], rel=1e-4)
