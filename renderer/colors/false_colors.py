"""Where false colours belong: what of each object's colours is a value stop's, and what is not.

A value stop gives values, a palette makes colours of them.  At a pure value stop the palette is
laid over the whole picture, as a thermal camera does it: values are blended before they become
colours.  Between such a stop and another one both stops' colours are decoded.  What is of values,
heat or whatever was measured, is then drawn in addition, splat by splat by its weight, and the
palette is laid over that alone: a white tool is not hot because it is white; so it is where an
object is tinted, whose tint is no value.  Where several palettes show at once there is no one
picture of values; each splat's heat is coloured before it is drawn.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.renderer.colors.palette import LUMINANCE, palette_values
from shapeshift.runtime_models.evaluate import colors_follow_control
from shapeshift.runtime_models.model import Model, SplatLayers
from shapeshift.runtime_models.stop_weights import Controls, StopWeights, same_controls
from shapeshift.scene.appearance import NEUTRAL
from shapeshift.scene.scene import Scene

NO_HEAT, PICTURE, BESIDE, SPLATS = "no heat", "picture", "beside", "splats"  # ways to show it


@dataclass(frozen=True, eq=False)
class Heat:
    """What one value stop has in the colours of an object."""

    control: Controls  # where its values are decoded
    palette: str
    weights: np.ndarray  # (1,) float32 0..1 of all, or (A,) one an anchor (layers: a splat)

    def same(self, other: "Heat") -> bool:
        named = self.palette == other.palette and same_controls(self.control, other.control)
        return named and np.array_equal(self.weights, other.weights)


@dataclass(frozen=True, eq=False)
class Shade:
    """Which colours of an object are decoded, and which of them are heat."""

    rest: Controls | None  # where the colours are decoded that are final; None: there are none
    heats: tuple[Heat, ...] = ()

    @property
    def pure(self) -> str:
        """The palette of an object that shows a value stop and nothing else; "" for others."""
        whole = len(self.heats) == 1 and (self.heats[0].weights == 1).all()
        return self.heats[0].palette if whole else ""

    def of_rows(self, rows: np.ndarray, each: int) -> "Shade":
        """That of some splats (n,), `each` of which share a weight, side by side."""
        heats = (
            replace(h, weights=h.weights if len(h.weights) == 1 else h.weights[rows // each])
            for h in self.heats
        )
        return replace(self, heats=tuple(heats))

    def same(self, other: "Shade") -> bool:
        """Whether two ask for the same colours."""
        if len(self.heats) != len(other.heats):
            return False
        if self.rest is None or other.rest is None:
            if self.rest is not other.rest:
                return False
        elif not same_controls(self.rest, other.rest):
            return False
        return all(a.same(b) for a, b in zip(self.heats, other.heats, strict=True))


@dataclass(frozen=True)
class FalseColors:
    """How a scene's colours come about."""

    way: str = NO_HEAT
    palette: str = ""  # of the picture, or of its heat
    shades: tuple[Shade, ...] = ()  # one an object


def false_colors(scene: Scene, controls: list[Controls], as_picture: bool = True) -> FalseColors:
    """What the objects' controls ask for; controls: as control_of gives them.

    as_picture: a scene that is heat and nothing else may be drawn as one picture of values.
    """
    shades = [shade_of(o.model, x) for o, x in zip(scene.objects, controls, strict=True)]
    shown = [
        shade
        for obj, shade in zip(scene.objects, shades, strict=True)
        if obj.seen and obj.model.splat_count
    ]
    names = {heat.palette for shade in shown for heat in shade.heats}
    tinted = any(obj.seen and obj.tint is not None for obj in scene.objects)
    if as_picture and len(names) == 1 and all(shade.pure for shade in shown) and not tinted:
        plain = [
            Shade(x if colors_follow_control(obj.model) else 0.0)
            for obj, x in zip(scene.objects, controls, strict=True)
        ]
        return FalseColors(PICTURE, names.pop(), tuple(plain))
    way = (NO_HEAT, BESIDE)[len(names)] if len(names) < 2 else SPLATS
    return FalseColors(way, names.pop() if len(names) == 1 else "", tuple(shades))


def has_heat(model: Model) -> bool:
    """Whether a frame of the model between two stops can hold heat that palettes colour."""
    return any(stop.has_false_colors for stop in model.blend.stops)


def shade_of(model: Model, control: Controls) -> Shade:
    """The colours that a model shows at a control, or at one an anchor."""
    control_of_colors = control if colors_follow_control(model) else 0.0
    rows = np.atleast_2d(model.blend.weights(control))  # (1, S) or (A, S)
    measured = [
        s for s, stop in enumerate(model.blend.stops) if stop.has_false_colors and rows[:, s].any()
    ]
    if not measured:
        return Shade(control_of_colors)
    if isinstance(model, SplatLayers) and model.mode == "exclusive":
        return _shade_of_layers(model, rows, measured)
    stops, others = model.blend.stops, np.delete(rows, measured, axis=1)
    if not others.any() and len(measured) == 1:  # what lies beyond its stop is that stop's, too
        whole = np.ones(1, np.float32)
        return Shade(None, (Heat(control_of_colors, stops[measured[0]].palette, whole),))
    heats = [
        Heat(stops[s].x, stops[s].palette, np.asarray(rows[:, s], np.float32)) for s in measured
    ]
    return Shade(_without(model, rows, measured) if others.any() else None, tuple(heats))


def _without(model: Model, rows: np.ndarray, measured: list[int]) -> Controls:
    """The blend of the other stops alone, in the same proportion."""
    kept = rows.copy()
    kept[:, measured] = 0
    total = kept.sum(axis=1, keepdims=True)
    kept = np.where(total > 0, kept / np.where(total > 0, total, 1), rows)  # else: does not matter
    if len(rows) > 1:
        return kept.astype(np.float32)
    names = model.blend.names
    return StopWeights(tuple((names[s], float(kept[0, s])) for s in np.flatnonzero(kept[0])))


def _shade_of_layers(model: SplatLayers, rows: np.ndarray, measured: list[int]) -> Shade:
    """Each splat is of one layer: heat or not, as its stop is; how much shows is its opacity."""
    pure = not np.delete(rows, measured, axis=1).any() and len(measured) == 1
    heats = []
    for s in measured:
        of_stop = np.ones(1) if pure else model.layer == s
        heats.append(Heat(0.0, model.stops[s].palette, np.asarray(of_stop, np.float32)))
    return Shade(None if pure else 0.0, tuple(heats))


ColorAt = Callable[[Controls], np.ndarray]  # (N, 3) display sRGB as decoded at a control
Grade = Callable[[np.ndarray], np.ndarray]  # of colours (N, 3)


def split_colors(
    shade: Shade, count: int, color_at: ColorAt, grade: Grade = NEUTRAL.graded
) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) what of the colours is not heat, and (N, 2) value times weight, and weight: the slow
    twin of the heat passes.  grade: of the appearance, for what is not heat.
    """
    heat = np.zeros((count, 2))
    for part in shade.heats:
        weights = _of_splats(part.weights, count)
        value = np.where(weights > 0, color_at(part.control) @ LUMINANCE, 0)
        heat += weights[:, None] * np.stack([value, np.ones(count)], axis=1)
    return _kept(shade, heat, color_at, grade), heat


def mixed_colors(
    shade: Shade, count: int, color_at: ColorAt, grade: Grade = NEUTRAL.graded
) -> np.ndarray:
    """(N, 3) display sRGB with each splat's heat in the colours of its palettes."""
    heat, colors = np.zeros((count, 2)), np.zeros((count, 3))
    for part in shade.heats:
        weights = _of_splats(part.weights, count)
        false = palette_values(color_at(part.control) @ LUMINANCE, part.palette)
        colors += np.where(weights[:, None] > 0, weights[:, None] * false, 0)
        heat[:, 1] += weights
    return _kept(shade, heat, color_at, grade) + colors


def _kept(shade: Shade, heat: np.ndarray, color_at: ColorAt, grade: Grade) -> np.ndarray:
    """(N, 3) the colours that are not heat, times what is left for them."""
    kept = np.maximum(1 - heat[:, 1:], 0)
    rest = np.zeros((len(heat), 3))
    if shade.rest is not None:
        rest = np.where(kept > 0, kept * grade(color_at(shade.rest)), 0)
    return np.where(np.isfinite(heat[:, :1]), rest, np.nan)


def _of_splats(weights: np.ndarray, count: int) -> np.ndarray:
    return np.repeat(weights.astype(np.float64), -(-count // len(weights)))[:count]
