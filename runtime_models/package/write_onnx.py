"""A network to the bytes of an ONNX file that runs alone in onnxruntime on (N, inputs)."""

import numpy as np

from shapeshift.runtime_models.model import Mlp

OPSET = 17
IR_VERSION = 8  # what opset 17 came with; older runtimes open it, too
HEAD_NODE = {"tanh": "Tanh", "sigmoid": "Sigmoid", "softplus": "Softplus", "exp": "Exp"}


def write_onnx(mlp: Mlp, name: str, first_bias: str = "stored") -> bytes:
    """Gemm, Relu, ..., Gemm, then Clip, the head and Mul where the network has them.

    With first_bias="input" the first layer's bias is not stored: it is a second input "bias" of the
    graph, (1, hidden) for all rows or (N, hidden).  "input and rows": and a third, "rows"
    (N, hidden), is added to the first layer, too.
    """
    from onnx import NodeProto, TensorProto, checker, helper, numpy_helper

    constants: list[TensorProto] = []
    nodes: list[NodeProto] = []

    def constant(label: str, value: np.ndarray | float) -> str:
        constants.append(numpy_helper.from_array(np.asarray(value, np.float32, order="C"), label))
        return label

    def apply(kind: str, *inputs: str, **attributes) -> str:
        nodes.append(helper.make_node(kind, inputs, [f"{kind}{len(nodes)}"], **attributes))
        return nodes[-1].output[0]

    value = "input"
    for i, (weight, bias) in enumerate(zip(mlp.weights, mlp.biases, strict=True)):
        if i:
            value = apply("Relu", value)
        added = {"input": "bias", "input and rows": "rows"}.get(first_bias) if i == 0 else None
        label = added or constant(f"bias{i}", bias)
        value = apply("Gemm", value, constant(f"weight{i}", weight), label, transB=1)
        if added == "rows":
            value = apply("Add", value, "bias")
    if mlp.clip is not None:
        value = apply("Clip", value, constant("low", mlp.clip[0]), constant("high", mlp.clip[1]))
    if mlp.head != "none":
        value = apply(HEAD_NODE[mlp.head], value)
    if mlp.gain != 1.0:
        value = apply("Mul", value, constant("gain", mlp.gain))
    nodes[-1].output[0] = "output"

    def shaped(label: str, *shape):
        return helper.make_tensor_value_info(label, TensorProto.FLOAT, shape)

    inputs = [shaped("input", "N", mlp.width_in)]
    if first_bias != "stored":
        inputs.append(shaped("bias", "biases", len(mlp.biases[0])))
    if first_bias == "input and rows":
        inputs.append(shaped("rows", "N", len(mlp.biases[0])))
    graph = helper.make_graph(
        nodes, name, inputs, [shaped("output", "N", mlp.width_out)], constants
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)])
    model.ir_version = IR_VERSION
    checker.check_model(model)
    return model.SerializeToString()
