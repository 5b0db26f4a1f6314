"""Models, scenes and views to feed the passes of OpenGL with, and what lies in their buffers."""

from itertools import pairwise

import moderngl
import numpy as np

from shapeshift.runtime_models.model import (
    HEADS,
    SIZE_PER_SPLAT,
    AnchorModel,
    ControlEncoding,
    Mlp,
    SplatLayers,
    Stop,
)
from shapeshift.scene.pose import View, look_at

STOPS = (Stop("first", 0.0), Stop("second", 1.0))


def f32(array: np.ndarray) -> np.ndarray:
    return np.asarray(array, np.float32)


def make_mlp(rng: np.random.Generator, widths: list[int], head: str, **kind: object) -> Mlp:
    """Random weights of a size that keeps values near one; widths from inputs to outputs."""
    pairs = list(pairwise(widths))
    weights = tuple(f32(rng.normal(size=(b, a)) / np.sqrt(a)) for a, b in pairs)
    biases = tuple(f32(rng.normal(size=b) * 0.1) for _, b in pairs)
    return Mlp(weights, biases, head, **kind)


def make_model(
    anchors: int, features: int = 16, k: int = 10, hidden: tuple[int, ...] = (32,), d: int = 16
) -> AnchorModel:
    """An untrained shape-shifting model with bounded heads."""
    rng = np.random.default_rng(anchors + features + k)
    kinds = {
        "offset": {"head": "tanh", "gain": 0.1},
        "scale": {"head": "exp", "gain": 0.02, "clip": (-6.0, 3.0)},
        "rotation": {"head": "none"},
        "opacity": {"head": "tanh"},
        "color": {"head": "sigmoid", "inputs": ("feature", "control", "direction")},
    }
    networks = {}
    for name in HEADS:
        inputs = features + d + 3 * (name == "color")
        networks[name] = make_mlp(rng, [inputs, *hidden, k * SIZE_PER_SPLAT[name]], **kinds[name])
    places, learned = f32(rng.normal(size=(anchors, 3))), f32(rng.normal(size=(anchors, features)))
    return AnchorModel(places, learned, networks, k, ControlEncoding(d), STOPS)


def make_layers(count: int, coefficients: int = 4, seed: int = 0) -> SplatLayers:
    """Random plain splats within two metres of the origin, half of them in either layer."""
    rng = np.random.default_rng(seed)
    return SplatLayers(
        means=f32(rng.normal(size=(count, 3)) * 0.7),
        scales=f32(np.exp(rng.normal(size=(count, 3)) * 0.6 - 3.5)),
        wxyz=f32(rng.normal(size=(count, 4))),
        opacity=f32(rng.uniform(0, 1, count)),
        sh=f32(rng.normal(size=(count, coefficients, 3)) * 0.3),
        layer=rng.integers(0, 2, count).astype(np.int32),
        stops=STOPS,
    )


def make_view(
    eye: tuple[float, float, float] = (0.4, 0.6, 3.5),
    tangents: tuple[float, float, float, float] = (-0.5, 0.3, -0.2, 0.4),
    size: tuple[int, int] = (160, 120),
) -> View:
    """An off-centre view towards the origin."""
    return View(look_at(np.array(eye), np.zeros(3)), tangents, 0.05, 100.0, size)


def read(buffer: moderngl.Buffer, dtype: type, columns: int = 1) -> np.ndarray:
    rows = np.frombuffer(buffer.read(), dtype)
    return rows if columns == 1 else rows.reshape(-1, columns)


def psnr_db(a: np.ndarray, b: np.ndarray) -> float:
    return float(-10 * np.log10(np.mean((a.astype(np.float64) - b) ** 2) + 1e-30))
