"""Small random models that tests share."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import (
    HEADS,
    SIZE_PER_SPLAT,
    AnchorFrames,
    AnchorModel,
    ControlEncoding,
    Mlp,
    Stop,
)
from shapeshift.runtime_models.package.package_files import ANCHORS
from shapeshift.runtime_models.package.refit_encoding import encoding_for
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.stop_weights import StopWeights

STOPS = (Stop("RGB", 0.0), Stop("Thermal", 1.0, "thermal", "ironbow", (15.0, 95.0), "°C"))
HEAD = {
    "offset": ("tanh", None, 0.1),
    "scale": ("exp", (-6.0, 3.0), 0.02),
    "rotation": ("none", None, 1.0),
    "opacity": ("tanh", None, 1.0),
    "color": ("sigmoid", None, 1.0),
}


def make_random_model(
    anchors: int = 100,
    k: int = 5,
    seed: int = 0,
    features: int = 16,
    hidden: tuple[int, ...] = (32,),
    encoding: ControlEncoding | None = None,
) -> AnchorModel:
    """Anchors in the unit ball, weights of N(0, 0.3); every head as training exports it."""
    rng = np.random.default_rng(seed)
    encoding = encoding or ControlEncoding()
    networks = {}
    for name in HEADS:
        inputs = ("feature", "direction", "control") if name == "color" else ("feature", "control")
        first = features + encoding.d + (3 if name == "color" else 0)
        widths = [first, *hidden, k * SIZE_PER_SPLAT[name]]
        pairs = list(zip(widths, widths[1:], strict=False))  # noqa: RUF007
        weights = [rng.normal(0, 0.3, (b, a)).astype(np.float32) for a, b in pairs]
        biases = [rng.normal(0, 0.1, b).astype(np.float32) for _, b in pairs]
        head, clip, gain = HEAD[name]
        networks[name] = Mlp(tuple(weights), tuple(biases), head, inputs, clip, gain)
    points = rng.normal(size=(anchors, 3))
    points *= (rng.uniform(size=anchors) ** (1 / 3) / np.linalg.norm(points, axis=1))[:, None]
    return AnchorModel(
        points.astype(np.float32),
        rng.normal(size=(anchors, features)).astype(np.float32),
        networks,
        k,
        encoding,
        STOPS,
        {"seed": seed},
    )


def psi_of(model: AnchorModel, control: float | StopWeights) -> np.ndarray:
    """(d,) float64 Psi of a control at even pace, by equations 6 and 7 and a sum over stops."""

    def psi(x: float) -> np.ndarray:
        t = np.arange(model.encoding.d) * model.encoding.spacing
        return np.exp(-((t - x) ** 2) / (2 * model.encoding.sigma**2))

    if isinstance(control, StopWeights):
        place = {stop.name: stop.x for stop in model.stops}
        return sum(weight * psi(place[name]) for name, weight in control.parts)
    below = [stop.x for stop in model.stops if stop.x <= control]
    above = [stop.x for stop in model.stops if stop.x >= control]
    if model.between_stops == "encoding" or not (below and above) or below[-1] == above[0]:
        return psi(control)
    a, b = below[-1], above[0]
    return ((b - control) * psi(a) + (control - a) * psi(b)) / (b - a)


def without_control(model: AnchorModel, *names: str) -> AnchorModel:
    """The same model whose networks of these names do not see x."""
    networks = dict(model.networks)
    for name in names:
        mlp = networks[name]
        seen = mlp.weights[0][:, : -model.encoding.d]  # Psi(x) comes last
        networks[name] = replace(
            mlp, weights=(np.ascontiguousarray(seen), *mlp.weights[1:]), inputs=mlp.inputs[:-1]
        )
    return replace(model, networks=networks)


def without_direction(model: AnchorModel) -> AnchorModel:
    """The same with colours that are alike from everywhere."""
    mlp, widths = model.networks["color"], {"feature": model.features.shape[1], "direction": 3}
    of_column = np.repeat(mlp.inputs, [widths.get(name, model.encoding.d) for name in mlp.inputs])
    weights = (mlp.weights[0][:, of_column != "direction"], *mlp.weights[1:])
    inputs = tuple(name for name in mlp.inputs if name != "direction")
    blind = replace(mlp, weights=weights, inputs=inputs)
    return replace(model, networks=model.networks | {"color": blind})


def run_in_numpy(mlp: Mlp, rows: np.ndarray) -> np.ndarray:
    """The slow twin of every way to run a network: (N, inputs) to (N, outputs) in float64."""
    value = rows.astype(np.float64)
    for i, (weight, bias) in enumerate(zip(mlp.weights, mlp.biases, strict=True)):
        value = (np.maximum(value, 0) if i else value) @ weight.T.astype(np.float64) + bias
    if mlp.clip is not None:
        value = np.clip(value, *mlp.clip)
    with np.errstate(over="ignore"):
        head = {
            "none": lambda z: z,
            "tanh": np.tanh,
            "sigmoid": lambda z: 1 / (1 + np.exp(-z)),
            "softplus": lambda z: np.logaddexp(0, z),
            "exp": np.exp,
        }[mlp.head]
    return mlp.gain * head(value)


def random_package(folder: Path, anchors: int, **kind) -> Path:
    """The file of a random model in a folder, by default with an encoding as trained today."""
    path = folder / "random.shift"
    kind.setdefault("encoding", encoding_for([stop.x for stop in STOPS]))
    write_package(make_random_model(anchors, **kind), path)
    return path


def with_light(model: AnchorModel, seed: int = 0, channels: int = 3) -> AnchorModel:
    """The model with random light by direction, which its colour network takes as it takes all."""
    rng, color = np.random.default_rng([seed, 8]), model.networks["color"]
    widths = [model.input_widths[part] for part in color.inputs]
    at = sum(widths[: color.inputs.index("direction") + 1])
    columns = rng.normal(size=(channels, len(color.weights[0]))).T
    weight = np.insert(color.weights[0], [at] * channels, columns, axis=1)
    inputs = list(color.inputs)
    inputs.insert(inputs.index("direction") + 1, "light")
    lit = replace(color, weights=(weight, *color.weights[1:]), inputs=tuple(inputs))
    light = rng.normal(0, 0.5, (len(model.anchors), 8 * channels)).astype(np.float32)
    return replace(model, networks=model.networks | {"color": lit}, light=light)


def with_frames(model: AnchorModel, seed: int = 0) -> AnchorModel:
    """The model with random axes and sizes from a fifth to five times."""
    rng, count = np.random.default_rng(seed), len(model.anchors)
    wxyz = rng.normal(size=(count, 4))
    wxyz /= np.linalg.norm(wxyz, axis=1, keepdims=True)
    scales = np.exp(rng.uniform(-1.6, 1.6, (count, 3)))
    return replace(model, frames=AnchorFrames(scales.astype(np.float32), wxyz.astype(np.float32)))


def changed_arrays(files: dict[str, bytes], **arrays) -> dict[str, bytes]:
    """The package with arrays of its npz replaced, or left out where None."""
    with np.load(io.BytesIO(files[ANCHORS])) as archive:
        there = dict(archive) | arrays
    out = io.BytesIO()
    np.savez(out, **{name: array for name, array in there.items() if array is not None})
    return files | {ANCHORS: out.getvalue()}
