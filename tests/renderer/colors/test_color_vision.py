"""Legends without one kind of cones: order of palettes and ramps, colours told apart.

Two formulas that share nothing: Machado, Oliveira and Fernandes 2009 (a matrix each, fitted to
opponent colours) and the half planes of Brettel, Vienot and Mollon 1997 in the cones' own
responses, by Smith and Pokorny; lightness and differences are CIE L*a*b* of both.
"""

from itertools import combinations

import numpy as np
import pytest

from shapeshift.renderer.colors.palette import PALETTES, palette_colors
from shapeshift.renderer.debug.debug import DISTANT, HEAT, REASON_COLORS, ramp
from shapeshift.scene.four_views import DISTINCT

KINDS = ("protan", "deutan", "tritan")  # without long, middle, short waves
MACHADO = {  # severity 1, of linear sRGB
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
               [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
               [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
               [0.004733, 0.691367, 0.303900]],
}  # fmt: skip
XYZ_FROM_RGB = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
     [0.0193339, 0.1191920, 0.9503041]]
)  # fmt: skip
# Cones by Smith and Pokorny 1975 from XYZ as Judd and Vos have it; near enough to CIE 1931 here.
CONES_FROM_XYZ = np.array(
    [[0.15514, 0.54312, -0.03286], [-0.15514, 0.45684, 0.03286], [0.0, 0.0, 0.01608]]
)
# XYZ of lights that look the same with and without one kind of cones, nm: CIE 1931.
SAME = {
    475: (0.1421, 0.1126, 1.0419), 485: (0.05795, 0.1693, 0.6162),
    575: (0.8425, 0.9154, 0.0018), 660: (0.1649, 0.0610, 0.0),
}  # fmt: skip
ANCHORS = {"protan": (475, 575), "deutan": (475, 575), "tritan": (485, 660)}
WAYS = ("all cones", *(f"{kind}, {by}" for kind in KINDS for by in ("machado", "brettel")))


def linear(display: np.ndarray) -> np.ndarray:
    display = np.asarray(display, np.float64)
    return np.where(display > 0.04045, ((display + 0.055) / 1.055) ** 2.4, display / 12.92)


def seen(colors: np.ndarray, way: str) -> np.ndarray:
    """(N, 3) linear sRGB as seen that way, held to what a display shows."""
    rgb = linear(colors)
    if way == "all cones":
        return rgb
    kind, by = way.split(", ")
    matrix = np.array(MACHADO[kind]) if by == "machado" else None
    found = rgb @ matrix.T if matrix is not None else brettel(rgb, kind)
    return found.clip(0, 1)


def brettel(rgb: np.ndarray, kind: str) -> np.ndarray:
    """(N, 3): the lost response is that of the half plane through white and an anchor."""
    cones_from_rgb = CONES_FROM_XYZ @ XYZ_FROM_RGB
    cones, white = rgb @ cones_from_rgb.T, cones_from_rgb.sum(axis=1)
    lost = KINDS.index(kind)
    kept = [axis for axis in range(3) if axis != lost]
    short, long = (CONES_FROM_XYZ @ SAME[nm] for nm in ANCHORS[kind])
    # Which of both half planes: by the angle to white in the plane of the two that are kept.
    first, second = kept if kind != "tritan" else kept[::-1]
    side = cones[:, second] * white[first] > cones[:, first] * white[second]
    of_short = short[second] * white[first] > short[first] * white[second]
    out = cones.copy()
    for anchor, rows in ((short, side == of_short), (long, side != of_short)):
        normal = np.cross(white, anchor)  # the plane: normal . cones = 0
        out[rows, lost] = -(cones[rows][:, kept] @ normal[kept]) / normal[lost]
    return out @ np.linalg.inv(cones_from_rgb).T


def lab(rgb: np.ndarray) -> np.ndarray:
    """(N, 3) CIE L*a*b* of linear sRGB, white D65."""
    part = rgb @ XYZ_FROM_RGB.T / XYZ_FROM_RGB.sum(axis=1)
    f = np.where(part > 216 / 24389, np.cbrt(part), (24389 / 27 * part + 16) / 116)
    rows = [116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])]
    return np.stack(rows, axis=1)


def least_apart(colors: np.ndarray, way: str) -> float:
    """The smallest difference of any two."""
    places = lab(seen(colors, way))
    return min(float(np.linalg.norm(a - b)) for a, b in combinations(places, 2))


TURNING = ("turbo", "rainbow")  # many hues, for small differences
RAMPS = {name: palette_colors(name) for name in PALETTES} | {
    "overdraw": ramp(HEAT, np.linspace(0, 1, 256)), "depth": ramp(DISTANT, np.linspace(0, 1, 256)),
}  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
def test_white_and_grays_stay(way):
    """The simulations themselves: what has no hue keeps its lightness to 1, and stays without."""
    grays = np.repeat(np.linspace(0, 1, 9)[:, None], 3, axis=1)
    assert np.abs(lab(seen(grays, way)) - lab(linear(grays))).max() < 1


@pytest.mark.parametrize("kind", KINDS)
def test_red_and_green_meet_where_their_cones_are_gone(kind):
    """Both formulas say who confuses what: a red and a green of one lightness; blue, green."""
    pairs = {
        "protan": ((0.80, 0.20, 0.20), (0.40, 0.36, 0.20)),
        "deutan": ((0.75, 0.35, 0.20), (0.47, 0.50, 0.20)),
        "tritan": ((0.30, 0.55, 0.75), (0.30, 0.58, 0.55)),
    }
    for by in ("machado", "brettel"):
        way, pair = f"{kind}, {by}", np.array(pairs[kind])
        assert least_apart(pair, way) < 0.5 * least_apart(pair, "all cones")


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", [name for name in RAMPS if name not in TURNING])
def test_lighter_is_more_for_every_eye(name, way):
    """Steps of 1/32 each are lighter than the one before, by what can be seen side by side."""
    ramp = RAMPS[name][::-1] if name == "black-hot" else RAMPS[name]
    lightness = lab(seen(ramp, way))[:, 0]
    assert np.diff(lightness[::8]).min() > 0.5
    assert lightness[-1] - lightness[0] > 65


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", TURNING)
def test_the_lightness_of_turbo_and_rainbow_turns_back(name, way):
    """So their tip leaves them out, and the test above can fail."""
    assert np.diff(lab(seen(RAMPS[name], way))[:, 0]).min() < -0.5


@pytest.mark.parametrize("way", ["protan, machado", "deutan, machado"])
def test_cividis_is_nearly_the_same_without_a_kind_of_cones(way):
    """What it was made for; others change many times as much."""
    change = {
        name: np.linalg.norm(lab(seen(RAMPS[name], way)) - lab(linear(RAMPS[name])), axis=1).mean()
        for name in ("cividis", "viridis", "ironbow")
    }
    assert change["cividis"] < 0.5 * min(change["viridis"], change["ironbow"])


@pytest.mark.parametrize("way", WAYS)
def test_colours_of_reasons_and_of_objects_are_told_apart(way):
    """A difference of 2.3 can be seen side by side; from a legend to the picture takes more."""
    reasons = np.array([*REASON_COLORS.values(), (0.09, 0.09, 0.10)])  # and the legend's ground
    assert least_apart(reasons, way) > 25
    assert least_apart(np.array(DISTINCT), way) > 25
