"""Scenes that tests of the drawing back ends share."""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.model import AnchorModel, ControlEncoding, Mlp, SplatLayers, Stop
from shapeshift.scene.pose import Pose, View, look_at
from shapeshift.scene.scene import Scene, SceneObject

POISON = (np.nan, np.inf, -np.inf)
FIELDS = ("means", "scales", "wxyz", "opacity", "sh")


def random_layers(count: int, seed: int = 0, coefficients: int = 4, layers: int = 1) -> SplatLayers:
    """A cloud of long and flat splats of every opacity, two metres across."""
    rng = np.random.default_rng(seed)
    wxyz = rng.normal(size=(count, 4))
    arrays = (
        rng.normal(size=(count, 3)) * 0.7,
        np.exp(rng.normal(size=(count, 3)) * 0.8 - 3.7),
        wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True),
        rng.uniform(-0.1, 1.1, count).clip(0, 1),
        rng.normal(size=(count, coefficients, 3)) * 0.3,
    )
    stops = tuple(Stop(f"layer {i}", i / max(layers - 1, 1), "layer") for i in range(layers))
    index = rng.integers(0, layers, count).astype(np.int32)
    return SplatLayers(*(a.astype(np.float32) for a in arrays), index, stops)


def random_model(anchors: int, seed: int = 0, per_anchor: int = 10) -> AnchorModel:
    """Networks of the paper's shapes with random weights: splats of a few centimetres."""
    rng = np.random.default_rng(seed)

    def network(inputs: tuple[str, ...], width: int, bias: float, **kind) -> Mlp:
        sizes = {"feature": 16, "direction": 3, "control": 16}
        width_in = sum(sizes[name] for name in inputs)
        weights = (rng.normal(size=(32, width_in)) * 0.3, rng.normal(size=(width, 32)) * 0.15)
        biases = (rng.normal(size=32) * 0.1, np.full(width, bias))
        as_float = [tuple(a.astype(np.float32) for a in arrays) for arrays in (weights, biases)]
        return Mlp(*as_float, inputs=inputs, **kind)

    plain, seen = ("feature", "control"), ("feature", "direction", "control")
    networks = {
        "offset": network(plain, 3 * per_anchor, 0, gain=0.1),
        "scale": network(plain, 3 * per_anchor, -3.5, head="exp"),
        "rotation": network(plain, 4 * per_anchor, 0.2),
        "opacity": network(plain, per_anchor, 0.3, head="tanh"),
        "color": network(seen, 3 * per_anchor, 0, head="sigmoid"),
    }
    places, features = rng.normal(size=(anchors, 3)) * 0.6, rng.normal(size=(anchors, 16))
    stops = (Stop("first", 0.0), Stop("second", 1.0))
    arrays = (places.astype(np.float32), features.astype(np.float32))
    return AnchorModel(*arrays, networks, per_anchor, ControlEncoding(), stops)


def shell(count: int, coefficients: int = 1, seed: int = 0) -> SplatLayers:
    """A bumpy closed surface of flat splats with sizes and opacities as training leaves them."""
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    radius = 1 + 0.12 * np.sin(5 * normal[:, 0]) * np.cos(4 * normal[:, 1])
    means = normal * (radius + rng.normal(scale=0.01, size=count))[:, None] * (1.5, 1.0, 1.0)
    size = 0.75 * np.sqrt(4 * np.pi / count) * np.exp(rng.normal(scale=0.5, size=(count, 3)))
    size *= (1.6, 1.0, 0.15)  # metres; thin along the normal
    # The turn that takes z to the normal, after a random turn about z.
    tilt = np.stack(
        [1 + normal[:, 2], -normal[:, 1], normal[:, 0], np.zeros(count)], axis=1
    )  # wxyz, not normalised
    tilt /= np.maximum(np.linalg.norm(tilt, axis=1, keepdims=True), 1e-9)
    half = rng.uniform(0, np.pi / 2, count)
    w, x, y, _ = tilt.T
    c, s = np.cos(half), np.sin(half)
    wxyz = np.stack([w * c, x * c + y * s, y * c - x * s, w * s], axis=1)
    sh = rng.normal(size=(count, coefficients, 3)) * 0.05
    sh[:, 0] = 0.5 * np.sin(normal * 6 + (0, 2, 4)) / 0.28209479177387814
    opacity = np.clip(rng.beta(1.2, 0.8, count), 0.02, 0.995)
    arrays = [a.astype(np.float32) for a in (means, size, wxyz, opacity, sh)]
    return SplatLayers(*arrays, np.zeros(count, np.int32), (Stop("only", 0.0),))


def one_splat(**changes) -> SplatLayers:
    """A round splat of 5 cm at the origin, white, opacity 0.8; `changes` are SplatLayers fields."""
    fields = {
        "means": [[0, 0, 0]],
        "scales": [[0.05, 0.05, 0.05]],
        "wxyz": [[1, 0, 0, 0]],
        "opacity": [0.8],
        "sh": [[[0.5 / 0.28209479177387814] * 3]],
    } | changes
    arrays = [np.asarray(fields[name], np.float32) for name in FIELDS]
    return SplatLayers(*arrays, np.zeros(len(arrays[0]), np.int32), (Stop("only", 0.0),))


def alone(model, **placed) -> Scene:
    return Scene((SceneObject("thing", model, **placed),))


def two_objects(count: int) -> Scene:
    """A random cloud and a smaller one that stands across it, turned and moved."""
    turned = Pose(np.array([0.9, -0.2, 0.3]), np.array([0.5, 0.5, -0.5, 0.5]))
    return Scene(
        (
            SceneObject("cloud", random_layers(count - count // 8)),
            SceneObject("other", random_layers(count // 8, 1, 16), turned),
        )
    )


def front_view(size: tuple[int, int] = (256, 256), distance: float = 4.0) -> View:
    return View(look_at((0.4, 0.8, distance), (0, 0, 0)), (-0.4, 0.4, -0.4, 0.4), 0.05, 50, size)


def stereo_views(size: tuple[int, int] = (256, 256)) -> list[View]:
    """Two parallel eyes 64 mm apart whose fields of view lean outwards, as headsets have them."""
    pose = front_view().world_from_eye
    right = pose.matrix()[:3, 0]
    return [
        View(Pose(pose.position + side * right, pose.wxyz), tangents, 0.05, 50, size)
        for side, tangents in (
            (-0.032, (-0.55, 0.35, -0.5, 0.4)),
            (0.032, (-0.35, 0.55, -0.5, 0.4)),
        )
    ]


def psnr_db(image: np.ndarray, reference: np.ndarray) -> float:
    """Decibels of the error against a peak of 1; a pixel that is not finite gives nan."""
    error = np.mean((np.asarray(image, np.float64) - reference) ** 2)
    return float("inf") if error == 0 else float(-10 * np.log10(error))


def poisoned(layers: SplatLayers, seed: int = 5) -> tuple[SplatLayers, np.ndarray]:
    """A copy with one number of every twentieth splat broken, and which splats are still whole.

    The door refuses such numbers; here they get in behind it, as out of a network gone wrong.
    """
    rng = np.random.default_rng(seed)
    broken = only(layers, np.arange(len(layers.means)))
    bad = np.arange(0, len(layers.means), 20)
    for n, i in enumerate(bad):
        name = FIELDS[n % len(FIELDS)]
        row = getattr(broken, name)[i : i + 1].reshape(-1)  # a view
        # An infinite coefficient may mean black by rule, since colour is clamped at 0; NaN never.
        row[rng.integers(len(row))] = np.nan if name == "sh" else POISON[n // len(FIELDS) % 3]
    return broken, np.setdiff1d(np.arange(len(layers.means)), bad)


def only(layers: SplatLayers, rows: np.ndarray) -> SplatLayers:
    arrays = [getattr(layers, name)[rows] for name in FIELDS]
    made = SplatLayers(*arrays, layers.layer[rows], layers.stops)
    return replace(made, antialiased=layers.antialiased)
