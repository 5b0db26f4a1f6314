"""One network of a model as onnxruntime runs it: whole, or with Psi(x) folded into a bias."""

import os
from dataclasses import replace
from functools import cached_property

import numpy as np

from shapeshift.runtime_models.model import AnchorModel, Mlp
from shapeshift.runtime_models.package.package_files import write_onnx


class WholeNetwork:
    """One network as its ONNX file holds it: every input for every anchor."""

    def __init__(self, name: str, mlp: Mlp, model: AnchorModel, threads: int) -> None:
        self._inputs = mlp.inputs
        self._made_of = (name, mlp, threads)

    @cached_property
    def _session(self):
        """Opened at the first run: another decoder may leave it nothing to do."""
        name, mlp, threads = self._made_of
        return open_session(write_onnx(mlp, name), threads)

    def feature_part(self, features: np.ndarray) -> None:
        """Nothing is kept."""

    def run(self, parts: dict[str, np.ndarray], base: np.ndarray | None) -> np.ndarray:
        """(n, k * size) of features (n, F), directions (n, 3), light (n, 1 or 3) and Psi, (1, d) or
        (n, d).

        base: None, as feature_part gives it.
        """
        count = len(parts["feature"])
        columns = [np.broadcast_to(parts[p], (count, parts[p].shape[1])) for p in self._inputs]
        return self._session.run(["output"], {"input": np.concatenate(columns, axis=1)})[0]


class FoldedNetwork:
    """The same network with Psi(x) in its first bias: only what differs from anchor to anchor."""

    def __init__(self, name: str, mlp: Mlp, model: AnchorModel, threads: int) -> None:
        part_of = np.repeat(mlp.inputs, [model.input_widths[part] for part in mlp.inputs])
        first = mlp.weights[0]  # (hidden, inputs)
        self._keeps = {"feature", "direction"} <= set(mlp.inputs)
        outside = ("control", "feature") if self._keeps else ("control",)
        self._inputs = [part for part in mlp.inputs if part not in outside]
        self._bias = mlp.biases[0].astype(np.float64)
        self._control = first[:, part_of == "control"].astype(np.float64)  # (hidden, d or 0)
        self._feature = first[:, part_of == "feature"]
        self._base: np.ndarray | None = None  # (A, hidden)
        rest = replace(mlp, weights=(first[:, ~np.isin(part_of, outside)], *mlp.weights[1:]))
        kind = "input and rows" if self._keeps else "input"
        self._made_of = (name, rest, kind, threads)

    @cached_property
    def _session(self):
        """Opened at the first run."""
        name, rest, kind, threads = self._made_of
        return open_session(write_onnx(rest, name, first_bias=kind), threads)

    def feature_part(self, features: np.ndarray) -> np.ndarray | None:
        """(A, hidden) what the first layer makes of all features, from the first use on."""
        if self._keeps and self._base is None:
            # By a session as well: numpy's matrix product leaves threads spinning for milliseconds.
            layer = Mlp((self._feature,), (np.zeros(len(self._feature), np.float32),))
            session = open_session(write_onnx(layer, "features"), threads=1)
            self._base = session.run(["output"], {"input": features})[0]
        return self._base

    def run(self, parts: dict[str, np.ndarray], base: np.ndarray | None) -> np.ndarray:
        """The same of one Psi (1, d) for all; base (n, hidden): their feature part, if kept."""
        bias = self._bias[None]
        if self._control.shape[1]:
            bias = bias + parts["control"].astype(np.float64) @ self._control.T
        columns = [parts[part] for part in self._inputs] or [parts["feature"][:, :0]]
        rows = columns[0] if len(columns) == 1 else np.concatenate(columns, axis=1)
        given = {"input": rows, "bias": bias.astype(np.float32)}
        if base is not None:
            given["rows"] = base
        return self._session.run(["output"], given)[0]


# Networks on the CPU: onnxruntime sessions of ONNX bytes.

BATCH = 16384  # rows a run: bounds the memory; half and twice as many are no faster


def load_onnxruntime():
    """The package, which would otherwise tell its maker of every session, over the network."""
    os.environ["ORT_DISABLE_TELEMETRY"] = "1"
    import onnxruntime

    return onnxruntime


def open_session(data: bytes | str, threads: int):
    """An onnxruntime session on the CPU of an ONNX file: its bytes, or its path."""
    onnxruntime = load_onnxruntime()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads  # 1 measured fastest for these small networks
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
