"""Where anchors are and how they look at every stop: what completion compares."""

from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import AnchorModel

LEAST_OPACITY = 0.1  # of all splats of an anchor together, to be there at all


@dataclass(frozen=True)
class AnchorLooks:
    places: np.ndarray  # (A, 3) float64 metres: mean of the splats by opacity, where it is first
    there: np.ndarray  # (A,) bool: seen at one stop at least
    colors: np.ndarray  # (A, stops * 3) display sRGB, mean of the splats by opacity
    spacing_m: float  # from an anchor to the next one, median


def looks_of(model: AnchorModel) -> AnchorLooks:
    """Of every anchor, seen from in front of the model and above."""
    from scipy.spatial import cKDTree

    evaluator, count = Evaluator(model), model.splats_per_anchor
    low, high = np.percentile(model.anchors, (1, 99), axis=0)
    eye = (low + high) / 2 + np.array([0.0, 0.5, 1.5]) * (high - low).max()
    places = model.anchors.astype(np.float64)
    there = np.zeros(len(places), bool)
    colors: list[np.ndarray] = []
    for stop in reversed(model.stops):  # the first one decides where an anchor is
        splats = evaluator.geometry(stop.x)
        color = evaluator.color(stop.x, eye.astype(np.float32)).reshape(-1, count, 3)
        opacity = np.maximum(splats[3].reshape(-1, count), 0).astype(np.float64)
        total = opacity.sum(1)
        share = opacity / np.maximum(total, 1e-9)[:, None]
        here = total > LEAST_OPACITY
        means = np.einsum("ak,aki->ai", share, splats[0].reshape(-1, count, 3))
        places[here] = means[here]
        there |= here
        colors.insert(0, np.einsum("ak,aki->ai", share, color))
    seen = places[there]
    away = cKDTree(seen).query(seen, min(2, len(seen)))[0] if len(seen) > 1 else np.zeros((1, 2))
    return AnchorLooks(places, there, np.concatenate(colors, 1), float(np.median(away[:, -1])))
