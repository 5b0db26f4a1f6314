"""Splats of a model at one x and one eye, by onnxruntime: the check of every faster path."""

import numpy as np

from runtime_models.model import SIZE_PER_SPLAT, AnchorModel, Mlp, SplatLayers, Splats
from runtime_models.rotation import normalize
from runtime_models.spherical_harmonics import shade
from runtime_models.write_onnx import write_onnx

BATCH = 65536  # anchors a run: bounds the memory of the widest input


def evaluate(model: AnchorModel | SplatLayers, x: float, eye: np.ndarray) -> Splats:
    """The splats at control x seen from `eye` (3,), metres in the object's frame."""
    evaluator = Evaluator(model)
    return Splats(*evaluator.geometry(x), evaluator.color(x, eye))


def directions(anchors: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """(A, 3) from the eye to each anchor, unit length (paper eq. 4); zero at the anchor itself."""
    delta = anchors - np.asarray(eye, np.float32)
    length = np.linalg.norm(delta, axis=1, keepdims=True)
    return delta / np.where(length > 0, length, 1)


class Evaluator:
    """The networks of one model, made ready once."""

    def __init__(self, model: AnchorModel | SplatLayers, threads: int = 1) -> None:
        self.model = model
        if isinstance(model, AnchorModel):
            self.sessions = {n: open_session(n, m, threads) for n, m in model.networks.items()}

    def geometry(self, x: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """means (N, 3) m, scales (N, 3) m, wxyz (N, 4) unit, opacity (N,) negative = absent."""
        model = self.model
        if isinstance(model, SplatLayers):
            opacity = model.opacity * model.weights(x)[model.layer]
            return model.means, model.scales, model.wxyz, opacity
        offsets = self._run("offset", x, None)  # (A, k, 3)
        means = (model.anchors[:, None] + offsets).reshape(-1, 3)
        scales = self._run("scale", x, None).reshape(-1, 3)
        wxyz = normalize(self._run("rotation", x, None).reshape(-1, 4))
        return means, scales, wxyz, self._run("opacity", x, None).reshape(-1)

    def color(self, x: float, eye: np.ndarray) -> np.ndarray:
        """(N, 3) display sRGB seen from `eye` (3,), metres in the object's frame."""
        if isinstance(self.model, SplatLayers):
            return shade(self.model.sh, directions(self.model.means, eye))
        return self._run("color", x, directions(self.model.anchors, eye)).reshape(-1, 3)

    def _run(self, name: str, x: float, direction: np.ndarray | None) -> np.ndarray:
        """(A, k, size) output of one network."""
        model, count = self.model, len(self.model.anchors)
        control = model.encoding.encode(x)
        out = []
        for start in range(0, count, BATCH):
            rows = slice(start, min(start + BATCH, count))
            parts = {
                "feature": model.features[rows],
                "control": np.broadcast_to(control, (rows.stop - start, len(control))),
            }
            if direction is not None:
                parts["direction"] = direction[rows]
            columns = [parts[part] for part in model.networks[name].inputs]
            inputs = {"input": np.concatenate(columns, axis=1, dtype=np.float32)}
            out.append(self.sessions[name].run(["output"], inputs)[0])
        return np.concatenate(out).reshape(count, model.splats_per_anchor, SIZE_PER_SPLAT[name])


def open_session(name: str, mlp: Mlp, threads: int):
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads  # 1 measured fastest for these small networks
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(
        write_onnx(mlp, name), options, providers=["CPUExecutionProvider"]
    )
