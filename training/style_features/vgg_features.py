"""VGG16 from an ONNX file: where its layers are, and what they give for a picture."""

from functools import lru_cache
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.memory import Memory
from shapeshift.runtime_models.model import BadFile
from shapeshift.training.evaluation.vgg_distance import MEAN_BGR
from shapeshift.training.gradients.onnx_graph import OnnxGraph
from shapeshift.training.gradients.read_network import parse_model, read_bytes, read_network
from shapeshift.training.gradients.reverse_mode import open_graph

BETWEEN = ("Conv", "Relu", "MaxPool", "Identity")  # a plain chain of them
LEAST_SIDE = 16  # pixels: two halvings leave four


class VggFeatures:
    """Some layers of one file, for pictures of any size."""

    def __init__(self, path: Path, layers: tuple[str, ...]) -> None:
        """layers: as relu3_1.  Raises BadFile where the file is no VGG16."""
        self.path = path
        self.input, self.names = vgg_layers(path, layers)
        self.sessions = lru_cache(2)(self._open)  # by (width, height)

    def __call__(self, picture: np.ndarray) -> dict[str, np.ndarray]:
        """(C, h, w) of every layer, of a picture (H, W, 3).  Raises BadFile for too small ones."""
        height, width = picture.shape[:2]
        if not min(width, height) >= LEAST_SIDE:
            raise BadFile(
                f"pictures of {width}x{height} pixels are too small for VGG16, which needs "
                f"{LEAST_SIDE} a side; make them larger."
            )
        session = self.sessions((width, height))
        values = session.run(list(self.names.values()), {self.input: as_input(picture)})
        return {layer: value[0] for layer, value in zip(self.names, values, strict=True)}

    def read(self, size: tuple[int, int]) -> OnnxGraph:
        """The graph up to these layers, for pictures of (width, height)."""
        sizes = {self.input: (1, 3, size[1], size[0])}
        return read_network(self.path, sizes, list(self.names.values()))

    def _open(self, size: tuple[int, int]):
        return open_graph(self.read(size))


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


def as_input(picture: np.ndarray) -> np.ndarray:
    """(1, 3, H, W) as VGG16 takes it, of (H, W, 3) display sRGB 0..1."""
    values = 255 * picture[..., ::-1] - MEAN_BGR
    return np.ascontiguousarray(values.transpose(2, 0, 1)[None], np.float32)
