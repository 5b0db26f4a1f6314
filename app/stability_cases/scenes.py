"""Small scenes that cases make themselves: their right picture is known, whatever the user's is."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.model import (
    AnchorModel,
    ControlEncoding,
    Mlp,
    Model,
    SplatLayers,
    Stop,
)
from shapeshift.scene.pose import Pose, View, perspective
from shapeshift.scene.scene import IDENTITY, Scene, SceneObject

ONLY = (Stop("only", 0.0),)


def splats(
    means, scales, opacity: ArrayLike = 0.8, color=(1.0, 0.5, 0.2), wxyz=(1, 0, 0, 0)
) -> SplatLayers:
    """Plain splats; what is given once holds for all of them.  color: display sRGB."""
    means = np.asarray(means, np.float32).reshape(-1, 3)
    count = len(means)

    def rows(value, width: int) -> np.ndarray:
        return np.array(np.broadcast_to(np.asarray(value, np.float32), (count, width)))

    sh = (rows(color, 3) - np.float32(0.5)) / np.float32(C0)
    index = np.zeros(count, np.int32)
    opacities = rows(np.reshape(opacity, (-1, 1)), 1)[:, 0]
    return SplatLayers(
        means, rows(scales, 3), rows(wxyz, 4), opacities, sh[:, None], index, ONLY
    )  # fmt: skip


def shell(count: int = 1500, seed: int = 0) -> SplatLayers:
    """A closed ball of a metre, of flat splats of random colours and opacities."""
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    size = np.sqrt(4 * np.pi / count) * np.array([0.8, 0.5, 0.1])
    return splats(
        normal, size, rng.uniform(0.3, 1, count), rng.uniform(size=(count, 3)), turns(count, rng)
    )


def glossy(count: int = 1500, seed: int = 5) -> SplatLayers:
    """The ball with strong harmonics of degree 3: from a little aside it looks otherwise."""
    ball, rng = shell(count, seed), np.random.default_rng(seed)
    more = rng.normal(size=(count, 15, 3)) * 0.15
    return replace(ball, sh=np.concatenate([ball.sh, more.astype(np.float32)], axis=1))


def around(count: int = 1200, seed: int = 0) -> SplatLayers:
    """Splats before the eye of `front(size, 0)` and far beside it, so long that they reach into the
    picture from there.
    """
    rng = np.random.default_rng(seed)
    means = rng.uniform((-6, -4, -2.5), (6, 4, -0.4), (count, 3))
    scales = np.exp(rng.normal(-2, 0.6, (count, 3)))
    color, opacity = rng.uniform(size=(count, 3)), rng.uniform(0.05, 1, count)
    return splats(means, scales, opacity, color, turns(count, rng))


@dataclass(frozen=True)
class FaintLayers:
    """Faint round splats side by side in one plane, the first before the second, each in the middle
    of a pixel: what they look like is known without any projection.
    """

    view: View
    scene: Scene
    picture: np.ndarray  # (H, W, 4) float64


def faint_layers(count: int, size: tuple[int, int], opacity: float, sigma_px: float) -> FaintLayers:
    """`count` splats of random colours with footprints of sigma_px, blended by their formula."""
    rng, (width, height), distance = np.random.default_rng(3), size, 3.0
    view = front(size, distance)
    column, row = rng.integers(0, width, count), rng.integers(0, height, count)
    pixel = distance * (view.tangents[3] - view.tangents[2]) / height  # metres
    x, y = (column + 0.5 - width / 2) * pixel, (height / 2 - row - 0.5) * pixel
    color = rng.uniform(size=(count, 3))
    sigma = sigma_px * pixel
    thin = (sigma, sigma, 1e-3 * sigma)
    scene = alone(splats(np.column_stack([x, y, np.zeros(count)]), thin, opacity, color))

    away = np.arange(-int(4 * sigma_px), int(4 * sigma_px) + 1)
    square = away[:, None] ** 2 + away**2
    alpha = np.float32(opacity) * np.exp(-square / (2 * (sigma_px**2 + 0.3)))
    alpha[alpha < 1 / 255] = 0
    edge = len(away) // 2  # pixels around the picture, so that every footprint fits
    through = np.ones((height + 2 * edge, width + 2 * edge))
    image = np.zeros((*through.shape, 3))
    for i, j, rgb in zip(row.tolist(), column.tolist(), color, strict=True):
        under = through[i : i + len(away), j : j + len(away)]
        image[i : i + len(away), j : j + len(away)] += (alpha * under)[..., None] * rgb
        under *= 1 - alpha
    whole = np.concatenate([image, 1 - through[..., None]], axis=2)
    return FaintLayers(view, scene, whole[edge:-edge, edge:-edge])


def turns(count: int, rng: np.random.Generator) -> np.ndarray:
    """(N, 4) unit quaternions of any direction."""
    wxyz = rng.normal(size=(count, 4))
    return wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True)


def as_float(arrays: Iterable[np.ndarray]) -> tuple[np.ndarray, ...]:
    return tuple(array.astype(np.float32) for array in arrays)


def small_model(anchors: int = 60, k: int = 5, seed: int = 0) -> AnchorModel:
    """Networks with random weights, bounded as trained ones are: splats of a few centimetres."""
    rng = np.random.default_rng(seed)

    def network(width: int, bias: float, seen: bool = False, **kind) -> Mlp:
        inputs = ("feature", "direction", "control") if seen else ("feature", "control")
        sizes = (32, 8 + 3 * seen + 16)
        weights = (rng.normal(0, 0.3, sizes), rng.normal(0, 0.15, (width, 32)))
        biases = (rng.normal(0, 0.1, 32), np.full(width, bias))
        return Mlp(as_float(weights), as_float(biases), inputs=inputs, **kind)

    networks = {
        "offset": network(3 * k, 0, head="tanh", gain=0.1),
        "scale": network(3 * k, -3, head="exp"),
        "rotation": network(4 * k, 0.2),
        "opacity": network(k, 0.5, head="tanh"),
        "color": network(3 * k, 0, True, head="sigmoid"),
    }
    places = rng.normal(size=(anchors, 3)) * 0.5
    features = rng.normal(size=(anchors, 8))
    stops = (Stop("first", 0.0), Stop("second", 1.0))
    arrays = (places.astype(np.float32), features.astype(np.float32))
    return AnchorModel(*arrays, networks, k, ControlEncoding(), stops)


def alone(model: Model, pose=IDENTITY, x: float = 0.0) -> Scene:
    return Scene((SceneObject("thing", model, pose, x),))


def front(
    size: tuple[int, int], distance: float = 3.0, near: float = 0.05, fov_y: float = 0.8
) -> View:
    """An eye on +Z that looks along -Z."""
    pose = Pose(np.array([0.0, 0.0, distance]), IDENTITY.wxyz)
    return View(pose, perspective(fov_y, size), near, 1e7, size)
