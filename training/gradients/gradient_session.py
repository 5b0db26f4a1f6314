"""Loss and gradient of an ONNX network in one run of onnxruntime."""

from collections.abc import Mapping

import numpy as np

from shapeshift.runtime_models.session import load_onnxruntime
from shapeshift.training.gradients.fold_constants import open_checked
from shapeshift.training.gradients.onnx_graph import OnnxGraph
from shapeshift.training.gradients.reverse_mode import add_gradient


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
