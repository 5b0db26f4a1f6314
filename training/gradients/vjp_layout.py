"""Vector-Jacobian products of what moves numbers about without changing them, and of sums."""

import math

import numpy as np

from shapeshift.training.gradients.vjp_step import Vjp, VjpStep

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
