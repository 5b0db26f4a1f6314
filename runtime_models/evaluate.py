"""Splats of a model at one x and one eye, by onnxruntime: the check of every faster path."""

from dataclasses import replace

import numpy as np

from runtime_models.model import SIZE_PER_SPLAT, AnchorModel, Mlp, SplatLayers, Splats
from runtime_models.rotation import normalize
from runtime_models.spherical_harmonics import shade
from runtime_models.write_onnx import write_onnx

Control = float | np.ndarray  # of everything, or (A,) one an anchor (layers: one a splat)
BATCH = 16384  # anchors a run: bounds the memory; half and twice as many are no faster


def evaluate(model: AnchorModel | SplatLayers, x: Control, eye: np.ndarray) -> Splats:
    """The splats at control x seen from `eye` (3,), metres in the object's frame.

    Runs the networks as a package holds them, on every input, Psi(x) too: the plain twin of
    Evaluator, which is for one set of splats after the other.
    """
    evaluator = Evaluator(model, fold=False)
    return Splats(*evaluator.geometry(x), evaluator.color(x, eye))


def directions(anchors: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """(A, 3) from the eye to each anchor, unit length (paper eq. 4); zero at the anchor itself."""
    delta = anchors - np.asarray(eye, np.float32)
    length = np.sqrt(np.einsum("ac,ac->a", delta, delta))[:, None]
    known = (length > 0) & np.isfinite(length)
    return np.divide(delta, length, out=np.zeros_like(delta), where=known)


class Evaluator:
    """The networks of one model, made ready once.

    Psi(x) is the same for every anchor, so with `fold` its product with the first layer goes into
    that layer's bias: exact, and 1.6 times faster than to hand it to every anchor.
    """

    def __init__(
        self, model: AnchorModel | SplatLayers, threads: int = 1, fold: bool = True
    ) -> None:
        self.model = model
        self._networks: dict[str, FoldedNetwork | WholeNetwork] = {}
        if isinstance(model, AnchorModel):
            kind = FoldedNetwork if fold else WholeNetwork
            for name, mlp in model.networks.items():
                self._networks[name] = kind(name, mlp, model, threads)

    def geometry(
        self, x: Control, unit: bool = True
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """means (N, 3) m, scales (N, 3) m, wxyz (N, 4) unit, opacity (N,) negative = absent.

        unit False: quaternions of any length, for one who divides by it anyway.
        """
        model = self.model
        if isinstance(model, SplatLayers):
            weights = model.weights(x)  # (stops,) or (stops, N)
            there = weights[model.layer] if np.ndim(x) == 0 else _own(weights, model.layer)
            return model.means, model.scales, model.wxyz, model.opacity * there
        means = self._run("offset", x)  # (A, k * 3), from the anchor
        per_anchor = means.reshape(len(means), model.splats_per_anchor, 3)  # a view
        per_anchor += model.anchors[:, None]
        scales, wxyz = self._run("scale", x), self._run("rotation", x).reshape(-1, 4)
        opacity = self._run("opacity", x).reshape(-1)
        wxyz = normalize(wxyz) if unit else wxyz
        return means.reshape(-1, 3), scales.reshape(-1, 3), wxyz, opacity

    def color(
        self,
        x: Control,
        eye: np.ndarray,
        seen: np.ndarray | None = None,
        out: np.ndarray | None = None,
    ) -> np.ndarray:
        """(N, 3) display sRGB seen from `eye` (3,), metres in the object's frame.

        seen: (A,) bool; only these are computed, the rest of `out` (N, 3) stays what it was.
        """
        model = self.model
        places = model.means if isinstance(model, SplatLayers) else model.anchors
        if seen is None or seen.all():
            return self._color(x, slice(None), directions(places, eye))
        rows = np.flatnonzero(seen)
        out = np.zeros((model.splat_count, 3), np.float32) if out is None else out
        if rows.size:
            mine = x if np.ndim(x) == 0 else x[rows]
            per_row = out.reshape(len(places), -1)  # a view: the splats of a row side by side
            colors = self._color(mine, rows, directions(places[rows], eye))
            per_row[rows] = colors.reshape(rows.size, -1)
        return out

    def _color(self, x: Control, rows: np.ndarray | slice, direction: np.ndarray) -> np.ndarray:
        """(n, 3) colours of the splats of some rows, towards which `direction` (rows, 3) points."""
        if isinstance(self.model, SplatLayers):
            return shade(self.model.sh[rows], direction)
        return self._run("color", x, direction, rows).reshape(-1, 3)

    def _run(
        self,
        name: str,
        x: Control,
        direction: np.ndarray | None = None,
        rows: np.ndarray | slice = slice(None),
    ) -> np.ndarray:
        """(A, k * size) output of one network, the splats of one anchor side by side.

        rows: of the anchors; x and direction are already of these rows alone.
        """
        model, network = self.model, self._networks[name]
        features = model.features[rows]
        out = np.empty((len(features), model.splats_per_anchor * SIZE_PER_SPLAT[name]), np.float32)
        psi, which = self._encoded(x)
        for start in range(0, len(features), BATCH):
            part = slice(start, start + BATCH)
            seen = None if direction is None else direction[part]
            one_each = None if which is None else which[part]
            out[part] = network.run(features[part], seen, psi, one_each)
        return out

    def _encoded(self, x: Control) -> tuple[np.ndarray, np.ndarray | None]:
        """Psi of the values that x has, (values, d), and which of them each anchor's is."""
        if np.ndim(x) == 0:
            return self.model.encoding.encode(float(x))[None], None
        values, which = np.unique(np.asarray(x, np.float32), return_inverse=True)
        return self.model.encoding.encode(values[:, None].astype(np.float64)), which


def _own(weights: np.ndarray, layer: np.ndarray) -> np.ndarray:
    """(N,) of weights (stops, N): each splat's weight of its own layer."""
    return weights[layer, np.arange(len(layer))]


class WholeNetwork:
    """One network as its ONNX file holds it: every input for every anchor."""

    def __init__(self, name: str, mlp: Mlp, model: AnchorModel, threads: int) -> None:
        self._inputs = mlp.inputs
        self._session = open_session(write_onnx(mlp, name), threads)

    def run(
        self,
        feature: np.ndarray,
        direction: np.ndarray | None,
        psi: np.ndarray,
        which: np.ndarray | None,
    ) -> np.ndarray:
        """(n, k * size) of features (n, F), directions (n, 3) and Psi (values, d); which (n,): of
        these values each anchor's own, None: all have the first.
        """
        control = np.broadcast_to(psi, (len(feature), psi.size)) if which is None else psi[which]
        parts = {"feature": feature, "direction": direction, "control": control}
        rows = np.concatenate([parts[part] for part in self._inputs], axis=1)
        return self._session.run(["output"], {"input": rows})[0]


class FoldedNetwork:
    """The same network with Psi(x) in its first bias: only what differs from anchor to anchor."""

    def __init__(self, name: str, mlp: Mlp, model: AnchorModel, threads: int) -> None:
        widths = {"feature": model.features.shape[1], "direction": 3, "control": model.encoding.d}
        is_control = np.repeat(
            [part == "control" for part in mlp.inputs], [widths[part] for part in mlp.inputs]
        )
        first = mlp.weights[0]  # (hidden, inputs)
        self._bias = mlp.biases[0].astype(np.float64)
        self._control = first[:, is_control].astype(np.float64)  # (hidden, d), or (hidden, 0)
        self._inputs = [part for part in mlp.inputs if part != "control"]
        rest = replace(mlp, weights=(first[:, ~is_control], *mlp.weights[1:]))
        self._session = open_session(write_onnx(rest, name, first_bias="input"), threads)

    def run(
        self,
        feature: np.ndarray,
        direction: np.ndarray | None,
        psi: np.ndarray,
        which: np.ndarray | None,
    ) -> np.ndarray:
        """As WholeNetwork.run."""
        bias = self._bias[None]
        if self._control.shape[1]:
            bias = bias + psi @ self._control.T  # (values, hidden)
            bias = bias if which is None else bias[which]
        parts = {"feature": feature, "direction": direction}
        columns = [parts[part] for part in self._inputs]
        rows = columns[0] if len(columns) == 1 else np.concatenate(columns or [feature[:, :0]], 1)
        return self._session.run(["output"], {"input": rows, "bias": bias.astype(np.float32)})[0]


def open_session(data: bytes, threads: int):
    """An onnxruntime session on the CPU of an ONNX file's bytes."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads  # 1 measured fastest for these small networks
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
