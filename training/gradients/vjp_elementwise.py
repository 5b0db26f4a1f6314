"""Vector-Jacobian products of what works number by number, with numpy's broadcasting."""

import math
from collections.abc import Callable

import numpy as np

from shapeshift.training.gradients.onnx_graph import OnnxGraph
from shapeshift.training.gradients.vjp_step import Vjp, VjpStep


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
