"""Where false colours belong: to the whole picture, or to each splat before it is blended.

A palette laid over the picture is what a thermal camera does, and costs least.  It is right as long
as everything that shows has the same control value; where parts differ, each splat is tinted.
"""

from dataclasses import dataclass

import numpy as np

from renderer.palette import LUMINANCE, STEPS, palette_colors, thermal_weights
from runtime_models.model import Model, SplatLayers
from runtime_models.stop_weights import Controls
from scene.scene import Scene


@dataclass(frozen=True, eq=False)
class Tint:
    """How much of a palette each anchor of one object takes (layers: each splat)."""

    name: str
    weights: np.ndarray  # (A,) float32 0..1


@dataclass(frozen=True)
class FalseColors:
    """Either one palette for the picture, or a tint an object (None: its colours are final)."""

    name: str = ""  # of the picture; "": nothing to do
    weight: float = 0.0
    tints: tuple[Tint | None, ...] | None = None


def false_colors(scene: Scene, controls: list[Controls]) -> FalseColors:
    """What the objects' control values ask for; controls: as control_of gives them."""
    asked = []  # (name, weights (n,)) an object, n = 1 for one value
    for thing, x in zip(scene.objects, controls, strict=True):
        weights, stop = thermal_weights(thing.model.blend, x)
        named = stop is not None and stop.palette and weights.any()
        asked.append((stop.palette, weights) if named else ("", np.zeros(1)))
    shown = [
        (name, tuple(weights[:1]) if (weights == weights[0]).all() else None)
        for thing, (name, weights) in zip(scene.objects, asked, strict=True)
        if thing.visible and thing.model.splat_count
    ]
    if all(one == shown[0] and one[1] is not None for one in shown):
        return FalseColors(shown[0][0], float(shown[0][1][0])) if shown else FalseColors()
    tints = []
    for thing, (name, weights) in zip(scene.objects, asked, strict=True):
        every = np.broadcast_to(np.float32(weights), count_controls(thing.model))
        tints.append(Tint(name, np.ascontiguousarray(every)) if name else None)
    return FalseColors(tints=tuple(tints))


def same_tint(one: Tint | None, other: Tint | None) -> bool:
    if one is None or other is None:
        return one is other
    return one.name == other.name and np.array_equal(one.weights, other.weights)


def count_controls(model: Model) -> int:
    """How many parts of a model can have a control value of their own."""
    return model.splat_count if isinstance(model, SplatLayers) else len(model.anchors)


def tinted(color: np.ndarray, name: str, weights: np.ndarray) -> np.ndarray:
    """(N, 3) display sRGB mixed towards palette[luminance] by the weights (N,): the slow twin of
    the tint passes.
    """
    place = np.clip(color @ LUMINANCE, 0, 1) * (STEPS - 1)
    false = np.stack([np.interp(place, np.arange(STEPS), c) for c in palette_colors(name).T], -1)
    mixed = color + (false - color) * weights[:, None]
    usable = (weights > 0) & np.isfinite(color).all(axis=1)
    return np.where(usable[:, None], mixed, color)
