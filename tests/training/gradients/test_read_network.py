"""Networks that cannot be differentiated, or that are no networks: one sentence each."""

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from shapeshift.runtime_models.model import BadFile
from shapeshift.training.gradients import read_network as reading
from shapeshift.training.gradients.read_network import read_network
from shapeshift.training.gradients.reverse_mode import GradientSession
from tests.support.training.onnx_files import model_of, tiny_vgg, vision_transformer, write_model
from tests.support.training.operator_cases import row

RNG = np.random.default_rng
X = {"x": (1, 2, 6)}


def refusal(path, sizes=None, outputs=("y",)) -> str:
    """The sentence with which reading, or else building the gradient, ends."""
    sizes = X if sizes is None else sizes
    with pytest.raises(BadFile) as failure:
        graph = read_network(path, sizes, outputs)
        graph.infer_shapes()
        axes = range(len(graph.shape(outputs[0])))
        loss = graph.sum(outputs[0], axes, keepdims=0)
        GradientSession(graph, {"loss": (loss, 1.0)}, next(iter(sizes)))
    message = str(failure.value)
    assert "\n" not in message and len(message) < 500 and message.endswith("."), message
    return message


def test_files_that_are_none(tmp_path, monkeypatch):
    assert "is no file" in refusal(tmp_path / "absent.onnx")
    assert "is no file" in refusal(tmp_path)
    (tmp_path / "empty.onnx").write_bytes(b"")
    assert "has 0 bytes" in refusal(tmp_path / "empty.onnx")
    (tmp_path / "text.onnx").write_text("no network at all")
    assert "is not a readable ONNX file" in refusal(tmp_path / "text.onnx")
    path = write_model(tmp_path / "n.onnx", [row("Exp", "x")], X, ["y"], {})
    monkeypatch.setattr(reading, "LARGEST_FILE", path.stat().st_size - 1)
    assert "are read" in refusal(path)
    monkeypatch.setattr(reading, "LARGEST_FILE", path.stat().st_size)
    read_network(path, X, ["y"])


def test_too_many_nodes(tmp_path, monkeypatch):
    rows = [row("Exp", "x", out="a"), row("Exp", "a")]
    path = write_model(tmp_path / "n.onnx", rows, X, ["y"], {})
    monkeypatch.setattr(reading, "MOST_NODES", 1)
    assert "has 2 nodes; at most 1 fit" in refusal(path)
    monkeypatch.setattr(reading, "MOST_NODES", 2)
    read_network(path, X, ["y"])


@pytest.mark.parametrize(
    "opset, fits", [(9, False), (10, False), (11, True), (23, True), (24, False), (99, False)]
)
def test_versions_of_the_operators(tmp_path, opset, fits):
    path = write_model(tmp_path / "n.onnx", [row("Exp", "x")], X, ["y"], {}, opset=opset)
    if fits:
        read_network(path, X, ["y"])
    else:
        assert f"written for version {opset}" in refusal(path)


INPUTS = {
    "another name": (
        {"pixels": (1, 2, 6)},
        "has the inputs 'x'; wanted is 'pixels'|nothing to giv",
    ),
    "more": ({}, "has an input 'x', for which there is nothing to give"),
    "another size": ({"x": (1, 2, 7)}, "input 'x' is 1 x 2 x 6; 1 x 2 x 7 is wanted"),
    "another rank": ({"x": (2, 6)}, "input 'x' is 1 x 2 x 6; 2 x 6 is wanted"),
}


@pytest.mark.parametrize("how", INPUTS)
def test_inputs_that_are_not_as_wanted(tmp_path, how):
    sizes, words = INPUTS[how]
    path = write_model(tmp_path / "n.onnx", [row("Exp", "x")], X, ["y"], {})
    with pytest.raises(BadFile, match=words):
        read_network(path, sizes, ["y"])


def test_half_floats_and_outputs_that_are_not_there(tmp_path):
    model = model_of([row("Exp", "x")], X, ["y"], {})
    model.graph.input[0].type.tensor_type.elem_type = TensorProto.FLOAT16
    (tmp_path / "half.onnx").write_bytes(model.SerializeToString())
    assert "is no float32; export the network in float32" in refusal(tmp_path / "half.onnx")
    path = write_model(tmp_path / "n.onnx", [row("Exp", "x")], X, ["y"], {})
    assert "gives no 'relu3_1'; it ends in 'y'" in refusal(path, outputs=("relu3_1",))


def test_weights_in_another_file(tmp_path):
    model = model_of([row("Add", "x", "b")], X, ["y"], {"b": np.ones(6)})
    tensor = model.graph.initializer[0]
    tensor.data_location = TensorProto.EXTERNAL
    tensor.external_data.add(key="location", value="../../etc/passwd")
    (tmp_path / "n.onnx").write_bytes(model.SerializeToString())
    assert "keeps its weights in another file" in refusal(tmp_path / "n.onnx")


def test_operators_are_refused_by_name(tmp_path):
    path = write_model(tmp_path / "a.onnx", [row("Cos", "x")], X, ["y"], {})
    assert "no gradient through the operator 'Cos' (at 'y')" in refusal(path)
    model = model_of([row("Exp", "x")], X, ["y"], {})
    model.graph.node[0].domain = "com.example"
    (tmp_path / "b.onnx").write_bytes(model.SerializeToString())
    assert "the operator 'com.example.Exp'" in refusal(tmp_path / "b.onnx")
    body = helper.make_graph([helper.make_node("Exp", ["x"], ["z"])], "b", [], [])
    node = helper.make_node("If", ["c"], ["y"], then_branch=body, else_branch=body)
    model = model_of([], X, ["y"], {"c": np.array(True)})
    model.graph.node.append(node)
    (tmp_path / "c.onnx").write_bytes(model.SerializeToString())
    assert "the operator 'If'" in refusal(tmp_path / "c.onnx")


def test_an_operator_that_nothing_wanted_needs_does_no_harm(tmp_path):
    rows = [row("Exp", "x"), row("Cos", "x", out="other")]
    path = write_model(tmp_path / "n.onnx", rows, X, ["y", "other"], {})
    assert [n.op_type for n in read_network(path, X, ["y"]).nodes] == ["Exp"]
    assert "'Cos'" in refusal(path, outputs=("other",))


FORMS = {  # uses of a known operator that have no gradient here: rows, constants, words
    "vectors": ([row("MatMul", "x", "w")], {"w": np.ones(6)}, "'MatMul' of vectors"),
    "a calculated exponent": (
        [row("Exp", "x", out="e"), row("Pow", "x", "e")], {}, "'Pow' whose input 2 is calculated",
    ),
    "a mirror": (
        [row("Pad", "x", "p", mode="reflect")], {"p": np.array([0, 0, 1, 0, 0, 1])},
        "'Pad' in the mode 'reflect'",
    ),
    "cut off": ([row("Pad", "x", "p")], {"p": np.array([0, 0, -1, 0, 0, 0])}, "that cuts off"),
    "a bent gate": ([row("Gelu", "x", approximate="tanh")], {}, "in its approximation by tanh"),
    "double": (
        [row("Cast", "x", out="d", to=11), row("Exp", "d", out="e"), row("Cast", "e", to=1)], {},
        "'Cast' between floats other than float32",
    ),
    "a window left over": (
        [row("AveragePool", "x", kernel_shape=[2], strides=[2], ceil_mode=1)], {}, "in ceil_mode",
    ),
}  # fmt: skip


@pytest.mark.parametrize("how", FORMS)
def test_forms_of_an_operator_that_have_no_gradient(tmp_path, how):
    rows, constants, words = FORMS[how]
    path = write_model(tmp_path / "n.onnx", rows, X, ["y"], constants, opset=20)
    with pytest.raises(BadFile, match=words):
        raise BadFile(refusal(path))


def test_overlapping_windows_need_a_newer_version(tmp_path):
    rows = [row("MaxPool", "x", kernel_shape=[3])]
    path = write_model(tmp_path / "n.onnx", rows, X, ["y"], {}, opset=13)
    assert "windows that overlap, before version 16" in refusal(path)


@pytest.mark.parametrize("name", ["a root", "a product", "a range"])
def test_sizes_that_are_calculated_are_known_before_anything_is(tmp_path, name):
    """What shape inference does not see through, as a root of floats, is calculated while small."""
    large = {"s": np.array([1e10, 1e10, 1e10]), "t": np.array([1 << 11] * 3), "n": np.array(0),
             "m": np.array(1 << 40), "one": np.array(1)}  # fmt: skip
    rows = {
        "a root": [row("Sqrt", "s", out="f"), row("Cast", "f", out="i", to=7),
                   row("ConstantOfShape", "i", out="c")],
        "a product": [row("Mul", "t", "t", out="i"), row("ConstantOfShape", "i", out="c")],
        "a range": [row("Range", "n", "m", "one", out="i"), row("Cast", "i", out="c", to=1)],
    }[name]  # fmt: skip
    used = {each for _, inputs, _, _ in rows for each in inputs}
    rows = [*rows, row("ReduceSum", "c", out="r"), row("Add", "x", "r")]
    chosen = {each: value for each, value in large.items() if each in used}
    path = write_model(tmp_path / "n.onnx", rows, {"x": (1, 1, 6)}, ["y"], chosen)
    assert "of memory" in refusal(path, {"x": (1, 1, 6)})


def test_a_shape_that_the_picture_decides_is_refused(tmp_path):
    rows = [row("Cast", "x", out="i", to=7), row("ConstantOfShape", "i", out="c"),
            row("ReduceSum", "c", out="r"), row("Add", "x", "r")]  # fmt: skip
    path = write_model(tmp_path / "n.onnx", rows, {"x": (6,)}, ["y"], {})
    assert "the shape of 'c' is not known beforehand" in refusal(path, {"x": (6,)})


@pytest.mark.parametrize("kind", ["ConstantOfShape", "Expand", "Pad"])
def test_a_few_bytes_that_ask_for_terabytes(tmp_path, kind):
    many = np.array([1 << 15, 1 << 15, 1 << 10])
    rows = {
        "ConstantOfShape": [row("ConstantOfShape", "s", out="c"), row("ReduceSum", "c", out="r")],
        "Expand": [row("Exp", "x", out="e"), row("Expand", "e", "s", out="r")],
        "Pad": [row("Pad", "x", "p", out="r")],
    }[kind]
    size = many if kind != "Expand" else np.array([1 << 20, 1 << 10, 6])
    constants = {"s": size, "p": np.concatenate([np.zeros(3, np.int64), many])}
    used = {name for _, inputs, _, _ in rows for name in inputs}
    rows = [*rows, row("Add", "x", "r") if kind == "ConstantOfShape" else row("Exp", "r")]
    chosen = {n: v for n, v in constants.items() if n in used}
    path = write_model(tmp_path / "n.onnx", rows, {"x": (1, 1, 6)}, ["y"], chosen)
    assert "of memory" in refusal(path, {"x": (1, 1, 6)})


@pytest.mark.parametrize("which", [tiny_vgg, vision_transformer])
def test_broken_bytes_are_a_sentence_or_a_network_never_a_traceback(tmp_path, which):
    data = which(tmp_path / "whole.onnx").read_bytes()
    vgg = which is tiny_vgg
    sizes = {"input": (1, 3, 16, 16)} if vgg else {"pixel_values": (1, 3, 32, 32)}
    output, rng, refused = "relu2_1" if vgg else "image_embeds", RNG(0), 0
    for i in range(60):
        broken = bytearray(data[: rng.integers(0, len(data))] if i % 4 == 0 else data)
        # The structure lies before the weights: half of the hits are there.
        for at in rng.integers(0, max(1, len(broken) // (1 + 4 * (i % 2))), 6):
            if at < len(broken):
                broken[at] = rng.integers(0, 256)
        (tmp_path / "broken.onnx").write_bytes(broken)
        try:
            graph = read_network(tmp_path / "broken.onnx", sizes, [output])
            loss = graph.sum(output, range(len(graph.shape(output))), keepdims=0)
            GradientSession(graph, {"loss": (loss, 1.0)}, next(iter(sizes)))
        except BadFile as failure:
            refused += 1
            assert "\n" not in str(failure)
    assert refused > 20


def test_a_circle_of_nodes(tmp_path):
    rows = [row("Add", "x", "b", out="a"), row("Exp", "a", out="b"), row("Exp", "b")]
    model = model_of(rows, X, ["y"], {})
    (tmp_path / "n.onnx").write_bytes(model.SerializeToString())
    assert "n.onnx" in refusal(tmp_path / "n.onnx")


def test_the_file_is_closed_and_as_it_was(tmp_path):
    path = tiny_vgg(tmp_path / "v.onnx")
    before = path.read_bytes()
    read_network(path, {"input": (1, 3, 16, 16)}, ["relu3_3"])
    assert path.read_bytes() == before and onnx.load(path).graph.name == "made"
    assert list(tmp_path.iterdir()) == [path]
