"""Palettes of value stops, and how much of a palette the control value asks for."""

from functools import cache, lru_cache

import numpy as np

from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.stop_weights import Controls, StopBlend
from shapeshift.scene.appearance import Background, Color, Sky
from shapeshift.scene.control import controls_within
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # Rec. 709, used on display values
STEPS = 256
ALL_VALUES = (0.0, 1.0)  # shares of a stop's range that the ends of its palette stand for
LEAST_SHARE = 0.002  # between the two ends
ROWS = 32  # of a picture at a time: they stay in the cache

# (place in 0..1, display sRGB): what a thermal camera shows, cold to hot; luminance only grows
IRONBOW = (
    (0.00, (0.00, 0.00, 0.04)),
    (0.15, (0.13, 0.00, 0.42)),
    (0.30, (0.45, 0.00, 0.60)),
    (0.45, (0.73, 0.12, 0.55)),
    (0.60, (0.91, 0.34, 0.20)),
    (0.75, (0.98, 0.60, 0.05)),
    (0.90, (1.00, 0.87, 0.33)),
    (1.00, (1.00, 1.00, 0.96)),
)
# blue to red through green, smooth at its ends: many distinct hues, luminance highest in the middle
TURBO = (
    (0.00, (0.18, 0.07, 0.25)),
    (0.12, (0.27, 0.37, 0.86)),
    (0.28, (0.16, 0.70, 0.96)),
    (0.42, (0.13, 0.93, 0.66)),
    (0.55, (0.55, 0.99, 0.29)),
    (0.68, (0.90, 0.85, 0.21)),
    (0.80, (0.98, 0.56, 0.16)),
    (0.90, (0.85, 0.26, 0.05)),
    (1.00, (0.48, 0.02, 0.01)),
)
# Tables of others, CC0, through some of their points to 2/255: the colours of
# S. van der Walt and N. Smith (2015), equal steps of lightness and readable with any colour vision,
VIRIDIS = (
    (0.0000, (0.267, 0.005, 0.329)),
    (0.0824, (0.283, 0.121, 0.441)),
    (0.1686, (0.267, 0.228, 0.514)),
    (0.2784, (0.216, 0.352, 0.551)),
    (0.4314, (0.152, 0.501, 0.558)),
    (0.5020, (0.128, 0.567, 0.551)),
    (0.5451, (0.120, 0.607, 0.540)),
    (0.5843, (0.126, 0.644, 0.525)),
    (0.6471, (0.181, 0.701, 0.488)),
    (0.7843, (0.440, 0.811, 0.341)),
    (0.8824, (0.689, 0.865, 0.183)),
    (0.9333, (0.825, 0.885, 0.106)),
    (0.9529, (0.876, 0.891, 0.095)),
    (0.9686, (0.916, 0.896, 0.101)),
    (1.0000, (0.993, 0.906, 0.144)),
)
# and of J. Nunez, C. Anderton and R. Renslow (2018): with red-green blindness the same as without
CIVIDIS = (
    (0.0000, (0.000, 0.135, 0.305)),
    (0.0510, (0.000, 0.171, 0.393)),
    (0.0784, (0.000, 0.189, 0.440)),
    (0.0902, (0.004, 0.196, 0.442)),
    (0.1020, (0.046, 0.204, 0.440)),
    (0.1255, (0.103, 0.220, 0.436)),
    (0.2078, (0.218, 0.278, 0.424)),
    (0.3961, (0.398, 0.409, 0.440)),
    (0.5020, (0.489, 0.485, 0.471)),
    (0.7020, (0.684, 0.639, 0.444)),
    (0.8235, (0.811, 0.741, 0.385)),
    (0.9373, (0.937, 0.844, 0.281)),
    (0.9686, (0.973, 0.874, 0.235)),
    (0.9843, (0.992, 0.888, 0.205)),
    (1.0000, (0.996, 0.909, 0.218)),
)
# violet, blue, green, yellow, red, pale: more hues than ironbow, which thermographers use for small
# differences
RAINBOW = (
    (0.00, (0.05, 0.00, 0.20)),
    (0.16, (0.22, 0.08, 0.72)),
    (0.34, (0.05, 0.50, 0.85)),
    (0.50, (0.10, 0.74, 0.32)),
    (0.66, (0.90, 0.84, 0.12)),
    (0.82, (0.92, 0.25, 0.08)),
    (1.00, (1.00, 0.88, 0.86)),
)
# blue below, gold above, so that cold and hot part at a look
ARCTIC = (
    (0.00, (0.02, 0.02, 0.20)),
    (0.22, (0.06, 0.16, 0.52)),
    (0.42, (0.28, 0.36, 0.62)),
    (0.56, (0.52, 0.48, 0.50)),
    (0.72, (0.76, 0.58, 0.30)),
    (0.88, (0.96, 0.76, 0.28)),
    (1.00, (1.00, 0.96, 0.76)),
)


@cache
def palette_colors(name: str) -> np.ndarray:
    """(256, 3) float32 display sRGB of a palette, read only; BadFile for an unknown name."""
    if name not in PALETTES:
        known = ", ".join(PALETTES)
        raise BadFile(f"there is no palette {name!r}; a stop of values may name one of: {known}.")
    colors = PALETTES[name]().astype(np.float32)
    colors.flags.writeable = False
    return colors


@lru_cache(maxsize=64)
def palette_between(name: str, ends: tuple[float, float]) -> np.ndarray:
    """(256, 3) float32 display sRGB: the palette laid between two shares of the range, its first
    and last colour beyond them; the very table of `palette_colors` for ALL_VALUES.
    """
    if ends == ALL_VALUES:
        return palette_colors(name)
    low, high = ends
    share = (np.linspace(0, 1, STEPS) - low) / max(high - low, LEAST_SHARE)
    colors = palette_values(share, name).astype(np.float32)
    colors.flags.writeable = False
    return colors


def value_blend(scene: Scene) -> tuple[str, float, Stop | None]:
    """(palette name, weight 0..1, stop) of the visible object that is nearest to a value stop, or
    has a part that is: what a legend tells.

    The weight is 1 at a value stop and falls to 0 at the next stop that shows no values.
    Name "" (the stop's colours are final) and weight 0: nothing to do.
    """
    best: tuple[str, float, Stop | None] = ("", 0.0, None)
    for obj in scene.objects:
        for x in controls_within(obj) if obj.seen else ():
            weights, stop = value_weights(obj.model.blend, x)
            if stop is not None and weights[0] > best[1]:
                best = (stop.palette, float(weights[0]), stop)
    return best


def value_weights(blend: StopBlend, controls: Controls) -> tuple[np.ndarray, Stop | None]:
    """(n,) 0..1: how much of a palette each of n controls asks for; and the value stop that is
    nearest to most of them, None where no stop shows values.
    """
    rows = np.atleast_2d(blend.weights(controls))  # (n, S)
    measured = [s for s, stop in enumerate(blend.stops) if stop.is_measured]
    if not measured or not len(rows):
        return np.zeros(len(rows)), None
    nearest = measured[int(np.argmax(rows[:, measured].sum(axis=0)))]
    return np.minimum(rows[:, measured].sum(axis=1), 1.0), blend.stops[nearest]


def legend_opacity(weight: float) -> float:
    """How much of a value stop's legend is seen at its weight: all from one half on."""
    return min(2 * weight, 1.0)


def apply_palette(
    rgba: np.ndarray, name: str, ends: tuple[float, float] = ALL_VALUES
) -> np.ndarray:
    """Premultiplied (H, W, 4) with palette[luminance] for its colour; same shape.

    The palette colours what is there, not the background: colour is divided by alpha first.
    """
    alpha = rgba[..., 3]
    false = palette_values((rgba[..., :3] @ LUMINANCE) / np.maximum(alpha, 1e-6), name, ends)
    shown = [false * alpha[..., None], alpha[..., None]]
    return np.concatenate(shown, axis=-1).astype(rgba.dtype)


def overlay_heat(
    rgba: np.ndarray, heat: np.ndarray, name: str, ends: tuple[float, float] = ALL_VALUES
) -> np.ndarray:
    """Premultiplied (H, W, 4) and its heat, (H, W, 2) value and weight, both times alpha:
    with the palette's colour of the value, as much as the weight; as (H, W, 4).
    """
    value, weight = heat[..., 0], heat[..., 1]
    false = palette_values(value / np.maximum(weight, 1e-6), name, ends)
    out = rgba.copy()
    out[..., :3] += false * weight[..., None]
    return out


def behind(background: Background, view: View) -> np.ndarray:
    """(3,) or (H, W, 3) float32 display sRGB: what a view has behind everything."""
    if isinstance(background, Sky):
        return background.picture(view)
    return np.asarray(background, np.float32)


def over_background(
    rgba: np.ndarray, background: np.ndarray | Color, out: np.ndarray | None = None
) -> np.ndarray:
    """(H, W, 3) of premultiplied (H, W, 4): what is seen before a background, display sRGB, of
    (3,) or (H, W, 3).

    out: written to and given back, where there is one.  A channel and some rows at a time: the
    loops over three numbers that numpy would make of the whole take four times as long.
    """
    if out is None:
        out = np.empty((*rgba.shape[:2], 3), rgba.dtype)
    shown = np.asarray(background, np.float32)
    for first in range(0, len(rgba), ROWS):
        part = rgba[first : first + ROWS]
        through = 1 - part[..., 3]
        here = shown[first : first + ROWS] if shown.ndim == 3 else shown
        for c in range(3):
            out[first : first + ROWS, :, c] = part[..., c] + through * here[..., c]
    return out


def palette_values(
    values: np.ndarray, name: str, ends: tuple[float, float] = ALL_VALUES
) -> np.ndarray:
    """(..., 3) display sRGB of values (...), held to 0..1; NaN stays."""
    place = np.clip(values, 0, 1) * (STEPS - 1)
    colors = palette_between(name, ends)
    return np.stack([np.interp(place, np.arange(STEPS), c) for c in colors.T], axis=-1)


def _gray() -> np.ndarray:
    return np.repeat(np.linspace(0, 1, STEPS)[:, None], 3, axis=1)


def _palette_table(points: tuple) -> np.ndarray:
    """(256, 3) through control points by monotone cubics: no overshoot, no visible corner."""
    place = np.array([p for p, _ in points])
    color = np.array([c for _, c in points])
    step = np.diff(place)[:, None]
    rise = np.diff(color, axis=0) / step
    same_sign = rise[:-1] * rise[1:] > 0
    total = np.where(same_sign, rise[:-1] + rise[1:], 1.0)
    inner = np.where(same_sign, 2 * rise[:-1] * rise[1:] / total, 0.0)  # harmonic mean
    slope = np.concatenate([rise[:1], inner, rise[-1:]])
    at = np.linspace(0, 1, STEPS)
    i = np.clip(np.searchsorted(place, at, side="right") - 1, 0, len(place) - 2)
    t = ((at - place[i]) / step[i, 0])[:, None]
    curve = (
        (1 + 2 * t) * (1 - t) ** 2 * color[i]
        + t * (1 - t) ** 2 * step[i] * slope[i]
        + t**2 * (3 - 2 * t) * color[i + 1]
        + t**2 * (t - 1) * step[i] * slope[i + 1]
    )
    return np.clip(curve, 0, 1)


def _perceptual() -> np.ndarray:
    """Equal steps of Oklab lightness from dark violet to pale yellow: equal steps look equal."""
    t = np.linspace(0, 1, STEPS)
    lightness = 0.16 + 0.80 * t
    hue = np.radians(-75 + 185 * t)  # violet, red, orange, yellow
    chroma = 0.03 + 0.16 * np.sin(np.pi * (0.08 + 0.84 * t))
    oklab = np.stack([lightness, chroma * np.cos(hue), chroma * np.sin(hue)], axis=1)
    return np.clip(_srgb_from_oklab(oklab), 0, 1)


def _srgb_from_oklab(oklab: np.ndarray) -> np.ndarray:
    """(N, 3) display sRGB; the two matrices of B. Ottosson, "A perceptual color space" (2020)."""
    lms_from_lab = [
        [1, 0.3963377774, 0.2158037573],
        [1, -0.1055613458, -0.0638541728],
        [1, -0.0894841775, -1.2914855480],
    ]
    rgb_from_lms = [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
    linear = (oklab @ np.transpose(lms_from_lab)) ** 3 @ np.transpose(rgb_from_lms)
    linear = np.clip(linear, 0, 1)
    return np.where(linear > 0.0031308, 1.055 * linear ** (1 / 2.4) - 0.055, 12.92 * linear)


PALETTES = {
    "gray": _gray,
    "ironbow": lambda: _palette_table(IRONBOW),
    "turbo": lambda: _palette_table(TURBO),
    "perceptual": _perceptual,
    "viridis": lambda: _palette_table(VIRIDIS),
    "cividis": lambda: _palette_table(CIVIDIS),
    "white-hot": _gray,  # gray, by the name that it has on thermal cameras
    "black-hot": lambda: _gray()[::-1],
    "rainbow": lambda: _palette_table(RAINBOW),
    "arctic": lambda: _palette_table(ARCTIC),
}
