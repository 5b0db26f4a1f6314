"""Shapes by rule: what becomes of the source stop's splats, in a few lines each.

A rule is a function of the splats that a stop shows, where they are, to what they shall be.  What
it asks for is brought into the reach of the networks by add_style.py: a splat stays within 2 voxels
of its anchor, in the anchor's own axes and sizes, which are flat on surfaces.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.model import Splats
from shapeshift.runtime_models.rotation import normalize, product, rotation_matrices

UP = np.array([0.0, 1.0, 0.0])
BRIGHTNESS = (0.7, 1.25)  # of the splats of an anchor from first to last: strands are told apart
SIZES = (0.6, 1.6)  # of the usual grain, between which that of a hair or a stroke stays


@dataclass(frozen=True)
class Surroundings:
    """What a rule may know beside the splats themselves; N = A * k."""

    each: int  # k, splats of an anchor, side by side
    slot: np.ndarray  # (N,) 0..1: first to last of the splats of an anchor
    grain: np.ndarray  # (N,) metres: how far anchors are from each other about a splat
    normal: np.ndarray  # (N, 3) unit: across the surface that a splat lies on
    centre: np.ndarray  # (3,) metres, of the scene
    radius: float  # metres
    floor: float  # metres: y of its lowest part

    @property
    def usual_grain(self) -> float:
        """Metres."""
        return float(np.median(self.grain))

    @property
    def even_grain(self) -> np.ndarray:
        """(N,) metres, nowhere far from the usual."""
        low, high = SIZES
        return np.clip(self.grain, low * self.usual_grain, high * self.usual_grain)


Rule = Callable[[Splats, Surroundings], Splats]


def fur(splats: Splats, near: Surroundings) -> Splats:
    """Hairs: thin, long, standing up and outwards, leaning as wind goes over them."""
    lean = waves(splats.means / (0.3 * near.radius))  # (N, 3) -1..1
    way = unit(UP + 0.5 * outwards(splats, near) + 0.45 * lean)
    length, width = near.even_grain * (1.1 + 0.6 * near.slot), 0.16 * near.even_grain
    made = replace(
        splats,
        means=splats.means + way * length[:, None],
        scales=np.stack([width, length, width], axis=1),
        wxyz=upright(way),
        opacity=solid(splats.opacity, 0.75),
        color=strands(splats, near),
    )
    return where_present(splats, made)


def blocks(splats: Splats, near: Surroundings) -> Splats:
    """Bricks: all splats of a cell share one place, size and colour."""
    cell = 3.5 * near.usual_grain
    corner = np.floor(splats.means / cell)
    _, of = np.unique(corner.astype(np.int64), axis=0, return_inverse=True)
    of, weight = of.ravel(), np.clip(splats.opacity, 0, 1) + 1e-6
    total = np.bincount(of, weight)
    color = np.stack([np.bincount(of, weight * c) / total for c in splats.color.T], axis=1)[of]
    made = replace(
        splats,
        means=(corner + 0.5) * cell,
        scales=np.full(splats.means.shape, 0.27 * cell),
        wxyz=upright(np.broadcast_to(UP, splats.means.shape)),
        opacity=solid(splats.opacity, 0.6),
        color=color,
    )
    return where_present(splats, made)


def bubbles(splats: Splats, near: Surroundings) -> Splats:
    """Soap: of each anchor a round bubble, half transparent, and on it a small white light."""
    ball, light = near.slot < 0.2, near.slot > 0.8
    size = near.even_grain * np.where(light, 0.16, 0.62)
    aside = np.where(light, 0.35, 0.0) * near.even_grain
    sheen = 0.5 + 0.5 * waves(splats.means / (0.15 * near.radius))
    color = 0.8 * own_color(splats, near) + 0.2 * sheen
    made = replace(
        splats,
        means=splats.means + aside[:, None] * unit(UP + outwards(splats, near)),
        scales=np.repeat(size[:, None], 3, axis=1),
        opacity=np.where(ball | light, solid(splats.opacity, 0.6), -0.5),
        color=np.where(light[:, None], 0.97, color),
    )
    return where_present(splats, made)


def points(splats: Splats, near: Surroundings) -> Splats:
    """Dots: as if a laser scanner had seen them."""
    dot = np.full(splats.means.shape, 0.17 * near.usual_grain)
    made = replace(splats, scales=dot, opacity=solid(splats.opacity, 0.95))
    return where_present(splats, replace(made, color=own_color(splats, near)))


def melt(splats: Splats, near: Surroundings) -> Splats:
    """Wax: what is high sinks most, runs down in drops, and spreads."""
    high = np.clip((splats.means[:, 1] - near.floor) / near.radius, 0, 1.5)
    run = 0.5 + 0.5 * waves(splats.means[:, [0, 2, 0]] / (0.08 * near.radius))[:, 0]
    down = near.even_grain * (0.5 + 3.5 * run**2) * (0.5 + high)
    size = np.stack([0.55 * near.even_grain, 0.6 * down, 0.55 * near.even_grain], axis=1)
    made = replace(
        splats,
        means=splats.means - UP * down[:, None],
        scales=size,
        wxyz=upright(np.broadcast_to(UP, splats.means.shape)),
        opacity=solid(splats.opacity, 0.4),
        color=own_color(splats, near),
    )
    return where_present(splats, made)


def explode(splats: Splats, near: Surroundings) -> Splats:
    """Splinters: away from the middle as far as they reach, smaller, turned about themselves."""
    way = unit(outwards(splats, near) + 0.8 * waves(splats.means / (0.1 * near.radius)))
    far = near.grain * (0.8 + 1.6 * near.slot)
    made = replace(
        splats,
        means=splats.means + way * far[:, None],
        scales=near.even_grain[:, None] * [0.12, 0.5, 0.12],
        wxyz=upright(way),
        opacity=solid(splats.opacity, 0.9),
        color=own_color(splats, near),
    )
    return where_present(splats, made)


def strokes(splats: Splats, near: Surroundings) -> Splats:
    """Paint: broad strokes that lie on the surfaces and follow a swirl, each of one colour."""
    normal = near.normal
    swirl = waves(splats.means / (0.4 * near.radius))
    along = unit(swirl - normal * (swirl * normal).sum(axis=1, keepdims=True))
    long = near.even_grain * (0.9 + 0.7 * near.slot)
    made = replace(
        splats,
        scales=np.stack([long, 0.05 * near.even_grain, 0.28 * long], axis=1),
        wxyz=lying(normal, along),
        opacity=solid(splats.opacity, 0.8),
        color=strands(splats, near),
    )
    return where_present(splats, made)


RULES: dict[str, Rule] = {
    "fur": fur, "blocks": blocks, "bubbles": bubbles, "points": points, "melt": melt,
    "explode": explode, "strokes": strokes,
}  # fmt: skip


def where_present(before: Splats, after: Splats) -> Splats:
    """The rule's splats where the source stop has some, absent ones as they are."""
    there = before.opacity > 0
    tables = {
        name: np.where(there[:, None], getattr(after, name), getattr(before, name))
        for name in ("means", "scales", "wxyz", "color")
    }
    return replace(after, opacity=np.where(there, after.opacity, before.opacity), **tables)


def solid(opacity: np.ndarray, most: float) -> np.ndarray:
    """(N,) opacities of splats that are smaller now: 0.1, where a thing is thin, becomes half."""
    return most * (1 - np.exp(-7 * np.clip(opacity, 0, 1)))


def own_color(splats: Splats, near: Surroundings) -> np.ndarray:
    """(N, 3) half of a splat's own, half the mean of its anchor's: single splats show so, of which
    only the sum was right before.
    """
    weight = np.clip(splats.opacity, 0, 1).reshape(-1, near.each, 1) + 1e-6
    own = splats.color.reshape(-1, near.each, 3)
    mean = (weight * own).sum(axis=1, keepdims=True) / weight.sum(axis=1, keepdims=True)
    return (0.5 * own + 0.5 * mean).reshape(-1, 3)


def strands(splats: Splats, near: Surroundings) -> np.ndarray:
    """(N, 3) darker to lighter from the first splat of an anchor to its last."""
    low, high = BRIGHTNESS
    return np.clip(own_color(splats, near) * (low + (high - low) * near.slot)[:, None], 0, 1)


def waves(places: np.ndarray) -> np.ndarray:
    """(N, 3) of -1..1 that vary smoothly over places (N, 3), one wave a unit or so."""
    x, y, z = 2 * np.pi * places.T.astype(np.float64)
    return np.stack(
        [
            np.sin(x + 1.7 * np.sin(0.7 * z)) * np.cos(0.9 * y),
            np.sin(y + 1.3 * np.sin(0.8 * x)) * np.cos(1.1 * z),
            np.sin(z + 1.5 * np.sin(0.6 * y)) * np.cos(x),
        ],
        axis=1,
    )


def outwards(splats: Splats, near: Surroundings) -> np.ndarray:
    """(N, 3) unit, away from the middle of the scene."""
    return unit(splats.means.astype(np.float64) - near.centre)


def unit(vectors: np.ndarray) -> np.ndarray:
    """(N, 3) of length 1; what is nearly nothing points up."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 1e-9, vectors / np.maximum(length, 1e-9), UP)


def upright(way: np.ndarray) -> np.ndarray:
    """(N, 4) the shortest turns that take +Y to unit vectors (N, 3)."""
    x, y, z = way.T.astype(np.float64)
    return normalize(np.stack([1 + y + 1e-9, z, np.zeros_like(x), -x], axis=1))


def lying(normal: np.ndarray, along: np.ndarray) -> np.ndarray:
    """(N, 4) turns that take +Y to `normal` and +X to `along`, unit and at right angles (N, 3)."""
    first = upright(normal)
    axes = rotation_matrices(first)
    angle = np.arctan2(-(along * axes[:, :, 2]).sum(axis=1), (along * axes[:, :, 0]).sum(axis=1))
    about = np.stack([np.cos(angle / 2), 0 * angle, np.sin(angle / 2), 0 * angle], axis=1)
    return product(first, about)
