"""An ONNX graph that grows: its nodes, its constants, and the shape and type of every value."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from shapeshift.runtime_models.model import BadFile

FLOAT, INT64 = 1, 7  # of onnx.TensorProto.DataType
SMALL = 4096  # numbers of a constant that shape inference may look at
OWN = "gradient."  # every value that is added here begins so


@dataclass
class OnnxGraph:
    """One graph, for inputs of fixed sizes.  What is made by `read_network` has all shapes."""

    name: str  # of its file, for messages
    opset: int
    ir_version: int
    nodes: list = field(default_factory=list)  # NodeProto, each after what it takes
    constants: dict = field(default_factory=dict)  # name: TensorProto
    inputs: dict[str, tuple[int, tuple[int, ...]]] = field(default_factory=dict)  # type and shape
    outputs: list[str] = field(default_factory=list)
    shapes: dict[str, tuple[int, ...]] = field(default_factory=dict)
    types: dict[str, int] = field(default_factory=dict)  # onnx.TensorProto.DataType
    added: int = 0  # values that were given a name here

    def add_node(self, kind: str, *inputs: str, name: str = "", **attributes) -> str:
        """The name of the (first) value that a new node gives."""
        from onnx import helper

        output = name or self.new_name()
        self.nodes.append(helper.make_node(kind, list(inputs), [output], **attributes))
        return output

    def add_constant(self, value: object, kind: type = np.float32) -> str:
        """The name of a stored tensor; of float32 where no other type is asked for."""
        from onnx import numpy_helper

        array: np.ndarray = np.asarray(value, kind)
        name = self.new_name()
        self.constants[name] = numpy_helper.from_array(array, name)
        self.shapes[name] = array.shape
        self.types[name] = self.constants[name].data_type
        return name

    def add_input(self, name: str, shape: Sequence[int]) -> str:
        """A further input of float32; its name."""
        self.inputs[name] = FLOAT, tuple(shape)
        self.shapes[name], self.types[name] = tuple(shape), FLOAT
        return name

    def new_name(self) -> str:
        """A name that no value of the graph has."""
        self.added += 1
        return f"{OWN}{self.added}"

    def constant(self, name: str) -> np.ndarray | None:
        """The stored tensor of that name, None where the value is not stored."""
        from onnx import numpy_helper

        tensor = self.constants.get(name)
        return None if tensor is None else numpy_helper.to_array(tensor)

    def shape(self, name: str) -> tuple[int, ...]:
        """Of a value.  Raises BadFile where it is not known."""
        if name not in self.shapes:
            raise BadFile(
                f"{self.name}: the shape of {name!r} is not known beforehand; export the network "
                "with inputs of a fixed size."
            )
        return self.shapes[name]

    def is_float(self, name: str) -> bool:
        """Whether a value is float32; of one whose type is not known that is assumed."""
        return self.types.get(name, FLOAT) == FLOAT

    def reshape(self, value: str, shape: Sequence[int]) -> str:
        return self.add_node("Reshape", value, self.add_constant(shape, np.int64))

    def sum(self, value: str, axes: Sequence[int], keepdims: int = 1) -> str:
        """Over some axes, in the way of the graph's opset."""
        if self.opset < 13:
            return self.add_node("ReduceSum", value, axes=list(axes), keepdims=keepdims)
        where = self.add_constant(axes, np.int64)
        return self.add_node("ReduceSum", value, where, keepdims=keepdims)

    def scale(self, value: str, factor: float) -> str:
        """A value times a number."""
        return self.add_node("Mul", value, self.add_constant(factor))

    def expand(self, value: str, shape: Sequence[int]) -> str:
        """Broadcast."""
        return self.add_node("Expand", value, self.add_constant(shape, np.int64))

    def transpose_last(self, value: str, rank: int) -> str:
        """With its last two axes exchanged."""
        order = [*range(rank - 2), rank - 1, rank - 2]
        return self.add_node("Transpose", value, perm=order)

    def slice(self, value: str, axis: int, start: int, stop: int) -> str:
        """The part from start to stop along one axis."""
        bounds = (self.add_constant([number], np.int64) for number in (start, stop, axis))
        return self.add_node("Slice", value, *bounds)

    def sum_to(self, value: str, shape: Sequence[int], wanted: Sequence[int]) -> str:
        """A value of `shape` summed to the shape that was broadcast to it."""
        if tuple(shape) == tuple(wanted):
            return value
        lead = len(shape) - len(wanted)
        axes = [i for i, n in enumerate(shape) if i < lead or wanted[i - lead] == 1 != n]
        summed = self.sum(value, axes) if axes else value
        return self.reshape(summed, wanted)

    def infer_shapes(self) -> None:
        """Fills in shapes and types of what was added since.  Raises BadFile."""
        from onnx import shape_inference

        try:
            model = shape_inference.infer_shapes(self._light_model())
        except (shape_inference.InferenceError, ValueError) as error:
            raise BadFile(f"{self.name} is no network with shapes that fit: {error}.") from None
        for value in (*model.graph.value_info, *model.graph.output):
            tensor = value.type.tensor_type
            self.types[value.name] = tensor.elem_type
            sizes = [d.dim_value if d.HasField("dim_value") else -1 for d in tensor.shape.dim]
            if tensor.HasField("shape") and all(size >= 0 for size in sizes):
                self.shapes[value.name] = tuple(sizes)

    def _light_model(self):
        """The graph with its large constants as inputs: shape inference copies all that it gets."""
        from onnx import helper

        light = [c for c in self.constants.values() if np.prod(c.dims, initial=1) <= SMALL]
        heavy = {
            name: (c.data_type, tuple(c.dims))
            for name, c in self.constants.items()
            if np.prod(c.dims, initial=1) > SMALL
        }
        return self._assemble(light, {**self.inputs, **heavy}, helper)

    def model(self):
        """The onnx.ModelProto of all of it."""
        from onnx import helper

        return self._assemble(list(self.constants.values()), self.inputs, helper)

    def _assemble(self, constants: list, inputs: dict, helper):
        given = [helper.make_tensor_value_info(n, k, s) for n, (k, s) in inputs.items()]
        results = [helper.make_empty_tensor_value_info(n) for n in self.outputs]
        graph = helper.make_graph(self.nodes, "shapeshift", given, results, constants)
        opsets = [helper.make_opsetid("", self.opset)]
        return helper.make_model(graph, opset_imports=opsets, ir_version=self.ir_version)

    def keep_only(self, wanted: Sequence[str]) -> None:
        """Drops every node and constant that the wanted values do not need."""
        needed, kept = set(wanted), []
        for node in reversed(self.nodes):
            if needed & set(node.output):
                kept.append(node)
                needed |= set(node.input)
        self.nodes = kept[::-1]
        self.constants = {n: c for n, c in self.constants.items() if n in needed}
