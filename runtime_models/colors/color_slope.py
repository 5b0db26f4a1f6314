"""How much the colours of a model change with the direction that it is looked at from."""

from itertools import pairwise

import numpy as np

from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import AnchorModel, SplatLayers

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
