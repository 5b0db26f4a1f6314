"""One node on the way from a loss back to a picture: what the vector-Jacobian products work on."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.training.gradients.onnx_graph import OnnxGraph


@dataclass
class VjpStep:
    """A node, the gradients of its outputs, and which of its inputs want theirs."""

    graph: OnnxGraph
    node: Any  # onnx.NodeProto
    gradients: list[str | None]  # of each output; None: the loss does not depend on it
    wanted: frozenset[int]  # numbers of the inputs

    @property
    def gradient(self) -> str:
        """Of the only output that the loss depends on.  Raises BadFile where there are others."""
        if self.gradients[0] is None or any(self.gradients[1:]):
            raise self.refusal("with its further outputs in use")
        return self.gradients[0]

    @property
    def output(self) -> str:
        return self.node.output[0]

    @property
    def inputs(self) -> list[str]:
        return list(self.node.input)

    @cached_property
    def attributes(self) -> dict:
        from onnx import helper

        return {a.name: helper.get_attribute_value(a) for a in self.node.attribute}

    def has(self, index: int) -> bool:
        """Whether the node has that input; optional ones may be left out."""
        return len(self.node.input) > index and self.node.input[index] != ""

    def shape(self, index: int = 0) -> tuple[int, ...]:
        """Of an input."""
        return self.graph.shape(self.node.input[index])

    @property
    def output_shape(self) -> tuple[int, ...]:
        return self.graph.shape(self.node.output[0])

    def stored(self, index: int) -> np.ndarray:
        """An input that the file holds.  Raises BadFile where it is calculated."""
        value = self.graph.constant(self.node.input[index]) if self.has(index) else None
        if value is None:
            raise self.refusal(f"whose input {index + 1} is calculated")
        return value

    def numbers(self, index: int, attribute: str) -> list[int] | None:
        """A stored input of whole numbers, or the attribute that older versions have for it.

        None without both.  Raises BadFile where the input is calculated.
        """
        found = self.parameter(index, attribute)
        return None if found is None else [int(n) for n in np.ravel(found)]

    def parameter(self, index: int, attribute: str) -> np.ndarray | None:
        """The same, of any numbers."""
        if self.has(index):
            return self.stored(index)
        found = self.attributes.get(attribute)
        return None if found is None else np.asarray(found)

    def text(self, attribute: str, default: str) -> str:
        """An attribute that is a word."""
        found = self.attributes.get(attribute, default)
        return found.decode() if isinstance(found, bytes) else found

    def refusal(self, what: str) -> BadFile:
        """What to raise where there is no gradient."""
        return BadFile(
            f"{self.graph.name}: there is no gradient through the operator "
            f"{self.node.op_type!r} {what} (at {self.node.name or self.output!r}); export the "
            "network without it, or use another one."
        )


Vjp = Callable[[VjpStep], dict[int, str]]  # gradients of the wanted inputs, by their numbers
