"""What a network's file asks of the machine, known before onnxruntime is asked to open it."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.memory import Account, Memory, amount
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.package.read_onnx import COPIES, MESSAGE, payload_of
from shapeshift.training.gradients.fold_constants import fold_small, numbers, optimized
from shapeshift.training.gradients.onnx_graph import FLOAT, OnnxGraph
from shapeshift.training.gradients.reverse_mode import KNOWN

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


# An ONNX network from a file, for inputs of fixed sizes: checked, pruned, its constants folded.

LARGEST_FILE = 1 << 30  # bytes: CLIP's largest vision tower has 1.2 GB, its usual ones 0.35
MOST_NODES = 20_000  # a vision transformer of 24 layers has some 2,000 before folding
LEAST_OPSET, MOST_OPSET = 11, 23
FLOAT_BYTES = 4
SUBGRAPHS = ("If", "Loop", "Scan", "SequenceMap")


def read_network(
    path: Path, sizes: Mapping[str, tuple[int, ...]], outputs: Sequence[str]
) -> OnnxGraph:
    """The part of a network that gives the named values, for inputs of these sizes.

    An output may be any value inside the network; every free dimension of an input is fixed by
    `sizes`.  What the activations take is charged to the file's memory budget, which the bytes of
    the inputs widen.  Raises BadFile in one sentence.
    """
    data = read_bytes(path)
    account = Memory().of(path)
    account.widen(sum(FLOAT_BYTES * int(np.prod(size)) for size in sizes.values()))
    model = parse_model(data, path.name, account)
    graph = graph_of(model, path.name, sizes)
    check_outputs(graph, outputs)
    graph.outputs = list(outputs)
    graph.keep_only(outputs)
    refuse_unusual_nodes(graph)
    fold_small(graph)
    graph.keep_only(outputs)
    charge_activations(graph, account)
    folded = fold_rest(graph)
    folded.infer_shapes()
    charge_activations(folded, account)
    return folded


def read_bytes(path: Path) -> bytes:
    """Of a file of a reasonable size.  Raises BadFile."""
    if not path.is_file():
        raise BadFile(f"{path} is no file; the name of an ONNX file is wanted.")
    if not 0 < (size := path.stat().st_size) <= LARGEST_FILE:
        raise BadFile(f"{path} has {size:,} bytes; ONNX files from 1 to {LARGEST_FILE:,} are read.")
    return path.read_bytes()


def parse_model(data: bytes, name: str, account: Account):
    """The onnx.ModelProto in some bytes, charged with what it takes.  Raises BadFile."""
    import onnx
    from google.protobuf.message import DecodeError

    payload = payload_of(data)
    account.charge(COPIES * payload + MESSAGE * (len(data) - payload), f"the network {name}")
    try:
        model = onnx.load_model_from_string(data)
    except DecodeError:
        raise BadFile(f"{name} is not a readable ONNX file; export it again.") from None
    if not model.graph.node:
        raise BadFile(f"{name} is not a readable ONNX file: it has no nodes; export it again.")
    return model


def graph_of(model, name: str, sizes: Mapping[str, tuple[int, ...]]) -> OnnxGraph:
    """A model's graph with its inputs at these sizes.  Raises BadFile."""
    opset = max((o.version for o in model.opset_import if o.domain in ("", "ai.onnx")), default=0)
    if not LEAST_OPSET <= opset <= MOST_OPSET:
        raise BadFile(
            f"{name} is written for version {opset} of ONNX's operators; {LEAST_OPSET} to "
            f"{MOST_OPSET} are read: export it again for version 17."
        )
    if len(model.graph.node) > MOST_NODES:
        raise BadFile(f"{name} has {len(model.graph.node):,} nodes; at most {MOST_NODES:,} fit.")
    constants = {tensor.name: tensor for tensor in model.graph.initializer}
    if any(tensor.external_data for tensor in constants.values()):
        raise BadFile(f"{name} keeps its weights in another file; export it as one file.")
    graph = OnnxGraph(name, opset, model.ir_version, list(model.graph.node), constants)
    for value in model.graph.input:
        if value.name not in constants:
            graph.inputs[value.name] = input_of(value, name, sizes)
    if missing := sizes.keys() - graph.inputs.keys():
        raise BadFile(f"{name} has the inputs {listed(graph.inputs)}; wanted is {listed(missing)}.")
    graph.shapes = {n: tuple(c.dims) for n, c in constants.items()}
    graph.shapes |= {n: shape for n, (_, shape) in graph.inputs.items()}
    graph.types = {n: c.data_type for n, c in constants.items()}
    graph.types |= {n: kind for n, (kind, _) in graph.inputs.items()}
    return graph


def input_of(value, name: str, sizes: Mapping[str, tuple[int, ...]]) -> tuple[int, tuple[int, ...]]:
    """Type and shape of one input, its free dimensions fixed.  Raises BadFile."""
    tensor = value.type.tensor_type
    if value.name not in sizes:
        raise BadFile(f"{name} has an input {value.name!r}, for which there is nothing to give.")
    size = sizes[value.name]
    if tensor.elem_type != FLOAT:
        raise BadFile(f"{name}: input {value.name!r} is no float32; export the network in float32.")
    fixed = [d.dim_value for d in tensor.shape.dim]
    known = tensor.HasField("shape")
    fits = len(fixed) == len(size) and all(a in (0, b) for a, b in zip(fixed, size, strict=True))
    if known and not fits:
        shown = " x ".join(str(n or "any") for n in fixed)
        asked = " x ".join(map(str, size))
        raise BadFile(f"{name}: input {value.name!r} is {shown}; {asked} is wanted.")
    return tensor.elem_type, size


def check_outputs(graph: OnnxGraph, outputs: Sequence[str]) -> None:
    """Raises BadFile where the network does not give what is wanted."""
    given = {name for node in graph.nodes for name in node.output}
    if missing := [name for name in outputs if name not in given]:
        last = [name for name in (graph.nodes[-1].output if graph.nodes else ())]
        raise BadFile(
            f"{graph.name} gives no {listed(missing)}; it ends in {listed(last)}: export it with "
            "outputs of these names."
        )


def refuse_unusual_nodes(graph: OnnxGraph) -> None:
    """Raises BadFile, naming the operator, for what cannot be opened or is no plain node."""
    for node in graph.nodes:
        kind = node.op_type if node.domain in ("", "ai.onnx") else f"{node.domain}.{node.op_type}"
        if kind in SUBGRAPHS or kind not in KNOWN:
            raise BadFile(
                f"{graph.name}: there is no gradient through the operator {kind!r} (at "
                f"{node.name or (node.output[0] if node.output else '')!r}); export the network "
                "in float32 and without fused operators, or use another one."
            )


def charge_activations(graph: OnnxGraph, account: Account) -> None:
    """What all values of the network take at once, so that none is asked for before."""
    bytes_of = [FLOAT_BYTES * int(np.prod(s, dtype=object)) for s in graph.shapes.values()]
    with account.lend(sum(bytes_of), f"the activations of {graph.name}"):
        pass


def fold_rest(graph: OnnxGraph) -> OnnxGraph:
    """The same graph as onnxruntime simplifies it."""
    sizes = {name: shape for name, (_, shape) in graph.inputs.items()}
    folded = graph_of(optimized(graph), graph.name, sizes)
    folded.opset, folded.ir_version = graph.opset, graph.ir_version
    folded.outputs = list(graph.outputs)
    folded.keep_only(folded.outputs)
    refuse_unusual_nodes(folded)
    return folded


def listed(names) -> str:
    """Some names for a message, the first few of them."""
    shown = [f"{name!r:.40}" for name in list(names)[:4]]
    return ", ".join(shown) + (", ..." if len(names) > 4 else "")
