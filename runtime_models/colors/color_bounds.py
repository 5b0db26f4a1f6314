"""Between which display values all colours of a model lie, from whatever side and at whatever x."""

import math
from itertools import pairwise

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import AnchorModel, Mlp, Model, SplatLayers

BLOCK = 1 << 16  # splats at a time


def color_range(model: Model) -> tuple[float, float]:
    """(least, most); infinite where nothing bounds them, (0, 0) where there are none.

    Of harmonics a bound and not the largest value: by Cauchy and Schwarz a band of coefficients c
    adds at most |c| sqrt((2 l + 1) / 4 pi).
    """
    if not isinstance(model, SplatLayers):
        return output_range(model.networks["color"]) if len(model.anchors) else (0.0, 0.0)
    blocks = range(0, model.splat_count, BLOCK)
    return 0.0, max((_most(model.sh[first : first + BLOCK]) for first in blocks), default=0.0)


def output_range(mlp: Mlp) -> tuple[float, float]:
    """(least, most) of y = gain head(clip(z)), whatever the weights are."""
    low, high = mlp.clip or (-math.inf, math.inf)
    ends = sorted(mlp.gain * _head(mlp.head, z) for z in (low, high))
    return ends[0], ends[1]


def _head(kind: str, z: float) -> float:
    """A head at one value, infinite ones too; all of them rise."""
    if kind == "tanh":
        return math.tanh(z)
    if kind == "sigmoid":
        return 0.5 + 0.5 * math.tanh(z / 2)
    if kind == "exp":
        return math.exp(z) if z < 700 else math.inf
    if kind == "softplus":
        return max(z, 0.0) + math.log1p(math.exp(-abs(z)))
    return z


def _most(sh: np.ndarray) -> float:
    """Bound of the colours of coefficients (n, M, 3); what is not finite is not drawn at all."""
    with np.errstate(all="ignore"):
        bound = np.float32(0.5) + np.float32(C0) * sh[:, 0]  # (n, 3)
        for band in range(1, math.isqrt(sh.shape[1])):
            part = sh[:, band * band : (band + 1) ** 2]
            size = np.sqrt(np.einsum("nmc,nmc->nc", part, part))
            bound += np.float32(math.sqrt((2 * band + 1) / (4 * math.pi))) * size
        bound = bound.max(axis=1)
    return float(max(bound[np.isfinite(bound)].max(initial=0), 0))


# How much the colours of a model change with the direction that it is looked at from.

SAMPLE = 4096  # splats of layers, anchors of a model: a few more change the third digit
STEP = 0.02  # radians between the two directions of a difference: a person's eyes at 3 m


def color_slope(model: AnchorModel | SplatLayers) -> float:
    """Display values that a channel changes by in the mean (rms) when a splat, weighed by its
    opacity, is seen from a radian further aside; 0 where colours do not look at the eye.

    Of networks the largest over the stops and half way between them.
    """
    if isinstance(model, SplatLayers):
        return _of_harmonics(model)
    if "direction" not in model.networks["color"].inputs:
        return 0.0
    step = max(-(-len(model.anchors) // SAMPLE), 1)
    few = model.with_anchors(slice(None, None, step))
    stops = sorted({stop.x for stop in model.stops})
    xs = stops + [(a + b) / 2 for a, b in pairwise(stops)]
    evaluator = Evaluator(few)
    return max((_of_networks(evaluator, x) for x in xs), default=0.0)


def _of_harmonics(layers: SplatLayers) -> float:
    """In closed form, the mean over all directions: the gradient of a spherical harmonic of band l
    has the square l (l + 1) / 4 pi in the mean, half of it along any one tangent.
    """
    step = max(-(-layers.splat_count // SAMPLE), 1)
    sh = layers.sh[::step].astype(np.float64)
    band = np.floor(np.sqrt(np.arange(sh.shape[1])))
    with np.errstate(all="ignore"):
        square = ((band * (band + 1) / (8 * np.pi))[:, None] * sh**2).sum(axis=1)  # (n, 3)
    return _rms(square, shown(layers.opacity[::step]))


def _of_networks(evaluator: Evaluator, x: float) -> float:
    """By differences between directions that are STEP apart."""
    rng = np.random.default_rng(0)
    assert isinstance(evaluator.model, AnchorModel)
    count = len(evaluator.model.anchors)
    direction = unit(rng.normal(size=(count, 3)))
    across = unit(np.cross(direction, rng.normal(size=(count, 3))))
    turned = np.cos(STEP) * direction + np.sin(STEP) * across
    opacity = shown(evaluator.geometry(x)[3])
    colors = [evaluator.color_along(x, d.astype(np.float32)) for d in (direction, turned)]
    with np.errstate(all="ignore"):
        square = np.square((colors[1] - colors[0]).astype(np.float64) / STEP)
    return _rms(square, opacity)


def _rms(square: np.ndarray, weight: np.ndarray) -> float:
    """Root of the mean of (n, 3) squares weighed by (n,); what is no number counts as infinite."""
    total = float(weight.sum(dtype=np.float64))
    if not total > 0:
        return 0.0
    with np.errstate(all="ignore"):
        mean = float((square.mean(axis=1) * weight).sum() / total)
    return float(np.sqrt(mean)) if np.isfinite(mean) else float("inf")


def shown(opacity: np.ndarray) -> np.ndarray:
    """(n,) float64 weights: nothing of splats that are absent, or no number."""
    return np.where(opacity > 0, opacity, 0).astype(np.float64)


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
