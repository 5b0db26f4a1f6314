"""Networks as ONNX: written, run alone, read back to the bit; what is no plain chain is refused."""

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import TensorProto, helper, numpy_helper

from shapeshift.runtime_models.model import HEADS, BadFile, Mlp
from shapeshift.runtime_models.package.package_files import write_onnx
from shapeshift.runtime_models.package.read_onnx import read_onnx
from tests.support.models import make_random_model, run_in_numpy

node = helper.make_node
EYE2 = np.eye(2)


@pytest.mark.parametrize("head", ["none", "tanh", "sigmoid", "softplus", "exp"])
@pytest.mark.parametrize("clip", [None, (-6.0, 3.0)])
@pytest.mark.parametrize("gain", [1.0, 0.025])
def test_written_networks_run_alone_and_read_back(head, clip, gain):
    rng = np.random.default_rng(0)
    weights = tuple(rng.normal(size=s).astype(np.float32) for s in [(8, 5), (3, 8)])
    mlp = Mlp(weights, (weights[0][:, 0], weights[1][:, 0]), head, ("feature",), clip, gain)
    data = write_onnx(mlp, "test")
    rows = rng.normal(size=(7, 5)).astype(np.float32)
    session = onnxruntime.InferenceSession(data, providers=["CPUExecutionProvider"])
    got = session.run(None, {"input": rows})[0]
    np.testing.assert_allclose(got, run_in_numpy(mlp, rows), rtol=2e-5, atol=1e-6)
    back = read_onnx(data, "test", ("feature",))
    assert (back.head, back.clip) == (mlp.head, mlp.clip)
    stored = Mlp(mlp.weights, mlp.biases, head, ("feature",), clip, float(np.float32(gain)))
    np.testing.assert_array_equal(run_in_numpy(back, rows), run_in_numpy(stored, rows))


def graph_of(nodes, **constants):
    values = [numpy_helper.from_array(np.float32(v), k) for k, v in constants.items()]
    ends = [helper.make_tensor_value_info(n, TensorProto.FLOAT, None) for n in ("input", "output")]
    graph = helper.make_graph(nodes, "g", ends[:1], ends[1:], values)
    opset = [helper.make_opsetid("", 17)]
    return helper.make_model(graph, opset_imports=opset, ir_version=8).SerializeToString()


def test_matmul_add_alpha_beta_and_identity_are_understood():
    w = np.arange(6, dtype=np.float32).reshape(2, 3)
    node = helper.make_node
    data = graph_of(
        [
            node("MatMul", ["input", "w"], ["a"]),
            node("Add", ["b", "a"], ["c"]),
            node("Identity", ["c"], ["d"]),
            node("Relu", ["d"], ["e"]),
            node("Gemm", ["e", "v", "u"], ["output"], alpha=2.0, beta=3.0),
        ],
        w=w, b=[1, -2, 3], v=np.eye(3), u=[1, 1, 1],
    )  # fmt: skip
    mlp = read_onnx(data, "net", ("feature",))
    rows = np.array([[1.0, -1.0], [0.5, 2.0]])
    want = 2 * np.maximum(rows @ w + [1, -2, 3], 0) + 3
    np.testing.assert_allclose(run_in_numpy(mlp, rows), want, rtol=1e-6)


def run_file(data: bytes, rows: np.ndarray) -> np.ndarray:
    session = onnxruntime.InferenceSession(data, providers=["CPUExecutionProvider"])
    return session.run(None, {session.get_inputs()[0].name: rows.astype(np.float32)})[0]


GEMM = node("Gemm", ["input", "w"], ["a"])
UNDERSTOOD = {
    "bias of one number": ([node("Gemm", ["input", "w", "c"], ["output"])], {"c": 0.5}),
    "bias of one row": ([node("Gemm", ["input", "w", "c"], ["output"])], {"c": [[0.5, 2.0]]}),
    "clip from below": ([GEMM, node("Clip", ["a", "c"], ["output"])], {"c": 0.0}),
    "clip from above": ([GEMM, node("Clip", ["a", "", "c"], ["output"])], {"c": 0.1}),
    "gain before its value": ([GEMM, node("Mul", ["c", "a"], ["output"])], {"c": [3.0]}),
    "clip and gain": (
        [GEMM, node("Clip", ["a", "l", "h"], ["b"]), node("Mul", ["b", "c"], ["output"])],
        {"l": -0.5, "h": 0.5, "c": 2.0},
    ),
    "constant node": (
        [
            node("Constant", [], ["c"], value=numpy_helper.from_array(np.float32(EYE2 * 3))),
            node("Identity", ["c"], ["d"]),
            GEMM,
            node("Identity", ["a"], ["b"]),
            node("Relu", ["b"], ["r"]),
            node("MatMul", ["r", "d"], ["output"]),
        ],
        {},
    ),
    "constant float": (
        [GEMM, node("Constant", [], ["c"], value_float=2.5), node("Mul", ["a", "c"], ["output"])],
        {},
    ),
}


@pytest.mark.parametrize("how", UNDERSTOOD)
def test_what_is_understood_equals_the_file_run_by_onnxruntime(how):
    nodes, constants = UNDERSTOOD[how]
    data = graph_of(nodes, w=[[1.0, 2.0], [-0.3, 0.7]], **constants)
    rows = np.random.default_rng(0).normal(size=(9, 2))
    mlp = read_onnx(data, "net", ("feature",))
    np.testing.assert_allclose(run_in_numpy(mlp, rows), run_file(data, rows), atol=1e-5)
    np.testing.assert_allclose(
        run_file(write_onnx(mlp, "again"), rows), run_file(data, rows), atol=1e-6
    )


RELU, TANH = node("Relu", ["a"], ["r"]), node("Tanh", ["a"], ["t"])
REFUSED = {
    "unknown node": (
        [GEMM, node("Erf", ["a"], ["output"])],
        "'Erf' at 'output' is not understood;",
    ),
    "recurrent": (
        [node("LSTM", ["input", "w"], ["output"])],
        "'LSTM' at 'output' is not understood;",
    ),
    "another domain": (
        [node("Gemm", ["input", "w"], ["output"], domain="com.microsoft")],
        r"'com\.microsoft\.Gemm' at 'output' is not understood;",
    ),
    "bias after the head": (
        [GEMM, TANH, node("Add", ["t", "b"], ["output"])],
        "'Add' at 'output' is not understood after Tanh",
    ),
    "gain before the head": (
        [GEMM, node("Mul", ["a", "g"], ["t"]), node("Tanh", ["t"], ["output"])],
        "'Tanh' at 'output' is not understood after Mul",
    ),
    "two heads": (
        [GEMM, TANH, node("Sigmoid", ["t"], ["output"])],
        "'Sigmoid' at 'output' is not understood after Tanh",
    ),
    "hidden tanh": (
        [GEMM, TANH, node("Gemm", ["t", "w"], ["output"])],
        "'Gemm' at 'output' is not understood after Tanh",
    ),
    "no relu between": (
        [GEMM, node("Gemm", ["a", "w"], ["output"])],
        "'Gemm' at 'output' is not understood after Gemm",
    ),
    "relu first": (
        [node("Relu", ["input"], ["output"])],
        "'Relu' at 'output' is not understood first",
    ),
    "branch": (
        [GEMM, RELU, node("Gemm", ["input", "w"], ["output"])],
        "'Gemm' at 'output' does not take what the node before it gives",
    ),
    "added to itself": (
        [GEMM, node("Add", ["a", "a"], ["output"])],
        "'Add' at 'output' does not take what the node before it gives",
    ),
    "output in the middle": (
        [node("Gemm", ["input", "w"], ["output"]), node("Tanh", ["output"], ["t"])],
        "does not end in a layer and its head",
    ),
    "ends in Relu": ([GEMM, node("Relu", ["a"], ["output"])], "does not end in a layer"),
    "nothing": ([], "does not end in a layer"),
    "transposed input": (
        [node("Gemm", ["input", "w"], ["output"], transA=1)],
        "'Gemm' at 'output' is not a plain layer",
    ),
    "matrix times input": ([node("MatMul", ["w", "input"], ["output"])], "needs 'input' as stored"),
    "no weight": ([node("Gemm", ["input"], ["output"])], "needs '' as stored floats"),
    "unknown weight": ([node("Gemm", ["input", "x"], ["output"])], "needs 'x' as stored floats"),
    "gain of many": ([GEMM, node("Mul", ["a", "b"], ["output"])], "needs one number, it has 2"),
    "bias of three": (
        [node("Gemm", ["input", "w", "three"], ["output"])],
        "3 biases for 2 outputs",
    ),
    "layers that do not meet": (
        [GEMM, RELU, node("Gemm", ["r", "long"], ["output"])],
        "takes 3 values, the layer before gives 2",
    ),
    "turned clip": (
        [GEMM, node("Clip", ["a", "g", "low"], ["output"])],
        "expected a lower and a higher bound",
    ),
}


@pytest.mark.parametrize("how", REFUSED)
def test_other_graphs_are_refused_naming_the_node(how):
    nodes, words = REFUSED[how]
    data = graph_of(nodes, w=EYE2, b=[1, 1], g=3.0, low=-9.0, three=[1, 2, 3], long=np.ones((3, 2)))
    with pytest.raises(BadFile, match=words) as failure:
        read_onnx(data, "net", ("feature",))
    message = str(failure.value)
    assert message.startswith("net") and "\n" not in message and len(message) < 300


def test_weights_in_another_file_are_refused():
    model = onnx.load_model_from_string(graph_of([GEMM], w=EYE2))
    tensor = model.graph.initializer[0]
    tensor.data_location = TensorProto.EXTERNAL
    tensor.external_data.add(key="location", value="../../etc/passwd")
    with pytest.raises(BadFile, match="keeps its weights in another file"):
        read_onnx(model.SerializeToString(), "net", ("feature",))


def test_two_inputs_are_refused():
    model = onnx.load_model_from_string(graph_of([GEMM], w=EYE2))
    model.graph.input.append(helper.make_tensor_value_info("other", TensorProto.FLOAT, None))
    with pytest.raises(BadFile, match="net has 2 inputs and 1 outputs"):
        read_onnx(model.SerializeToString(), "net", ("feature",))


@pytest.mark.parametrize("head", HEADS)
def test_broken_bytes_are_a_sentence_or_a_network_never_a_traceback(head):
    data = write_onnx(make_random_model().networks[head], head)
    rng, refused = np.random.default_rng(0), 0
    for i in range(60):
        broken = bytearray(data[: rng.integers(0, len(data))] if i % 2 else data)
        # the structure lies at both ends, the weights between: hit the structure
        places = np.r_[0 : min(300, len(broken)), max(0, len(broken) - 300) : len(broken)]
        for at in rng.choice(places, 3) if len(places) else ():
            broken[at] = rng.integers(0, 256)
        try:
            read_onnx(bytes(broken), head, ("feature",))
        except BadFile as failure:
            refused += 1
            assert "\n" not in str(failure)
    assert refused > 20
