"""What a network's file asks of the machine, known before onnxruntime is asked to open it."""

from pathlib import Path

from shapeshift.runtime_models.files.memory import Memory, amount
from shapeshift.runtime_models.model import BadFile
from shapeshift.training.gradients.fold_constants import fold_small, numbers
from shapeshift.training.gradients.onnx_graph import OnnxGraph
from shapeshift.training.gradients.read_network import MOST_NODES, SUBGRAPHS, parse_model

SIDE, CHANNELS = 256, 3  # of pictures whose sizes the file leaves open
NUMBER_BYTES = 8  # of the widest type
LARGEST_VALUE = 1 << 30  # bytes, of one value for such a picture
LARGEST_SUM = 16 << 30  # bytes, of all of them, most of which live one after the other


def check_network(data: bytes, path: Path) -> None:
    """Raises BadFile for a network that would take the memory of the machine.

    onnxruntime calculates what depends on no input while it opens a file: 200 bytes can ask for any
    number of them.  Here nothing is calculated that is not known to be small.
    """
    model = parse_model(data, path.name, Memory().of(path))
    opset = max((o.version for o in model.opset_import if o.domain in ("", "ai.onnx")), default=0)
    graph = OnnxGraph(path.name, opset, model.ir_version, list(model.graph.node))
    graph.constants = {tensor.name: tensor for tensor in model.graph.initializer}
    for node in graph.nodes:
        if node.op_type in SUBGRAPHS or len(graph.nodes) > MOST_NODES:
            raise BadFile(
                f"{path}: it has {len(graph.nodes):,} nodes, the operator {node.op_type!r} among "
                f"them; networks of at most {MOST_NODES:,} nodes without loops are read."
            )
    if any(tensor.external_data for tensor in graph.constants.values()):
        raise BadFile(f"{path} keeps its weights in another file; export it as one file.")
    for value in model.graph.input:
        if value.name not in graph.constants:
            tensor = value.type.tensor_type
            graph.inputs[value.name] = tensor.elem_type, usual_size(tensor.shape.dim)
    graph.shapes = {n: tuple(c.dims) for n, c in graph.constants.items()}
    graph.shapes |= {n: shape for n, (_, shape) in graph.inputs.items()}
    graph.outputs = [value.name for value in model.graph.output]
    fold_small(graph)
    taken = [NUMBER_BYTES * numbers(graph, name) for name in graph.shapes]
    if max(taken, default=0) > LARGEST_VALUE or sum(taken) > LARGEST_SUM:
        raise BadFile(
            f"{path}: for a picture of {SIDE}x{SIDE} pixels it asks for {amount(sum(taken))} of "
            f"memory, {amount(max(taken))} at once; a smaller network is wanted."
        )


def usual_size(dims) -> tuple[int, ...]:
    """The size of an input, what the file leaves open as of one usual picture, or one row."""
    known = [d.dim_value if d.HasField("dim_value") else 0 for d in dims]
    if len(known) != 4:
        return tuple(size or 1 for size in known)
    pixels = known[3] == CHANNELS
    usual = (1, SIDE, SIDE, CHANNELS) if pixels else (1, CHANNELS, SIDE, SIDE)
    return tuple(size or other for size, other in zip(known, usual, strict=True))
