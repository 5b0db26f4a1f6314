"""Reverse mode over ONNX: nodes that calculate the gradient of a loss by one of the inputs.

The gradient of an ONNX network is an ONNX network itself, so onnxruntime gives both in one run.
Every operator has its vector-Jacobian product in a table of vjp_rules.py; what is not there is
refused by name.  Only what lies between the input and the loss is differentiated; weights are
constants.
"""

import math
from collections.abc import Mapping

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.session import load_onnxruntime
from shapeshift.training.gradients.fold_constants import open_checked
from shapeshift.training.gradients.onnx_graph import OnnxGraph
from shapeshift.training.gradients.vjp_rules import ELEMENTWISE, LAYERS
from shapeshift.training.gradients.vjp_step import Vjp, VjpStep

# Vector-Jacobian products of what moves numbers about without changing them, and of sums.

MOST_PICKED = 10_000_000  # numbers of the matrix that says which row was picked


def reshape(step: VjpStep) -> dict[int, str]:
    return {0: step.graph.reshape(step.gradient, step.shape())}


def transpose(step: VjpStep) -> dict[int, str]:
    rank = len(step.shape())
    order = step.attributes.get("perm") or list(range(rank))[::-1]
    back = [int(i) for i in np.argsort(order)]
    return {0: step.graph.add_node("Transpose", step.gradient, perm=back)}


def expand(step: VjpStep) -> dict[int, str]:
    return {0: step.graph.sum_to(step.gradient, step.output_shape, step.shape())}


def concat(step: VjpStep) -> dict[int, str]:
    axis = step.attributes["axis"] % len(step.output_shape)
    found, start = {}, 0
    for i in range(len(step.inputs)):
        stop = start + step.shape(i)[axis]
        if i in step.wanted:
            found[i] = step.graph.slice(step.gradient, axis, start, stop)
        start = stop
    return found


def split(step: VjpStep) -> dict[int, str]:
    graph, parts = step.graph, []
    for output, gradient in zip(step.node.output, step.gradients, strict=True):
        parts.append(gradient or graph.add_constant(np.zeros(graph.shape(output))))
    axis = step.attributes.get("axis", 0)
    return {0: graph.add_node("Concat", *parts, axis=axis)}


def pad(step: VjpStep) -> dict[int, str]:
    """The part that the zeros (or another number) were put around."""
    if (mode := step.text("mode", "constant")) != "constant" or step.has(3):
        raise step.refusal(f"in the mode {mode!r}" if mode != "constant" else "along some axes")
    pads = step.numbers(1, "pads") or []
    if min(pads) < 0:
        raise step.refusal("that cuts off")
    value = step.gradient
    for axis, size in enumerate(step.shape()):
        if step.output_shape[axis] != size:
            value = step.graph.slice(value, axis, pads[axis], pads[axis] + size)
    return {0: value}


def gather(step: VjpStep) -> dict[int, str]:
    """Each picked row goes back to where it came from; what was picked twice is summed."""
    if 0 not in step.wanted:  # stored rows, picked by what the picture decides: no gradient
        return {}
    axis = step.attributes.get("axis", 0) % len(step.shape())
    rows = np.ravel(step.stored(1)) % step.shape()[axis]
    shape = list(step.shape())
    shape[axis] = len(rows)
    return {0: picked_back(step, step.graph.reshape(step.gradient, shape), axis, rows)}


def picked_back(step: VjpStep, value: str, axis: int, rows: np.ndarray) -> str:
    """`value`, along an axis the given rows of the input, in zeros of the input's shape."""
    graph, shape = step.graph, step.shape()
    if not len(rows):
        raise step.refusal("that picks nothing")
    if len(rows) == 1 or (np.diff(rows) == 1).all():
        before = [0] * len(shape)
        before[axis] = int(rows[0])
        after = [0] * len(shape)
        after[axis] = shape[axis] - int(rows[-1]) - 1
        return graph.add_node("Pad", value, graph.add_constant([*before, *after], np.int64))
    if len(rows) * shape[axis] > MOST_PICKED:
        raise step.refusal("of so many rows")
    matrix = np.zeros((shape[axis], len(rows)), np.float32)
    matrix[rows, np.arange(len(rows))] = 1
    flat = graph.reshape(value, (math.prod(shape[:axis]), len(rows), math.prod(shape[axis + 1 :])))
    return graph.reshape(graph.add_node("MatMul", graph.add_constant(matrix), flat), shape)


def slice_back(step: VjpStep) -> dict[int, str]:
    starts, stops = step.numbers(1, "starts") or [], step.numbers(2, "ends") or []
    axes = step.numbers(3, "axes") or list(range(len(starts)))
    steps = step.numbers(4, "steps") or [1] * len(starts)
    if len(axes) != 1:
        return {0: several_slices_back(step, starts, stops, axes, steps)}
    axis = axes[0] % len(step.shape())
    rows = np.arange(step.shape()[axis])[starts[0] : bound(stops[0], steps[0]) : steps[0]]
    return {0: picked_back(step, step.gradient, axis, rows)}


def several_slices_back(
    step: VjpStep, starts: list[int], stops: list[int], axes: list[int], steps: list[int]
) -> str:
    """A slice along several axes at once, each in steps of 1."""
    if any(s != 1 for s in steps):
        raise step.refusal("along several axes in steps other than 1")
    shape = step.shape()
    before, after = [0] * len(shape), [0] * len(shape)
    for axis, start, stop in zip(axes, starts, stops, strict=True):
        rows = range(shape[axis])[start:stop]
        if not rows:
            raise step.refusal("that picks nothing")
        before[axis], after[axis] = rows[0], shape[axis] - rows[-1] - 1
    graph = step.graph
    return graph.add_node("Pad", step.gradient, graph.add_constant([*before, *after], np.int64))


def bound(stop: int, step: int) -> int | None:
    """An end as Python's slices have it: ONNX says a number below -size for `before the first`."""
    return None if step < 0 and stop < -(1 << 30) else stop


def reduced_axes(step: VjpStep) -> list[int]:
    """What a reduction goes over."""
    rank = len(step.shape())
    axes = step.numbers(1, "axes")
    if not axes:
        return [] if step.attributes.get("noop_with_empty_axes") else list(range(rank))
    return sorted(axis % rank for axis in axes)


def spread(step: VjpStep, value: str) -> str:
    """A value of a reduction's output, given to everything that was reduced."""
    axes = reduced_axes(step)
    kept = [1 if i in axes else n for i, n in enumerate(step.shape())]
    return step.graph.expand(step.graph.reshape(value, kept), step.shape())


def reduce_sum(step: VjpStep) -> dict[int, str]:
    return {0: spread(step, step.gradient)}


def reduce_mean(step: VjpStep) -> dict[int, str]:
    count = math.prod(step.shape()[i] for i in reduced_axes(step))
    return {0: step.graph.scale(spread(step, step.gradient), 1 / count)}


def reduce_l2(step: VjpStep) -> dict[int, str]:
    """x / |x|."""
    graph = step.graph
    slope = graph.add_node("Div", step.inputs[0], spread(step, step.output))
    return {0: graph.add_node("Mul", spread(step, step.gradient), slope)}


LAYOUT: dict[str, Vjp] = {
    "Concat": concat,
    "Expand": expand,
    "Flatten": reshape,
    "Gather": gather,
    "Pad": pad,
    "ReduceL2": reduce_l2,
    "ReduceMean": reduce_mean,
    "ReduceSum": reduce_sum,
    "Reshape": reshape,
    "Slice": slice_back,
    "Split": split,
    "Squeeze": reshape,
    "Transpose": transpose,
    "Unsqueeze": reshape,
}


PRODUCTS: dict[str, Vjp] = {**ELEMENTWISE, **LAYERS, **LAYOUT}
# Their outputs are whole numbers or yes and no: nothing flows back through them.
CONSTANT = (
    "And", "ArgMax", "ArgMin", "Constant", "ConstantOfShape", "Equal", "Greater", "GreaterOrEqual",
    "IsNaN", "Less", "LessOrEqual", "Not", "Or", "Range", "Shape", "Sign", "Size",
)  # fmt: skip
KNOWN = {*PRODUCTS, *CONSTANT}
OTHER_FLOATS = (10, 11, 16)  # of onnx.TensorProto.DataType: half, double, bfloat16


def add_gradient(graph: OnnxGraph, loss: str, by: str) -> str:
    """The name of a new value: the gradient of `loss`, one number, by the input `by`.

    Raises BadFile, naming it, for an operator on the way that has no gradient here.
    """
    graph.infer_shapes()
    between = nodes_between(graph, loss, by)
    live = {by, *(output for node in between for output in node.output)}
    gradients: dict[str, str] = {loss: graph.expand(graph.add_constant(1.0), graph.shape(loss))}
    for node in reversed(between):
        if not any(output in gradients for output in node.output):
            continue
        for index, value in products_of(graph, node, gradients, live).items():
            name = node.input[index]
            known = gradients.get(name)
            gradients[name] = graph.add_node("Add", known, value) if known else value
    if by not in gradients:
        raise BadFile(f"{graph.name}: nothing that has a gradient leads from {by!r} to the loss.")
    return gradients[by]


def products_of(
    graph: OnnxGraph, node, gradients: dict[str, str], live: set[str]
) -> dict[int, str]:
    """The gradients of a node's inputs that depend on the picture, by their numbers."""
    wanted = frozenset(
        i for i, name in enumerate(node.input) if name in live and graph.is_float(name)
    )
    step = VjpStep(graph, node, [gradients.get(name) for name in node.output], wanted)
    depending = [name for name in node.input if name in live]
    if any(graph.types.get(name) in OTHER_FLOATS for name in [*depending, *node.output]):
        raise step.refusal("between floats other than float32")
    if node.op_type in CONSTANT or not wanted or not graph.is_float(node.output[0]):
        return {}
    return PRODUCTS[node.op_type](step)


def nodes_between(graph: OnnxGraph, loss: str, by: str) -> list:
    """The nodes that depend on `by` and that the loss depends on.  Raises BadFile."""
    live = {by}
    for node in graph.nodes:
        if live & set(node.input):
            live |= set(node.output)
    if loss not in live:
        raise BadFile(f"{graph.name}: {loss!r} does not depend on the input {by!r}.")
    needed, found = {loss}, []
    for node in reversed(graph.nodes):
        if needed & set(node.output) and live & set(node.input):
            needed |= set(node.input)
            found.append(node)
    return found[::-1]


# Loss and gradient of an ONNX network in one run of onnxruntime.


class GradientSession:
    """Runs a graph whose last nodes calculate losses, and their gradient by one input."""

    def __init__(
        self, graph: OnnxGraph, losses: Mapping[str, tuple[str, float]], by: str, threads: int = 0
    ) -> None:
        """losses: of each its value in the graph, one number, and its weight in the sum.

        threads: 0 for one a core; they sleep between the runs.  Raises BadFile.
        """
        self.by, self.losses = by, tuple(losses)
        values = [name for name, _ in losses.values()]
        total = ""
        for name, weight in losses.values():
            part = graph.scale(name, weight)
            total = graph.add_node("Add", total, part) if total else part
        gradient = add_gradient(graph, total, by)
        graph.outputs = [*values, gradient]
        graph.keep_only(graph.outputs)
        self.outputs = list(graph.outputs)
        self.session = open_graph(graph, threads)

    def __call__(self, given: Mapping[str, np.ndarray]) -> tuple[dict[str, float], np.ndarray]:
        """The losses by their names, unweighted, and the gradient of the weighted sum."""
        *losses, gradient = self.session.run(self.outputs, dict(given))
        found = {n: float(np.ravel(v)[0]) for n, v in zip(self.losses, losses, strict=True)}
        return found, gradient


def open_graph(graph: OnnxGraph, threads: int = 0):
    """A session of a graph.  threads: 0 for one a core; they sleep between the runs."""
    options = load_onnxruntime().SessionOptions()
    options.log_severity_level, options.intra_op_num_threads = 3, threads
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    return open_checked(graph.model().SerializeToString(), graph.name, options)
