"""Reverse mode over ONNX: nodes that calculate the gradient of a loss by one of the inputs.

The gradient of an ONNX network is an ONNX network itself, so onnxruntime gives both in one run.
Every operator has its vector-Jacobian product in one of the tables of vjp_*.py; what is not there
is refused by name.  Only what lies between the input and the loss is differentiated; weights are
constants.
"""

from shapeshift.runtime_models.model import BadFile
from shapeshift.training.gradients.onnx_graph import OnnxGraph
from shapeshift.training.gradients.vjp_elementwise import ELEMENTWISE
from shapeshift.training.gradients.vjp_layers import LAYERS
from shapeshift.training.gradients.vjp_layout import LAYOUT
from shapeshift.training.gradients.vjp_step import Vjp, VjpStep

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
