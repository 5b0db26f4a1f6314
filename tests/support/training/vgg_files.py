"""A small VGG network in a file."""

import numpy as np
import onnx
from onnx import helper, numpy_helper

from shapeshift.training.evaluation.vgg_distance import LAYERS


def write_small(path, outputs=LAYERS, inputs=("input",)):
    """A network of the file's form: four 1x1 layers of 5 channels, each of the one before."""
    weights, nodes, before = [], [], inputs[0]
    for i, name in enumerate(outputs):
        shape = (5, 3 if i == 0 else 5, 1, 1)
        weight = np.random.default_rng(i).normal(size=shape).astype(np.float32)
        weights.append(numpy_helper.from_array(weight, f"w{i}"))
        nodes.append(helper.make_node("Conv", [before, f"w{i}"], [f"c{i}"]))
        nodes.append(helper.make_node("Relu", [f"c{i}"], [name]))
        before = name
    kind = onnx.TensorProto.FLOAT
    shape = ["n", 3, "h", "w"]
    graph = helper.make_graph(
        nodes, "small", [helper.make_tensor_value_info(name, kind, shape) for name in inputs],
        [helper.make_tensor_value_info(name, kind, None) for name in outputs], weights,
    )  # fmt: skip
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    path.write_bytes(model.SerializeToString())
    return [numpy_helper.to_array(w)[..., 0, 0].astype(np.float64) for w in weights]
