"""Vector-Jacobian products of a network's layers (products, convolutions, pooling, norms) and of
what works number by number.

Weights are constants here: only what the picture is in has a gradient.
"""

import math
from collections.abc import Callable

import numpy as np

from shapeshift.training.gradients.onnx_graph import OnnxGraph
from shapeshift.training.gradients.vjp_step import Vjp, VjpStep

# What works number by number, with numpy's broadcasting.


def broadcast(step: VjpStep, *products: Callable[[], str]) -> dict[int, str]:
    """The products of the first inputs, each summed over what its input was broadcast along."""
    shape = step.output_shape
    return {
        i: step.graph.sum_to(product(), shape, step.shape(i))
        for i, product in enumerate(products)
        if i in step.wanted
    }


def unary(product: Callable[[OnnxGraph, str, str, str], str]) -> Vjp:
    """Of a function of one value: product(graph, gradient, input, output)."""

    def vjp(step: VjpStep) -> dict[int, str]:
        return {0: product(step.graph, step.gradient, step.inputs[0], step.output)}

    return vjp


def add(step: VjpStep) -> dict[int, str]:
    return broadcast(step, lambda: step.gradient, lambda: step.gradient)


def subtract(step: VjpStep) -> dict[int, str]:
    return broadcast(step, lambda: step.gradient, lambda: step.graph.add_node("Neg", step.gradient))


def multiply(step: VjpStep) -> dict[int, str]:
    left, right = step.inputs
    return broadcast(
        step,
        lambda: step.graph.add_node("Mul", step.gradient, right),
        lambda: step.graph.add_node("Mul", step.gradient, left),
    )


def divide(step: VjpStep) -> dict[int, str]:
    """d(a / b) = da / b - (a / b) db / b."""
    graph, below = step.graph, step.inputs[1]
    quotient = graph.add_node("Div", step.gradient, below)
    return broadcast(
        step,
        lambda: quotient,
        lambda: graph.add_node("Neg", graph.add_node("Mul", quotient, step.output)),
    )


def power(step: VjpStep) -> dict[int, str]:
    """d(a^n) = n a^(n-1) da, for a stored exponent."""
    graph, n = step.graph, step.stored(1).astype(np.float32)
    slope = graph.add_node("Pow", step.inputs[0], graph.add_constant(n - 1))
    slope = graph.add_node("Mul", graph.add_constant(n), slope)
    return broadcast(step, lambda: graph.add_node("Mul", step.gradient, slope))


def where(step: VjpStep) -> dict[int, str]:
    graph, condition = step.graph, step.inputs[0]
    zero = graph.add_constant(0.0)
    products = {
        1: lambda: graph.add_node("Where", condition, step.gradient, zero),
        2: lambda: graph.add_node("Where", condition, zero, step.gradient),
    }
    shape = step.output_shape
    return {
        i: graph.sum_to(product(), shape, step.shape(i))
        for i, product in products.items()
        if i in step.wanted
    }


def clip(step: VjpStep) -> dict[int, str]:
    """1 within the bounds, 0 beyond them."""
    graph, passed = step.graph, step.gradient
    for index, word, kind in ((1, "min", "Less"), (2, "max", "Greater")):
        bound = step.parameter(index, word)
        if bound is not None:
            outside = graph.add_node(kind, step.inputs[0], graph.add_constant(bound))
            passed = graph.add_node("Where", outside, graph.add_constant(0.0), passed)
    return {0: passed}


def leaky_relu(step: VjpStep) -> dict[int, str]:
    graph = step.graph
    slope = step.attributes.get("alpha", 0.01)
    positive = graph.add_node("Greater", step.inputs[0], graph.add_constant(0.0))
    lower = graph.scale(step.gradient, slope)
    return {0: graph.add_node("Where", positive, step.gradient, lower)}


def relu(graph: OnnxGraph, gradient: str, value: str, output: str) -> str:
    zero = graph.add_constant(0.0)
    positive = graph.add_node("Greater", output, zero)
    return graph.add_node("Where", positive, gradient, zero)


def square_root(graph: OnnxGraph, gradient: str, value: str, output: str) -> str:
    return graph.add_node("Div", graph.scale(gradient, 0.5), output)


def reciprocal(graph: OnnxGraph, gradient: str, value: str, output: str) -> str:
    slope = graph.add_node("Neg", graph.add_node("Mul", output, output))
    return graph.add_node("Mul", gradient, slope)


def sigmoid(graph: OnnxGraph, gradient: str, value: str, output: str) -> str:
    """y (1 - y)."""
    rest = graph.add_node("Sub", graph.add_constant(1.0), output)
    return graph.add_node("Mul", gradient, graph.add_node("Mul", output, rest))


def tanh(graph: OnnxGraph, gradient: str, value: str, output: str) -> str:
    """1 - y^2."""
    square = graph.add_node("Mul", output, output)
    slope = graph.add_node("Sub", graph.add_constant(1.0), square)
    return graph.add_node("Mul", gradient, slope)


def error_function(graph: OnnxGraph, gradient: str, value: str, output: str) -> str:
    """2 / sqrt(pi) exp(-x^2)."""
    bell = graph.add_node("Exp", graph.add_node("Neg", graph.add_node("Mul", value, value)))
    return graph.add_node("Mul", gradient, graph.scale(bell, 2 / math.sqrt(math.pi)))


def gelu(step: VjpStep) -> dict[int, str]:
    """x Phi(x): Phi(x) + x phi(x), of the normal distribution and its density."""
    if step.text("approximate", "none") != "none":
        raise step.refusal("in its approximation by tanh")
    graph, value = step.graph, step.inputs[0]
    bent = graph.add_node("Erf", graph.scale(value, 1 / math.sqrt(2)))
    share = graph.scale(graph.add_node("Add", bent, graph.add_constant(1.0)), 0.5)
    bell = graph.add_node("Exp", graph.scale(graph.add_node("Mul", value, value), -0.5))
    slope = graph.scale(graph.add_node("Mul", value, bell), 1 / math.sqrt(2 * math.pi))
    slope = graph.add_node("Add", share, slope)
    return {0: graph.add_node("Mul", step.gradient, slope)}


def same(step: VjpStep) -> dict[int, str]:
    return {0: step.gradient}


ELEMENTWISE: dict[str, Vjp] = {
    "Abs": unary(lambda g, d, x, y: g.add_node("Mul", d, g.add_node("Sign", x))),
    "Add": add,
    "Cast": same,  # what is not from float32 to float32 does not come here
    "Clip": clip,
    "Div": divide,
    "Dropout": same,  # a trained network drops nothing
    "Erf": unary(error_function),
    "Exp": unary(lambda g, d, x, y: g.add_node("Mul", d, y)),
    "Gelu": gelu,
    "Identity": same,
    "LeakyRelu": leaky_relu,
    "Log": unary(lambda g, d, x, y: g.add_node("Div", d, x)),
    "Mul": multiply,
    "Neg": unary(lambda g, d, x, y: g.add_node("Neg", d)),
    "Pow": power,
    "Reciprocal": unary(reciprocal),
    "Relu": unary(relu),
    "Sigmoid": unary(sigmoid),
    "Sqrt": unary(square_root),
    "Sub": subtract,
    "Tanh": unary(tanh),
    "Where": where,
}


def matmul(step: VjpStep) -> dict[int, str]:
    """Of matrices, stacked or not: dA = G B^T, dB = A^T G."""
    graph, (left, right) = step.graph, step.inputs
    if len(step.shape(0)) < 2 or len(step.shape(1)) < 2:
        raise step.refusal("of vectors")
    stack, found = step.output_shape[:-2], {}
    if 0 in step.wanted:
        turned = graph.transpose_last(right, len(step.shape(1)))
        value = graph.add_node("MatMul", step.gradient, turned)
        found[0] = graph.sum_to(value, (*stack, *step.shape(0)[-2:]), step.shape(0))
    if 1 in step.wanted:
        turned = graph.transpose_last(left, len(step.shape(0)))
        value = graph.add_node("MatMul", turned, step.gradient)
        found[1] = graph.sum_to(value, (*stack, *step.shape(1)[-2:]), step.shape(1))
    return found


def gemm(step: VjpStep) -> dict[int, str]:
    """alpha A B + beta C, by A alone."""
    if step.attributes.get("transA") or step.wanted != {0}:
        raise step.refusal("of anything but values times stored weights")
    turned = 0 if step.attributes.get("transB") else 1
    alpha = step.attributes.get("alpha", 1.0)
    value = step.graph.add_node("Gemm", step.gradient, step.inputs[1], alpha=alpha, transB=turned)
    return {0: value}


def windows(step: VjpStep, kernel: list[int]) -> tuple[list[int], list[int], list[int]]:
    """Strides, pads (before, then after) and dilations of a convolution or a pooling."""
    axes = len(kernel)
    strides = list(step.attributes.get("strides") or [1] * axes)
    dilations = list(step.attributes.get("dilations") or [1] * axes)
    how = step.text("auto_pad", "NOTSET")
    if how not in ("SAME_UPPER", "SAME_LOWER"):
        given = step.attributes.get("pads") if how == "NOTSET" else None
        return strides, list(given or [0] * 2 * axes), dilations
    before, after = [], []
    sizes = zip(step.shape()[2:], step.output_shape[2:], kernel, strides, dilations, strict=True)
    for size, out, width, stride, dilation in sizes:
        total = max((out - 1) * stride + (width - 1) * dilation + 1 - size, 0)
        less, more = total // 2, total - total // 2
        before.append(less if how == "SAME_UPPER" else more)
        after.append(more if how == "SAME_UPPER" else less)
    return strides, before + after, dilations


def convolution(step: VjpStep) -> dict[int, str]:
    """By the picture: the convolution with the same weights, transposed."""
    if step.wanted != {0}:
        raise step.refusal("with weights that are calculated")
    kernel = list(step.attributes.get("kernel_shape") or step.shape(1)[2:])
    strides, pads, dilations = windows(step, kernel)
    group = step.attributes.get("group", 1)
    weights = step.graph.constant(step.inputs[1])
    plain = group == 1 and {*strides, *dilations} == {1} and weights is not None
    back = [kernel[i % len(kernel)] - 1 - p for i, p in enumerate(pads)]
    if plain and min(back) >= 0:
        # The same as a convolution with the weights turned: 1.5 times faster in onnxruntime.
        turned = np.flip(step.stored(1), tuple(range(2, 2 + len(kernel)))).swapaxes(0, 1)
        filters = step.graph.add_constant(np.ascontiguousarray(turned))
        value = step.graph.add_node("Conv", step.gradient, filters, kernel_shape=kernel, pads=back)
        return {0: value}
    value = transposed(step, step.gradient, step.inputs[1], kernel, group)
    return {0: value}


def transposed(step: VjpStep, value: str, weights: str, kernel: list[int], group: int) -> str:
    """The transposed convolution of a node's windows, back to the size of its input."""
    strides, pads, dilations = windows(step, kernel)
    axes, rest = len(kernel), []
    for i in range(axes):
        reach = (step.output_shape[2 + i] - 1) * strides[i] + dilations[i] * (kernel[i] - 1) + 1
        rest.append(step.shape()[2 + i] - (reach - pads[i] - pads[i + axes]))
    if max(rest) >= max(*strides, *dilations):  # what no window reaches, more than may be padded
        raise step.refusal("that leaves out a part of its picture")
    return step.graph.add_node(
        "ConvTranspose", value, weights, kernel_shape=kernel, strides=strides, pads=pads,
        dilations=dilations, output_padding=rest, group=group,
    )  # fmt: skip


def max_pool(step: VjpStep) -> dict[int, str]:
    """To the largest of each window, which the pooling tells: the first one where several are."""
    node, graph = step.node, step.graph
    gradient = step.gradient
    if step.attributes.get("storage_order"):
        raise step.refusal("in column-major order")
    if len(node.output) < 2:
        node.output.append(graph.new_name())  # the places
    kernel = list(step.attributes["kernel_shape"])
    strides, pads, dilations = windows(step, kernel)
    apart = all(s >= k for s, k in zip(strides, kernel, strict=True))
    if apart and not any(pads) and {*dilations} == {1}:
        size = graph.add_constant(step.shape(), np.int64)
        value = graph.add_node(
            "MaxUnpool", gradient, node.output[1], size, kernel_shape=kernel, strides=strides
        )
        return {0: value}
    if graph.opset < 16:
        raise step.refusal("with windows that overlap, before version 16 of ONNX's operators")
    zeros = graph.expand(graph.add_constant(np.zeros(1)), (math.prod(step.shape()),))
    flat, places = (graph.reshape(v, (-1,)) for v in (gradient, node.output[1]))
    summed = graph.add_node("ScatterElements", zeros, places, flat, axis=0, reduction="add")
    return {0: graph.reshape(summed, step.shape())}


def average_pool(step: VjpStep) -> dict[int, str]:
    """Each window's share to all that was in it."""
    kernel = list(step.attributes["kernel_shape"])
    strides, pads, dilations = windows(step, kernel)
    if step.attributes.get("ceil_mode"):
        raise step.refusal("in ceil_mode")
    counts = np.ones((), np.float32) * math.prod(kernel)
    if any(pads) and not step.attributes.get("count_include_pad"):
        counts = np.ones((), np.float32)
        for i, size in enumerate(step.shape()[2:]):
            first = np.arange(step.output_shape[2 + i]) * strides[i] - pads[i]  # of each window
            places = first[:, None] + dilations[i] * np.arange(kernel[i])
            inside = ((places >= 0) & (places < size)).sum(axis=1)
            counts = np.multiply.outer(counts, inside)
    shared = step.graph.add_node("Div", step.gradient, step.graph.add_constant(counts))
    channels = step.shape()[1]
    ones = step.graph.add_constant(np.ones((channels, 1, *kernel)))
    return {0: transposed(step, shared, ones, kernel, channels)}


def global_average_pool(step: VjpStep) -> dict[int, str]:
    spread = step.graph.expand(step.gradient, step.shape())
    return {0: step.graph.scale(spread, 1 / math.prod(step.shape()[2:]))}


def softmax(step: VjpStep) -> dict[int, str]:
    """y (g - sum(g y))."""
    rank, new = len(step.shape()), step.graph.opset >= 13
    axis = step.attributes.get("axis", -1 if new else 1) % rank
    axes = [axis] if new else list(range(axis, rank))  # older ones flatten what follows
    graph, output = step.graph, step.output
    product = graph.add_node("Mul", step.gradient, output)
    total = graph.add_node("Mul", output, graph.sum(product, axes))
    return {0: graph.add_node("Sub", product, total)}


def layer_normalization(step: VjpStep) -> dict[int, str]:
    """(g s - mean(g s) - u mean(g s u)) / deviation, u the normalised value, s the scale."""
    if step.wanted != {0}:
        raise step.refusal("with a scale that is calculated")
    graph, value, rank = step.graph, step.inputs[0], len(step.shape())
    axes = list(range(step.attributes.get("axis", -1) % rank, rank))
    count = math.prod(step.shape()[i] for i in axes)

    def mean(of: str) -> str:
        return graph.scale(graph.sum(of, axes), 1 / count)

    away = graph.add_node("Sub", value, mean(value))
    variance = mean(graph.add_node("Mul", away, away))
    epsilon = graph.add_constant(step.attributes.get("epsilon", 1e-5))
    deviation = graph.add_node("Sqrt", graph.add_node("Add", variance, epsilon))
    unit = graph.add_node("Div", away, deviation)
    gradient = graph.add_node("Mul", step.gradient, step.inputs[1])
    along = graph.add_node("Mul", unit, mean(graph.add_node("Mul", gradient, unit)))
    rest = graph.add_node("Sub", graph.add_node("Sub", gradient, mean(gradient)), along)
    return {0: graph.add_node("Div", rest, deviation)}


def batch_normalization(step: VjpStep) -> dict[int, str]:
    """With stored moments, as a trained network has it: scale / deviation of each channel."""
    if step.attributes.get("training_mode"):
        raise step.refusal("in training")
    slope = step.stored(1) / np.sqrt(step.stored(4) + step.attributes.get("epsilon", 1e-5))
    slope = slope.reshape(-1, *[1] * (len(step.shape()) - 2))
    return {0: step.graph.add_node("Mul", step.gradient, step.graph.add_constant(slope))}


LAYERS: dict[str, Vjp] = {
    "AveragePool": average_pool,
    "BatchNormalization": batch_normalization,
    "Conv": convolution,
    "Gemm": gemm,
    "GlobalAveragePool": global_average_pool,
    "LayerNormalization": layer_normalization,
    "MatMul": matmul,
    "MaxPool": max_pool,
    "Softmax": softmax,
}
