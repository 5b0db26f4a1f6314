"""What a network calculates from stored numbers alone, calculated once, before anything large is.

Exporters leave the arithmetic of shapes in a graph.  It is folded node by node, where the result
is known beforehand to be small, until the shape of every value is known; so what a file asks for is
known before onnxruntime, which folds the rest, asks the machine for it.
"""

from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.whole_file import temporary_folder
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.session import load_onnxruntime
from shapeshift.training.gradients.onnx_graph import SMALL, OnnxGraph

MOST_ROUNDS = 50  # of folding; the arithmetic of exporters takes some five
OF_SHAPES = ("Shape", "Size")


def fold_small(graph: OnnxGraph) -> None:
    """Folds until the shape of every value is known.  Raises BadFile where one stays unknown."""
    for _ in range(MOST_ROUNDS):
        graph.infer_shapes()
        kept = [node for node in graph.nodes if not fold_node(graph, node)]
        done = len(kept) == len(graph.nodes)
        graph.nodes = kept
        if done:
            break
    for node in graph.nodes:
        for name in filter(None, node.output):
            graph.shape(name)


def fold_node(graph: OnnxGraph, node) -> bool:
    """Makes a node's outputs constants, where its inputs are and all are small; whether it did."""
    names = [name for name in node.output if name]
    if node.op_type in OF_SHAPES and node.input[0] in graph.shapes and not node.attribute:
        shape = np.array(graph.shapes[node.input[0]], np.int64)
        store(graph, names[0], shape if node.op_type == "Shape" else shape.prod())
        return names[0] not in graph.outputs
    given = [name for name in node.input if name]
    small = all(n in graph.constants and numbers(graph, n) <= SMALL for n in given)
    known = all(n in graph.shapes and numbers(graph, n) <= SMALL for n in names)
    if not (small and known) or set(names) & set(graph.outputs):
        return False
    one = OnnxGraph(graph.name, graph.opset, graph.ir_version, [node], outputs=names)
    one.constants = {name: graph.constants[name] for name in given}
    session = open_checked(one.model().SerializeToString(), graph.name, quiet_options())
    for name, value in zip(names, run_checked(session, names, {}, graph.name), strict=True):
        store(graph, name, value)
    return True


def store(graph: OnnxGraph, name: str, value: np.ndarray) -> None:
    """A value of the graph as a constant."""
    from onnx import numpy_helper

    graph.constants[name] = numpy_helper.from_array(np.asarray(value), name)
    graph.shapes[name], graph.types[name] = np.shape(value), graph.constants[name].data_type


def numbers(graph: OnnxGraph, name: str) -> int:
    """How many a value has."""
    return int(np.prod(graph.shapes[name], dtype=object))


def optimized(graph: OnnxGraph):
    """The onnx.ModelProto that onnxruntime makes of a graph: folded, with norms as one operator."""
    import onnx

    options = quiet_options()
    levels = load_onnxruntime().GraphOptimizationLevel
    options.graph_optimization_level = levels.ORT_ENABLE_BASIC
    with temporary_folder() as folder:
        path = Path(folder) / "folded.onnx"
        options.optimized_model_filepath = str(path)
        open_checked(graph.model().SerializeToString(), graph.name, options)
        return onnx.load(path)


def quiet_options():
    """For a session that runs once."""
    options = load_onnxruntime().SessionOptions()
    options.log_severity_level, options.intra_op_num_threads = 3, 1
    return options


def open_checked(data: bytes, name: str, options):
    """An onnxruntime session.  Raises BadFile, in its words, where the network does not open."""
    onnxruntime = load_onnxruntime()
    errors = onnxruntime.capi.onnxruntime_pybind11_state
    try:
        return onnxruntime.InferenceSession(
            data, options, providers=["CPUExecutionProvider"], enable_fallback=0
        )
    except (
        errors.Fail, errors.InvalidArgument, errors.InvalidGraph, errors.InvalidProtobuf,
        errors.NotImplemented, errors.RuntimeException, UnicodeDecodeError,
    ) as error:  # fmt: skip
        raise BadFile(f"{name} is not a network that onnxruntime can open: {error}.") from None


def run_checked(session, outputs: list[str], given: dict[str, np.ndarray], name: str) -> list:
    """What a session gives.  Raises BadFile where the network refuses what it is given."""
    errors = load_onnxruntime().capi.onnxruntime_pybind11_state
    try:
        return session.run(outputs, given)
    except (errors.Fail, errors.InvalidArgument, errors.RuntimeException) as error:
        raise BadFile(f"{name} does not run: {error}.") from None
