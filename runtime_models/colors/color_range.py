"""Between which display values all colours of a model lie, from whatever side and at whatever x."""

import math

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.model import Mlp, Model, SplatLayers

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
