"""Evaluation by onnxruntime against a float64 twin, and the properties of the control encoding."""

from dataclasses import replace

import numpy as np
import onnxruntime
import pytest

from shapeshift.runtime_models.colors.spherical_harmonics import C0, basis, shade
from shapeshift.runtime_models.evaluate import BATCH, Evaluator, directions, evaluate
from shapeshift.runtime_models.model import (
    HEADS,
    SIZE_PER_SPLAT,
    ControlEncoding,
    SplatLayers,
    Stop,
)
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.rotation import covariance, normalize, rotation_matrices
from shapeshift.runtime_models.splats.operations.rotate_splats import signs_of_harmonics
from shapeshift.runtime_models.stop_weights import StopWeights
from tests.support.models import make_random_model, psi_of, run_in_numpy


def twin(model, x, eye):
    """The whole evaluation in float64 numpy, straight from the paper's section 3.2."""
    count, k = len(model.anchors), model.splats_per_anchor
    delta = model.anchors.astype(np.float64) - eye
    length = np.linalg.norm(delta, axis=1, keepdims=True)
    parts = {
        "feature": model.features,
        "direction": np.divide(delta, length, out=np.zeros_like(delta), where=length > 0),
        "control": np.tile(psi_of(model, x), (count, 1)),
    }
    out = {}
    for name, mlp in model.networks.items():
        rows = np.concatenate([parts[p] for p in mlp.inputs], axis=1)
        out[name] = run_in_numpy(mlp, rows).reshape(count * k, SIZE_PER_SPLAT[name])
    out["offset"] = out["offset"] + np.repeat(model.anchors, k, axis=0)
    return out


@pytest.mark.parametrize("hidden", [(), (32,), (7, 64, 9)])
@pytest.mark.parametrize("anchors", [1, 2, 513])
def test_evaluation_equals_its_float64_twin(anchors, hidden):
    model = make_random_model(anchors, k=3, features=5, hidden=hidden, seed=anchors)
    eye = np.array([0.3, -2.0, 1.0])
    folded = Evaluator(model)
    for x in (0.0, 0.37, 1.0, StopWeights((("Thermal", 0.3), ("RGB", 0.7)))):
        got, want = evaluate(model, x, eye), twin(model, x, eye)
        fast = (*folded.geometry(x), folded.color(x, eye))
        for name, values in zip(("means", "scales", "wxyz", "opacity", "color"), fast, strict=True):
            np.testing.assert_allclose(values, getattr(got, name), atol=2e-5, err_msg=name)
        np.testing.assert_allclose(got.means, want["offset"], atol=1e-5)
        np.testing.assert_allclose(got.scales, want["scale"], atol=1e-5)
        np.testing.assert_allclose(got.opacity, want["opacity"][:, 0], atol=1e-5)
        np.testing.assert_allclose(got.color, want["color"], atol=1e-5)
        np.testing.assert_allclose(got.wxyz, normalize(want["rotation"]), atol=2e-4)


def test_a_package_may_say_that_x_is_encoded_as_it_is():
    model = replace(make_random_model(20, k=3, hidden=(8,)), between_stops="encoding")
    got, want = evaluate(model, 0.37, np.ones(3)), twin(model, 0.37, np.ones(3))
    np.testing.assert_allclose(got.means, want["offset"], atol=1e-5)
    np.testing.assert_allclose(got.color, want["color"], atol=1e-5)
    blended = evaluate(replace(model, between_stops="blend"), 0.37, np.ones(3))
    assert np.abs(got.means - blended.means).max() > 1e-3  # the two are not the same


def test_batches_join_without_a_seam():
    model = make_random_model(BATCH + 1, k=1, features=2, hidden=(4,))
    few = evaluate(model, 0.5, np.zeros(3))
    want = twin(model, 0.5, np.zeros(3))
    for rows in (slice(0, 3), slice(BATCH - 2, BATCH + 1)):
        np.testing.assert_allclose(few.means[rows], want["offset"][rows], atol=1e-5)


INPUTS = [("control",), ("feature",), ("control", "feature"), ("feature", "control")]
SEEN = [("direction",), ("control", "direction", "feature"), ("direction", "control")]


@pytest.mark.parametrize("inputs", INPUTS + SEEN)
def test_inputs_may_stand_in_any_order_and_may_be_absent(inputs):
    model = make_random_model(7, k=2)
    name = "color" if "direction" in inputs else "offset"
    width = sum({"feature": 16, "direction": 3, "control": 16}[part] for part in inputs)
    old = model.networks[name]
    first = np.random.default_rng(1).normal(0, 0.3, (32, width)).astype(np.float32)
    changed = replace(old, weights=(first, *old.weights[1:]), inputs=inputs)
    model = replace(model, networks=model.networks | {name: changed})
    eye, want = np.ones(3), twin(model, 0.3, np.ones(3))
    for fold in (True, False):
        evaluator = Evaluator(model, fold=fold)
        np.testing.assert_allclose(evaluator.geometry(0.3)[0], want["offset"], atol=1e-5)
        np.testing.assert_allclose(evaluator.color(0.3, eye), want["color"], atol=1e-5)


def test_the_file_itself_run_by_onnxruntime_gives_the_same(tmp_path):
    """No code of ours between the bytes on disk and the numbers."""
    model = make_random_model(30, k=4)
    write_package(model, tmp_path / "scene", "float32")
    x, eye = 0.61, np.array([2.0, 0.5, -1.0])
    direction = model.anchors - np.float32(eye)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    control = np.tile(psi_of(model, x), (30, 1))
    out = {}
    for name in HEADS:
        parts = (
            [model.features, direction, control] if name == "color" else [model.features, control]
        )
        session = onnxruntime.InferenceSession(
            tmp_path / "scene" / f"{name}.onnx", providers=["CPUExecutionProvider"]
        )
        rows = np.concatenate(parts, axis=1).astype(np.float32)
        out[name] = session.run(["output"], {"input": rows})[0].reshape(30, 4, -1)
    got = Evaluator(read_package(tmp_path / "scene"))
    means, scales, wxyz, opacity = got.geometry(x)
    np.testing.assert_allclose(
        means.reshape(30, 4, 3), model.anchors[:, None] + out["offset"], atol=1e-6
    )
    np.testing.assert_allclose(scales, out["scale"].reshape(-1, 3), atol=1e-6)
    np.testing.assert_allclose(wxyz, normalize(out["rotation"].reshape(-1, 4)), atol=1e-5)
    np.testing.assert_allclose(opacity, out["opacity"].reshape(-1), atol=1e-6)
    np.testing.assert_allclose(got.color(x, eye), out["color"].reshape(-1, 3), atol=1e-6)


def test_no_anchors_give_no_splats():
    splats = evaluate(make_random_model(0, k=3), 0.5, np.zeros(3))
    assert (splats.means.shape, splats.color.shape) == ((0, 3), (0, 3))


def test_the_direction_at_the_anchor_itself_is_zero_and_the_colour_finite():
    model = make_random_model(10)
    assert (directions(model.anchors, model.anchors[3])[3] == 0).all()
    assert np.isfinite(evaluate(model, 0.5, model.anchors[3]).color).all()


def test_only_the_colour_sees_the_eye_and_all_heads_see_x():
    model = make_random_model(20)
    evaluator = Evaluator(model)
    a, b = evaluator.geometry(0.0), evaluator.geometry(1.0)
    assert all(np.abs(p - q).max() > 1e-4 for p, q in zip(a, b, strict=True))
    near, far = evaluator.color(0.0, np.ones(3)), evaluator.color(0.0, -np.ones(3))
    assert np.abs(near - far).max() > 1e-3


def largest_fall(codes: np.ndarray) -> float:
    """How much nearer a further x can be than a nearer one, as a part of the largest distance.

    codes (n, d) of even steps in x.  Every x is tried as the place to walk away from.
    """
    worst = 0.0
    for i, start in enumerate(codes):
        for way in (codes[i:], codes[i::-1]):
            distance = np.linalg.norm(way - start, axis=1)
            worst = max(worst, (np.maximum.accumulate(distance) - distance).max())
    return worst / np.linalg.norm(codes[:, None] - codes[None], axis=2).max()


def test_gaussian_encodings_move_apart_until_they_saturate_and_frequency_encodings_do_not():
    """The paper's reason for the Gaussian encoding: no far x comes near again."""
    xs = np.linspace(0, 1, 101)
    gauss = np.stack([ControlEncoding().encode(x) for x in xs]).astype(float)
    waves = 2.0 ** np.arange(8) * np.pi
    frequency = np.concatenate([np.sin(np.outer(xs, waves)), np.cos(np.outer(xs, waves))], axis=1)
    # The Gaussians ripple by 3 %: between two of them the code is a little shorter than on one.
    assert largest_fall(gauss) < 0.05 < 0.3 < largest_fall(frequency)
    near = np.stack([np.linalg.norm(gauss[i : 96 + i] - gauss[:96], axis=1) for i in range(6)])
    assert (np.diff(near, axis=0) > 0).all()  # up to 0.05 apart strictly, from every x
    far = np.linalg.norm(gauss[50:] - gauss[0], axis=1)
    assert np.ptp(far) < 0.03 * far.max()  # saturated


@pytest.mark.parametrize("seed", range(5))
def test_covariance_is_equation_1_and_positive(seed):
    rng = np.random.default_rng(seed)
    scales, wxyz = rng.uniform(0.01, 2, (50, 3)), rng.normal(size=(50, 4))
    packed = covariance(scales, wxyz)
    full = np.empty((50, 3, 3))
    for i, (row, column) in enumerate([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]):
        full[:, row, column] = full[:, column, row] = packed[:, i]
    r = rotation_matrices(normalize(wxyz))
    s = np.stack([np.diag(v) for v in scales])
    np.testing.assert_allclose(full, r @ s @ s.swapaxes(1, 2) @ r.swapaxes(1, 2), atol=1e-12)
    np.testing.assert_allclose(np.sort(np.linalg.eigvalsh(full)), np.sort(scales**2), rtol=1e-8)


def test_a_quaternion_of_zero_length_is_no_rotation():
    np.testing.assert_array_equal(normalize(np.zeros((2, 4))), [[1, 0, 0, 0]] * 2)


def test_harmonics_are_orthonormal_up_to_degree_3():
    """Monte Carlo over the sphere: the mean of Y_i Y_j is delta_ij / (4 pi)."""
    rng = np.random.default_rng(0)
    d = rng.normal(size=(400_000, 3))
    y = basis(d / np.linalg.norm(d, axis=1, keepdims=True), 16)
    np.testing.assert_allclose(y.T @ y / len(y) * 4 * np.pi, np.eye(16), atol=0.02)


@pytest.mark.parametrize("signs", [(1, -1, -1), (-1, 1, -1), (-1, -1, 1)])
def test_half_turn_signs_equal_turned_directions(signs):
    d = np.random.default_rng(1).normal(size=(100, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    found = signs_of_harmonics(np.array(signs, float), 16)
    np.testing.assert_allclose(basis(d * signs, 16), basis(d, 16) * found)
    assert set(found) == {-1, 1}


def test_layers_fade_by_opacity_alone_and_shade_is_never_negative():
    one = np.ones((2, 3), np.float32)
    sh = np.array([[[0.5 / C0, 0.0, -9.0]]] * 2, np.float32)
    stops = (Stop("a", 0.0), Stop("b", 1.0))
    wxyz, opacity = np.eye(4, dtype=np.float32)[[0, 0]], np.array([0.5, 0.8], np.float32)
    layers = SplatLayers(one, one, wxyz, opacity, sh, np.array([0, 1], np.int32), stops)
    evaluator = Evaluator(layers)
    np.testing.assert_allclose(evaluator.geometry(0.25)[3], [0.5, 0.2])
    np.testing.assert_allclose(evaluator.color(0.0, np.zeros(3)), [[1.0, 0.5, 0.0]] * 2, atol=1e-6)
    assert shade(sh, directions(one, np.ones(3, np.float32))).min() == 0
