"""Made ONNX networks: of single operators, a small VGG, and a vision transformer."""

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

KINDS = {np.float32: TensorProto.FLOAT, np.float64: TensorProto.DOUBLE}


def model_of(nodes, inputs, outputs, constants, opset=17, kind=np.float32):
    """A model of (operator, inputs, outputs, attributes) rows; floats are of `kind`."""
    made = [helper.make_node(op, ins, outs, **more) for op, ins, outs, more in nodes]
    typed = {
        name: value.astype(kind) if (value := np.asarray(v)).dtype.kind == "f" else value
        for name, v in constants.items()
    }
    graph = helper.make_graph(
        made, "made",
        [helper.make_tensor_value_info(n, KINDS[kind], shape) for n, shape in inputs.items()],
        [helper.make_tensor_value_info(n, KINDS[kind], None) for n in outputs],
        [numpy_helper.from_array(v, n) for n, v in typed.items()],
    )  # fmt: skip
    opsets = [helper.make_opsetid("", opset)]
    return helper.make_model(graph, opset_imports=opsets, ir_version=8)


def write_model(path: Path, *rows, **more) -> Path:
    path.write_bytes(model_of(*rows, **more).SerializeToString())
    return path


def in_float64(path: Path, outputs: list[str]):
    """The network of a file in float64, with some of its values as outputs."""
    model = onnx.load(path)
    for tensor in model.graph.initializer:
        if tensor.data_type == TensorProto.FLOAT:
            wide = numpy_helper.to_array(tensor).astype(np.float64)
            tensor.CopyFrom(numpy_helper.from_array(wide, tensor.name))
    for value in model.graph.input:
        value.type.tensor_type.elem_type = TensorProto.DOUBLE
    del model.graph.output[:]
    for name in outputs:
        model.graph.output.append(helper.make_empty_tensor_value_info(name))
    return model


def tiny_vgg(path: Path, channels=(4, 6, 8), seed=0) -> Path:
    """VGG16's form with few channels: 2, 2 and 3 convolutions, 3x3, of blocks between poolings."""
    rng, nodes, constants, value, before = np.random.default_rng(seed), [], {}, "input", 3
    for block, (width, count) in enumerate(zip(channels, (2, 2, 3), strict=True), 1):
        for i in range(1, count + 1):
            name = f"{block}_{i}"
            shape = (width, before, 3, 3)
            constants[f"w{name}"] = rng.normal(size=shape) * np.sqrt(2 / (9 * before))
            constants[f"b{name}"] = 0.1 * rng.normal(size=width)
            pads = {"kernel_shape": [3, 3], "pads": [1, 1, 1, 1]}
            nodes.append(("Conv", [value, f"w{name}", f"b{name}"], [f"conv{name}"], pads))
            nodes.append(("Relu", [f"conv{name}"], [f"relu{name}"], {}))
            value, before = f"relu{name}", width
        if block < 3:
            pool = {"kernel_shape": [2, 2], "strides": [2, 2]}
            nodes.append(("MaxPool", [value], [f"pool{block}"], pool))
            value = f"pool{block}"
    outputs = ["relu1_2", "relu2_2", "relu3_3"]
    return write_model(path, nodes, {"input": ["n", 3, "h", "w"]}, outputs, constants, opset=13)


class _Nodes:
    """Rows of nodes and constants while a transformer is written."""

    def __init__(self, seed: int) -> None:
        self.rng, self.rows, self.constants = np.random.default_rng(seed), [], {}

    def add(self, op, *inputs, **attributes):
        name = f"v{len(self.rows)}"
        self.rows.append((op, list(inputs), [name], attributes))
        return name

    def keep(self, value):
        name = f"c{len(self.constants)}"
        self.constants[name] = np.asarray(value)
        return name

    def weights(self, *shape):
        size = self.rng.normal(size=shape) / np.sqrt(shape[-2] if len(shape) > 1 else 4)
        return self.keep(size)

    def norm(self, x, width, fused):
        scale = self.keep(1 + 0.2 * self.rng.normal(size=width))
        shift = self.keep(0.1 * self.rng.normal(size=width))
        if fused:
            return self.add("LayerNormalization", x, scale, shift, axis=-1, epsilon=1e-5)
        away = self.add("Sub", x, self.add("ReduceMean", x, axes=[-1], keepdims=1))
        square = self.add("Pow", away, self.keep(2.0))
        variance = self.add("ReduceMean", square, axes=[-1], keepdims=1)
        deviation = self.add("Sqrt", self.add("Add", variance, self.keep(1e-5)))
        return self.add("Add", self.add("Mul", self.add("Div", away, deviation), scale), shift)

    def block(self, x, width, heads, fused):
        """Attention, then two layers with QuickGELU between, each added to what came in."""
        depth, y, parts = width // heads, self.norm(x, width, fused), []
        for i in range(3):
            row = self.add("MatMul", y, self.weights(width, width))
            row = self.add("Add", row, self.weights(width))
            row = self.add("Reshape", row, self.keep(np.array([0, -1, heads, depth])))
            order = [0, 2, 3, 1] if i == 1 else [0, 2, 1, 3]
            parts.append(self.add("Transpose", row, perm=order))
        scores = self.add("Mul", self.add("MatMul", *parts[:2]), self.keep(depth**-0.5))
        mixed = self.add("MatMul", self.add("Softmax", scores, axis=-1), parts[2])
        mixed = self.add("Transpose", mixed, perm=[0, 2, 1, 3])
        mixed = self.add("Reshape", mixed, self.keep(np.array([0, -1, width])))
        x = self.add("Add", x, self.add("MatMul", mixed, self.weights(width, width)))
        y = self.add("MatMul", self.norm(x, width, fused), self.weights(width, 2 * width))
        gate = self.add("Sigmoid", self.add("Mul", y, self.keep(1.702)))
        y = self.add("Mul", y, gate)
        return self.add("Add", x, self.add("MatMul", y, self.weights(2 * width, width)))


def vision_transformer(
    path: Path, side=32, patch=8, width=24, heads=3, layers=2, out=16, fused=True, seed=0, opset=17
) -> Path:
    """A vision tower as exporters of CLIP write it, free in its batch, that knows nothing."""
    n, tokens = _Nodes(seed), (side // patch) ** 2 + 1
    filters = n.keep(n.rng.normal(size=(width, 3, patch, patch)) / patch)
    stride = {"kernel_shape": [patch] * 2, "strides": [patch] * 2}
    x = n.add("Conv", "pixel_values", filters, **stride)
    x = n.add("Reshape", x, n.keep(np.array([0, width, -1])))
    x = n.add("Transpose", x, perm=[0, 2, 1])
    # One class token a picture: its number is read off the shape of what came in.
    batch = n.add("Gather", n.add("Shape", "pixel_values"), n.keep(np.array([0])), axis=0)
    shape = n.add("Concat", batch, n.keep(np.array([1, width])), axis=0)
    token = n.add("Expand", n.weights(1, 1, width), shape)
    x = n.add("Concat", token, x, axis=1)
    x = n.norm(n.add("Add", x, n.weights(1, tokens, width)), width, fused)
    for _ in range(layers):
        x = n.block(x, width, heads, fused)
    x = n.norm(n.add("Gather", x, n.keep(np.array(0)), axis=1), width, fused)
    n.rows.append(("MatMul", [x, n.weights(width, out)], ["image_embeds"], {}))
    inputs = {"pixel_values": ["batch", 3, "height", "width"]}
    return write_model(path, n.rows, inputs, ["image_embeds"], n.constants, opset=opset)
