"""The gradient of every operator: by finite differences of another runtime, and by complex steps.

What is differentiated by ONNX nodes in float32 through onnxruntime is held against two oracles in
float64 that share nothing with it: central differences of ONNX's own reference evaluator, and the
complex step of the same function written in numpy.
"""

import numpy as np
import pytest
from onnx.reference import ReferenceEvaluator

from shapeshift.runtime_models.model import BadFile
from shapeshift.training.gradients.read_network import read_network
from shapeshift.training.gradients.reverse_mode import CONSTANT, PRODUCTS, GradientSession
from tests.support.training.onnx_files import (
    in_float64,
    model_of,
    tiny_vgg,
    vision_transformer,
    write_model,
)
from tests.support.training.operator_cases import CASES, row

RNG = np.random.default_rng
STEP = 1e-6  # of the differences: of float64, the error of both kinds is then some 1e-9
CLOSE = {"rtol": 2e-5, "atol": 2e-5}  # of float32, of numbers of order 1 and sums of some ten

NO_DIFFERENCES = {  # why the reference evaluator cannot be asked
    "Cast": "its target type is float32, which is no function of float64",
    "Erf": "it calculates erf in float32",
    "Gelu": "it calculates erf in float32",
    "Softmax, version 11": "it knows the later meaning of the axis alone",
}


def picture(case):
    """Numbers in the case's range, none within the differences' reach of a kink."""
    x = RNG(7).uniform(case.low, case.high, case.shape)
    for kink in (-1, 0, 0.5, 1):
        x = np.where(abs(x - kink) < 0.01, kink + 0.02, x)
    return x


def gradient_of(graph, output, x, by="x"):
    """Of sum(y w) with some fixed w; and that w."""
    graph.infer_shapes()
    weights = RNG(3).normal(size=graph.shape(output))
    product = graph.add_node("Mul", output, graph.add_constant(weights))
    loss = graph.sum(product, range(weights.ndim), keepdims=0) if weights.ndim else product
    session = GradientSession(graph, {"loss": (loss, 1.0)}, by, threads=1)
    found, gradient = session({by: x.astype(np.float32)})
    return found["loss"], gradient, weights


@pytest.mark.parametrize("name", CASES)
def test_every_operator_against_differences_and_complex_steps(name, tmp_path):
    case, x = CASES[name], picture(CASES[name])
    rows = case.rows, {"x": case.shape}, ["y"], case.constants
    path = write_model(tmp_path / "one.onnx", *rows, opset=case.opset)
    graph = read_network(path, {"x": case.shape}, ["y"])
    loss, gradient, weights = gradient_of(graph, "y", x)
    assert gradient.shape == case.shape and np.isfinite(gradient).all()

    exact = np.zeros(case.shape)
    for i in np.ndindex(case.shape):
        stepped = x.astype(complex)
        stepped[i] += 1e-30j
        exact[i] = (case.formula(stepped).reshape(weights.shape).imag * weights).sum() / 1e-30
    np.testing.assert_allclose(gradient, exact, **CLOSE)
    assert loss == pytest.approx((case.formula(x + 0j).real.reshape(weights.shape) * weights).sum(),
                                 rel=1e-4, abs=1e-4)  # fmt: skip

    if name in NO_DIFFERENCES:
        return
    reference = ReferenceEvaluator(model_of(*rows, opset=case.opset, kind=np.float64))
    different = np.zeros(case.shape)
    for i in np.ndindex(case.shape):
        ends = []
        for sign in (1, -1):
            moved = x.copy()
            moved[i] += sign * STEP
            ends.append((np.asarray(reference.run(["y"], {"x": moved})[0]) * weights).sum())
        different[i] = (ends[0] - ends[1]) / (2 * STEP)
    np.testing.assert_allclose(gradient, different, **CLOSE)


def test_every_operator_has_a_case():
    assert {name.split(",")[0] for name in CASES} == set(PRODUCTS)
    assert not set(CONSTANT) & set(PRODUCTS) and len(PRODUCTS) == 45


def test_a_pooling_of_equals_gives_the_gradient_to_one_of_them(tmp_path):
    """As a subgradient has to: spread over all equals it would count several times."""
    pool = {"kernel_shape": [2, 2], "strides": [2, 2]}
    path = write_model(
        tmp_path / "pool.onnx", [("MaxPool", ["x"], ["y"], pool)], {"x": (1, 1, 4, 4)}, ["y"], {}
    )
    _, gradient, weights = gradient_of(
        read_network(path, {"x": (1, 1, 4, 4)}, ["y"]), "y", np.zeros((1, 1, 4, 4))
    )
    sums = gradient.reshape(2, 2, 2, 2).sum((1, 3))
    np.testing.assert_allclose(sums, weights[0, 0], rtol=1e-6)
    assert (gradient != 0).sum() == 4


def along(path, graph, x, by, directions=3):
    """(numeric, analytic) slopes of sum(y w), along the gradient's signs and random directions.

    The differences are of float64 and so small that they cross next to no kink of ReLU or pooling.
    """
    output = graph.outputs[0]
    _, gradient, weights = gradient_of(graph, output, x, by)
    reference, found = ReferenceEvaluator(in_float64(path, [output])), []
    for k in range(directions):
        d = np.sign(gradient).astype(float) if k == 0 else RNG(k).normal(size=x.shape)
        ends = [
            (reference.run([output], {by: x + sign * STEP * d})[0] * weights).sum()
            for sign in (1, -1)
        ]
        found.append(((ends[0] - ends[1]) / (2 * STEP), float((gradient * d).sum())))
    return found


@pytest.mark.parametrize("opset", [11, 17])
@pytest.mark.parametrize("fused", [True, False])
def test_a_vision_transformer_of_two_pictures_at_once(tmp_path, fused, opset):
    if fused and opset < 17:
        pytest.skip("LayerNormalization came with version 17")
    path = vision_transformer(tmp_path / "vit.onnx", fused=fused, opset=opset)
    graph = read_network(path, {"pixel_values": (2, 3, 32, 32)}, ["image_embeds"])
    assert not {"Shape", "Expand", "Constant"} & {node.op_type for node in graph.nodes}
    x = RNG(5).normal(size=(2, 3, 32, 32))
    for numeric, analytic in along(path, graph, x, "pixel_values"):
        assert analytic == pytest.approx(numeric, rel=1e-4, abs=1e-5)


def test_pictures_of_a_batch_do_not_touch_each_other(tmp_path):
    path = vision_transformer(tmp_path / "vit.onnx")
    both = read_network(path, {"pixel_values": (2, 3, 32, 32)}, ["image_embeds"])
    first = both.slice("image_embeds", 0, 0, 1)
    loss = both.sum(first, [0, 1], keepdims=0)
    x = RNG(5).normal(size=(2, 3, 32, 32)).astype(np.float32)
    _, gradient = GradientSession(both, {"a": (loss, 1.0)}, "pixel_values")({"pixel_values": x})
    assert (gradient[1] == 0).all() and abs(gradient[0]).max() > 1e-3


@pytest.mark.parametrize("size", [(16, 16), (21, 18)])  # 21: poolings leave a row out
def test_a_small_vgg(tmp_path, size):
    path = tiny_vgg(tmp_path / "v.onnx")
    graph = read_network(path, {"input": (1, 3, *size)}, ["relu3_1"])
    assert [node.op_type for node in graph.nodes].count("Conv") == 5  # what follows is cut off
    for numeric, analytic in along(path, graph, RNG(5).normal(size=(1, 3, *size)), "input"):
        assert analytic == pytest.approx(numeric, rel=1e-4, abs=1e-4)


def test_the_real_vgg(data):
    file = data / "models_vgg16" / "vgg16_caffe_relu1_2-4_3.onnx"
    if not file.is_file():
        pytest.skip("the VGG16 file is absent")
    graph = read_network(file, {"input": (1, 3, 32, 48)}, ["relu3_1"])
    x = 60 * RNG(5).normal(size=(1, 3, 32, 48))
    numeric, analytic = along(file, graph, x, "input", directions=1)[0]
    assert analytic == pytest.approx(numeric, rel=1e-4)


def test_a_loss_that_no_operator_ties_to_the_picture(tmp_path):
    rows = [row("Add", "b", "b"), row("ArgMax", "x", out="i", axis=0)]
    path = write_model(tmp_path / "n.onnx", rows, {"x": (4,)}, ["y", "i"], {"b": np.ones(4)})
    graph = read_network(path, {"x": (4,)}, ["y", "i"])
    with pytest.raises(BadFile, match="does not depend on the input 'x'"):
        GradientSession(graph, {"loss": (graph.sum("y", [0], 0), 1.0)}, "x")
    graph = read_network(path, {"x": (4,)}, ["y", "i"])
    picked = graph.add_node("Gather", graph.add_constant(np.arange(4.0)), "i", axis=0)
    loss = graph.sum(picked, [0], 0)
    with pytest.raises(BadFile, match="nothing that has a gradient leads from 'x'"):
        GradientSession(graph, {"loss": (loss, 1.0)}, "x")
