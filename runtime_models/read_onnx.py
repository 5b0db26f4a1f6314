"""An ONNX file to a network: layers of Gemm (or MatMul and Add) with Relu between, then a head."""

import numpy as np

from runtime_models.model import BadFile, Mlp

HEADS = {"Tanh": "tanh", "Sigmoid": "sigmoid", "Softplus": "softplus", "Exp": "exp"}
UNDERSTOOD = "Gemm, MatMul, Add, Relu, Clip, Tanh, Sigmoid, Softplus, Exp, Mul and Identity"


def read_onnx(data: bytes, name: str, inputs: tuple[str, ...]) -> Mlp:
    """The network in `data`; `name` is for messages, `inputs` the order of what is concatenated.

    Raises BadFile where the file is not ONNX or is not a plain chain of known nodes.
    """
    import onnx
    from google.protobuf.message import DecodeError
    from onnx import numpy_helper

    try:
        graph = onnx.load_model_from_string(data).graph
    except DecodeError:
        raise BadFile(f"{name} is not a readable ONNX file; export it again.") from None
    constants = {t.name: numpy_helper.to_array(t) for t in graph.initializer}
    for node in graph.node:
        if node.op_type == "Constant":
            constants[node.output[0]] = numpy_helper.to_array(node.attribute[0].t)
    chain = [n for n in graph.node if n.op_type not in ("Constant", "Identity")]
    return _Chain(name, constants).read(chain, inputs)


class _Chain:
    """Collects layers, then the head, in the order of the nodes."""

    def __init__(self, name: str, constants: dict[str, np.ndarray]) -> None:
        self.name, self.constants = name, constants
        self.weights: list[np.ndarray] = []  # (out, in) each
        self.biases: list[np.ndarray] = []
        self.head, self.clip, self.gain = "none", None, 1.0

    def read(self, chain: list, inputs: tuple[str, ...]) -> Mlp:
        relu_due = False  # between two layers there must be one Relu
        for node in chain:
            kind = node.op_type
            if kind in ("Gemm", "MatMul") and not relu_due and not self._has_head():
                self._layer(node)
                relu_due = True
            elif kind == "Relu" and relu_due:
                relu_due = False
            elif kind == "Add" and relu_due:
                self.biases[-1] = self.biases[-1] + self._constant(node).reshape(-1)
            elif kind == "Clip" and relu_due and not self._has_head():
                self.clip = tuple(self._given(node, i).item() for i in (1, 2))
            elif kind in HEADS and relu_due and self.head == "none":
                self.head = HEADS[kind]
            elif kind == "Mul" and relu_due and self._constant(node).size == 1:
                self.gain *= self._constant(node).item()
            else:
                raise BadFile(
                    f"{self.name}: a node {kind} stands where none is understood; "
                    f"wanted is a chain of {UNDERSTOOD}."
                )
        if not relu_due:
            raise BadFile(f"{self.name}: the last layer is missing.")
        self._check()
        weights = tuple(np.ascontiguousarray(w, np.float32) for w in self.weights)
        biases = tuple(np.ascontiguousarray(b, np.float32) for b in self.biases)
        return Mlp(weights, biases, self.head, inputs, self.clip, self.gain)

    def _has_head(self) -> bool:
        return self.head != "none" or self.clip is not None or self.gain != 1.0

    def _given(self, node, index: int) -> np.ndarray:
        label = node.input[index] if index < len(node.input) else ""
        if label not in self.constants:
            raise BadFile(f"{self.name}: a node {node.op_type} lacks the constant '{label}'.")
        return self.constants[label]

    def _constant(self, node) -> np.ndarray:
        return self._given(node, 0 if node.input[0] in self.constants else 1)

    def _layer(self, node) -> None:
        attributes = {a.name: a.f if a.type == 1 else a.i for a in node.attribute}
        weight = self._given(node, 1)
        if weight.ndim != 2 or attributes.get("transA", 0):
            raise BadFile(f"{self.name}: a node {node.op_type} is not a plain layer.")
        weight = weight if attributes.get("transB", 0) else weight.T
        bias = np.zeros(len(weight), np.float32)
        if node.op_type == "Gemm" and len(node.input) > 2:
            bias = self._given(node, 2).reshape(-1) * np.float32(attributes.get("beta", 1.0))
        self.weights.append(weight * np.float32(attributes.get("alpha", 1.0)))
        self.biases.append(bias)

    def _check(self) -> None:
        for i, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            if bias.shape != weight.shape[:1]:
                raise BadFile(
                    f"{self.name}: layer {i} has {len(weight)} outputs and {bias.size} biases."
                )
            if i and weight.shape[1] != len(self.weights[i - 1]):
                raise BadFile(
                    f"{self.name}: layer {i} takes {weight.shape[1]} values, "
                    f"the layer before gives {len(self.weights[i - 1])}."
                )
            if not (np.isfinite(weight).all() and np.isfinite(bias).all()):
                raise BadFile(f"{self.name}: layer {i} has weights that are NaN or Inf.")
