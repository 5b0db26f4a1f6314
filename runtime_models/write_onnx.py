"""A network to the bytes of an ONNX file that runs alone in onnxruntime on (N, inputs)."""

import numpy as np
from onnx import TensorProto, checker, helper, numpy_helper

from runtime_models.model import Mlp

OPSET = 17
HEAD_NODE = {"tanh": "Tanh", "sigmoid": "Sigmoid", "softplus": "Softplus", "exp": "Exp"}


def write_onnx(mlp: Mlp, name: str) -> bytes:
    """Gemm, Relu, ..., Gemm, then Clip, the head and Mul where the network has them."""
    constants, nodes = [], []

    def constant(label: str, value: np.ndarray) -> str:
        constants.append(numpy_helper.from_array(np.asarray(value, np.float32, order="C"), label))
        return label

    def apply(kind: str, *inputs: str, **attributes) -> str:
        nodes.append(helper.make_node(kind, inputs, [f"{kind}{len(nodes)}"], **attributes))
        return nodes[-1].output[0]

    value = "input"
    for i, (weight, bias) in enumerate(zip(mlp.weights, mlp.biases, strict=True)):
        if i:
            value = apply("Relu", value)
        arrays = constant(f"weight{i}", weight), constant(f"bias{i}", bias)
        value = apply("Gemm", value, *arrays, transB=1)
    if mlp.clip is not None:
        bounds = [
            constant(n, np.float32(v)) for n, v in zip(("low", "high"), mlp.clip, strict=True)
        ]
        value = apply("Clip", value, *bounds)
    if mlp.head != "none":
        value = apply(HEAD_NODE[mlp.head], value)
    if mlp.gain != 1.0:
        value = apply("Mul", value, constant("gain", np.float32(mlp.gain)))
    nodes[-1].output[0] = "output"
    graph = helper.make_graph(
        nodes,
        name,
        [helper.make_tensor_value_info("input", TensorProto.FLOAT, ["N", mlp.width_in])],
        [helper.make_tensor_value_info("output", TensorProto.FLOAT, ["N", mlp.width_out])],
        constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)])
    model.ir_version = 8
    checker.check_model(model)
    return model.SerializeToString()
