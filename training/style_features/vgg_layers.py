"""Where the layers of VGG16 are in an ONNX file, whatever its values are called."""

from pathlib import Path

from shapeshift.runtime_models.files.memory import Memory
from shapeshift.runtime_models.model import BadFile
from shapeshift.training.gradients.read_network import parse_model, read_bytes

BETWEEN = ("Conv", "Relu", "MaxPool", "Identity")  # a plain chain of them


def vgg_layers(path: Path, wanted: tuple[str, ...]) -> tuple[str, dict[str, str]]:
    """The network's input, and the names of its values `relu1_1`, `relu1_2`, ... that are wanted.

    They are found by their order: layer b_i is the i-th ReLU of the b-th block between poolings.
    Raises BadFile where the file is no such network.
    """
    model = parse_model(read_bytes(path), path.name, Memory().of(path))
    constants = {tensor.name for tensor in model.graph.initializer}
    inputs = [value.name for value in model.graph.input if value.name not in constants]
    if len(inputs) != 1:
        raise BadFile(f"{path} has {len(inputs)} inputs; VGG16 takes one picture.")
    found, block, count, value = {}, 1, 0, inputs[0]
    for node in model.graph.node:
        if value not in node.input:
            continue
        if node.op_type not in BETWEEN:
            break  # the layers that classify
        value = node.output[0]
        if node.op_type == "MaxPool":
            block, count = block + 1, 0
        if node.op_type == "Relu":
            count += 1
            found[f"relu{block}_{count}"] = value
    if missing := [name for name in wanted if name not in found]:
        raise BadFile(
            f"{path} has the layers {', '.join(found) or 'of no VGG'}; {', '.join(missing)} of "
            "VGG16 is wanted."
        )
    return inputs[0], {name: found[name] for name in wanted}
