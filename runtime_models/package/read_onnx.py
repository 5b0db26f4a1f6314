"""An ONNX file to a network: layers of Gemm (or MatMul and Add) with Relu between, then a head."""

from collections.abc import Iterator

import numpy as np

from shapeshift.runtime_models.files.memory import Account, unlimited
from shapeshift.runtime_models.model import BadFile, Mlp

HEADS = {"Tanh": "tanh", "Sigmoid": "sigmoid", "Softplus": "softplus", "Exp": "exp"}
LAYER = {"Gemm", "MatMul", "Add"}
AFTER = {  # which nodes a node may follow; "" is the graph's input
    "Gemm": {"", "Relu"},
    "MatMul": {"", "Relu"},
    "Add": {"Gemm", "MatMul"},
    "Relu": LAYER,
    "Clip": LAYER,
    **{kind: {*LAYER, "Clip"} for kind in HEADS},
    "Mul": {*LAYER, "Clip", *HEADS},
}
UNDERSTOOD = (
    "a network is Gemm (or MatMul and Add) with Relu between, then, where wanted, "
    "Clip, one of Tanh, Sigmoid, Softplus, Exp, and Mul by one number"
)
COPIES = 4  # of a layer's numbers while they are read
MESSAGE = 160  # bytes of memory a byte that is no number: of the smallest messages
MOST_FIELDS = 100_000  # that are looked at; a network has some hundred
WORTH_A_LOOK = 64  # bytes of a message that may hold numbers
INSIDE = {  # (message, number of a field of it): what is in there, by onnx.proto
    ("model", 7): "graph", ("graph", 1): "node", ("graph", 5): "tensor", ("node", 5): "attribute",
    ("attribute", 5): "tensor", ("attribute", 7): "numbers", ("tensor", 4): "numbers",
    ("tensor", 9): "numbers",
}  # fmt: skip
LARGEST = float(np.finfo(np.float32).max)  # a bound that a Clip leaves out


def read_onnx(
    data: bytes, name: str, inputs: tuple[str, ...], memory: Account | None = None
) -> Mlp:
    """The network in `data`; `name` is for messages, `inputs` the order of what is concatenated.

    Raises BadFile where the file is not ONNX or is not a plain chain of known nodes.
    """
    import onnx
    from google.protobuf.message import DecodeError

    memory = memory or unlimited()
    payload = payload_of(data)
    memory.charge(COPIES * payload + MESSAGE * (len(data) - payload), f"the network {name}")
    try:
        graph = onnx.load_model_from_string(data).graph
    except DecodeError:
        raise BadFile(f"{name} is not a readable ONNX file; export it again.") from None
    constants = {tensor.name: read_tensor(tensor, name) for tensor in graph.initializer}
    given = [value.name for value in graph.input if value.name not in constants]
    if len(given) != 1 or len(graph.output) != 1:
        raise BadFile(
            f"{name} has {len(given)} inputs and {len(graph.output)} outputs, expected one of "
            "each; export a network of the concatenated inputs."
        )
    chain = _Chain(name, constants, given[0], memory)
    with np.errstate(over="ignore", invalid="ignore"):  # finish() refuses what is not finite
        for node in graph.node:
            chain.add(node)
    return chain.finish(graph.output[0].name, inputs)


def read_tensor(tensor, name: str) -> np.ndarray:
    """A stored tensor, as float32 where it holds floats."""
    from onnx import numpy_helper

    if tensor.external_data:
        raise BadFile(f"{name} keeps its weights in another file; export it as one file.")
    try:
        array = numpy_helper.to_array(tensor)
    except (ValueError, TypeError, KeyError):
        raise BadFile(f"{name}: tensor {tensor.name!r} is damaged; export it again.") from None
    return array.astype(np.float32) if array.dtype.kind == "f" else array


def payload_of(data: bytes) -> int:
    """Bytes of the numbers of a graph's tensors, which stay what they are in memory.

    All else in a protobuf message, an empty node of two bytes, becomes an object.
    """
    payload, fields, waiting = 0, 0, [("model", 0, len(data))]
    while waiting:
        kind, at, end = waiting.pop()
        for field, start, stop in fields_of(data, at, end):
            fields += 1
            if fields > MOST_FIELDS:
                return payload  # what comes then counts as messages: no network is like that
            inner = INSIDE.get((kind, field))
            if inner == "numbers":
                payload += stop - start
            elif inner and stop - start >= WORTH_A_LOOK:
                waiting.append((inner, start, stop))
    return payload


def fields_of(data: bytes, at: int, end: int) -> Iterator[tuple[int, int, int]]:
    """(number, first byte, end) of the fields with a length in a message, up to what is broken."""
    while at < end:
        key, at = varint(data, at, end)
        wire = key & 7
        if wire == 0:
            _, at = varint(data, at, end)
        elif wire == 2:
            length, at = varint(data, at, end)
            if length > end - at:
                return
            yield key >> 3, at, at + length
            at += length
        elif wire in (1, 5):
            at += 8 if wire == 1 else 4
        else:
            return


def varint(data: bytes, at: int, end: int) -> tuple[int, int]:
    """A number of protobuf and where it ends; `end` where it is broken."""
    number, shift = 0, 0
    while at < end and shift < 64:
        number |= (data[at] & 127) << shift
        at, shift = at + 1, shift + 7
        if data[at - 1] < 128:
            return number, at
    return 0, end


class _Chain:
    """Collects layers, then the head, along the one value that flows from input to output."""

    def __init__(
        self, name: str, constants: dict[str, np.ndarray], value: str, memory: Account
    ) -> None:
        self.name, self.constants, self.memory = name, constants, memory
        self.value = value  # what the node before gives
        self.before = ""  # the kind of that node
        self.weights: list[np.ndarray] = []  # (out, in) each
        self.biases: list[np.ndarray] = []  # (out,) each
        self.head, self.gain = "none", 1.0
        self.clip: tuple[float, float] | None = None

    def add(self, node) -> None:
        """The next node of the file.  Raises BadFile, naming it, where it does not belong."""
        if not node.output:
            raise BadFile(f"{self.name}: a node {node.op_type!r} gives nothing; export it again.")
        kind = node.op_type if node.domain in ("", "ai.onnx") else f"{node.domain}.{node.op_type}"
        label = f"{self.name}: node {kind!r} at {node.name or node.output[0]!r}"
        if kind == "Constant":
            self.constants[node.output[0]] = self._read_constant(node, label)
            return
        taken = list(node.input)
        if kind == "Identity" and taken and taken[0] in self.constants:
            self.constants[node.output[0]] = self.constants[taken[0]]
            return
        if kind != "Identity" and kind not in AFTER:
            raise BadFile(f"{label} is not understood; {UNDERSTOOD}.")
        if taken.count(self.value) != 1:
            raise BadFile(f"{label} does not take what the node before it gives; {UNDERSTOOD}.")
        if kind != "Identity":
            if self.before not in AFTER[kind]:
                where = f"after {self.before}" if self.before else "first"
                raise BadFile(f"{label} is not understood {where}; {UNDERSTOOD}.")
            self._apply(kind, node, label)
            self.before = kind
        self.value = node.output[0]

    def _apply(self, kind: str, node, label: str) -> None:
        attributes = {a.name: a.f if a.type == a.FLOAT else a.i for a in node.attribute}
        if kind in ("Gemm", "MatMul"):
            self._add_layer(node, attributes, label)
        elif kind == "Add":
            self.biases[-1] = self.biases[-1] + self._row(self._other(node, label), label)
        elif kind == "Clip":
            low, high = (
                self._scalar(self._constant(node, i, label), label)
                if i < len(node.input) and node.input[i]
                else float(attributes.get(word, default))  # attributes before opset 11
                for i, word, default in ((1, "min", -LARGEST), (2, "max", LARGEST))
            )
            if not low < high:
                raise BadFile(
                    f"{label} clips to {(low, high)}, expected a lower and a higher bound."
                )
            self.clip = low, high
        elif kind == "Mul":
            self.gain = self._scalar(self._other(node, label), label)
        elif kind in HEADS:
            self.head = HEADS[kind]

    def _add_layer(self, node, attributes: dict, label: str) -> None:
        weight = self._constant(node, 1, label)
        if weight.ndim != 2 or attributes.get("transA", 0) or node.input[0] != self.value:
            raise BadFile(f"{label} is not a plain layer: input times a stored matrix.")
        weight = weight if attributes.get("transB", 0) else weight.T
        if self.weights and weight.shape[1] != len(self.weights[-1]):
            raise BadFile(
                f"{label} takes {weight.shape[1]} values, the layer before gives "
                f"{len(self.weights[-1])}; export it again."
            )
        self.memory.charge(COPIES * weight.nbytes, f"a layer of {self.name}")
        self.weights.append(weight * np.float32(attributes.get("alpha", 1.0)))
        self.biases.append(np.zeros(len(weight), np.float32))
        if node.op_type == "Gemm" and len(node.input) > 2 and node.input[2]:
            bias = self._row(self._constant(node, 2, label), label)
            self.biases[-1] = bias * np.float32(attributes.get("beta", 1.0))

    def _read_constant(self, node, label: str) -> np.ndarray:
        for attribute in node.attribute:
            if attribute.name == "value":
                return read_tensor(attribute.t, self.name)
            if attribute.name == "value_float":
                return np.asarray(attribute.f, np.float32)
            if attribute.name == "value_floats":
                return np.array(attribute.floats, np.float32)
        raise BadFile(f"{label} holds no plain numbers; export it again.")

    def _constant(self, node, index: int, label: str) -> np.ndarray:
        key = node.input[index] if index < len(node.input) else ""
        array = self.constants.get(key)
        if array is None or array.dtype != np.float32:
            raise BadFile(f"{label} needs {key!r} as stored floats; export it again.")
        return array

    def _other(self, node, label: str) -> np.ndarray:
        """The stored partner of the value in a node of two inputs, in either order."""
        return self._constant(node, int(node.input[0] == self.value), label)

    def _row(self, array: np.ndarray, label: str) -> np.ndarray:
        """(out,): what is added to every row."""
        width = len(self.weights[-1])
        if array.size not in (1, width) or array.shape[-1:] not in ((), (1,), (width,)):
            raise BadFile(f"{label}: {array.size} biases for {width} outputs; export it again.")
        return np.broadcast_to(array.reshape(-1), (width,))

    def _scalar(self, array: np.ndarray, label: str) -> float:
        if array.size != 1 or np.isnan(array).any():
            raise BadFile(f"{label} needs one number, it has {array.size}; {UNDERSTOOD}.")
        return float(np.clip(array.item(), -LARGEST, LARGEST))

    def finish(self, output: str, inputs: tuple[str, ...]) -> Mlp:
        if not self.weights or self.before == "Relu" or self.value != output:
            raise BadFile(f"{self.name} does not end in a layer and its head; {UNDERSTOOD}.")
        for i, arrays in enumerate(zip(self.weights, self.biases, strict=True)):
            if not all(np.isfinite(a).all() for a in arrays):
                raise BadFile(f"{self.name}: layer {i} has weights that are NaN or Inf.")
        weights = tuple(np.ascontiguousarray(w) for w in self.weights)
        biases = tuple(np.ascontiguousarray(b) for b in self.biases)
        return Mlp(weights, biases, self.head, inputs, self.clip, self.gain)
