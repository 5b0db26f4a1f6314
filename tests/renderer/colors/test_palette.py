"""Palettes: their ends, their order of luminance, and how near a scene is to a thermal stop."""

import numpy as np
import pytest

from shapeshift.renderer.colors.palette import (
    LUMINANCE,
    PALETTES,
    apply_palette,
    legend_opacity,
    overlay_heat,
    palette_between,
    palette_colors,
    palette_values,
    value_blend,
)
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import BadFile, SplatLayers, Stop
from shapeshift.scene.scene import Scene, SceneObject

STOPS = (
    Stop("rgb", 0.0),
    Stop("heat", 0.4, kind="thermal", palette="ironbow", value_range=(15, 80), unit="°C"),
    Stop("open", 1.0, kind="layer"),
)


def obj(x: float, stops: tuple[Stop, ...] = STOPS, visible: bool = True) -> SceneObject:
    one = np.ones((1, 4), np.float32)
    model = SplatLayers(
        one[:, :3], one[:, :3], one, one[:, 0], one[:, :3, None].transpose(0, 2, 1),
        np.zeros(1, np.int32), stops,
    )  # fmt: skip
    return SceneObject("thing", model, x=x, visible=visible)


@pytest.mark.parametrize("name", PALETTES)
def test_every_palette_is_256_display_colors_without_a_jump(name):
    colors = palette_colors(name)
    assert colors.shape == (256, 3) and colors.dtype == np.float32
    assert np.isfinite(colors).all() and colors.min() >= 0 and colors.max() <= 1
    assert np.abs(np.diff(colors, axis=0)).max() < 0.03


@pytest.mark.parametrize("name", ["gray", "ironbow", "perceptual"])
def test_luminance_only_grows(name):
    assert (np.diff(palette_colors(name) @ LUMINANCE) > 0).all()


def test_lightness_of_the_perceptual_palette_is_nearly_even():
    display = palette_colors("perceptual").astype(float)
    linear = np.where(display > 0.04045, ((display + 0.055) / 1.055) ** 2.4, display / 12.92)
    lightness = 116 * np.cbrt(linear @ LUMINANCE) - 16  # CIE L*, a second opinion to Oklab
    steps = np.diff(lightness[8:])
    assert steps.min() > 0.2 * steps.mean() and steps.max() < 2 * steps.mean()


@pytest.mark.parametrize(
    ("name", "cold", "hot"),
    [("gray", (0, 0, 0), (1, 1, 1)), ("ironbow", (0, 0, 0.04), (1, 1, 0.96))],
)
def test_ends(name, cold, hot):
    colors = palette_colors(name)
    np.testing.assert_allclose(colors[[0, -1]], [cold, hot], atol=1e-6)


def test_turbo_is_blue_when_cold_green_in_the_middle_and_red_when_hot():
    colors = palette_colors("turbo")
    assert [int(np.argmax(colors[i])) for i in (40, 130, 240)] == [2, 1, 0]


def test_an_unknown_palette_is_named_with_those_there_are():
    with pytest.raises(BadFile, match=r"no palette 'rainbowish'.*gray, ironbow"):
        palette_colors("rainbowish")


@pytest.mark.parametrize(("x", "weight"), [(0.0, 0), (0.1, 0.25), (0.4, 1), (0.7, 0.5), (1.0, 0)])
def test_weight_is_a_hat_over_the_thermal_stop(x, weight):
    name, got, stop = value_blend(Scene((obj(x),)))
    assert got == pytest.approx(weight)
    assert (name, stop) == (("ironbow", STOPS[1]) if weight else ("", None))


def test_between_two_thermal_stops_nothing_is_taken_back():
    stops = (Stop("a", 0, "thermal", "gray"), Stop("b", 1, "thermal", "ironbow"))
    assert value_blend(Scene((obj(0.3, stops),))) == ("gray", pytest.approx(1), stops[0])
    assert value_blend(Scene((obj(0.7, stops),)))[::2] == ("ironbow", stops[1])


def test_the_nearest_visible_object_decides_and_hidden_ones_do_not():
    scene = Scene((obj(0.2), obj(0.4, visible=False), obj(0.3), obj(1.0)))
    assert value_blend(scene)[1] == pytest.approx(0.75)
    assert value_blend(Scene(())) == ("", 0.0, None)


def test_the_palette_colors_what_is_there_and_leaves_coverage_alone():
    gray = np.array([0.0, 0.25, 0.5, 1.0])
    for alpha in (1.0, 0.5):
        rgba = np.concatenate([np.repeat(gray[:, None], 3, 1), np.ones((4, 1))], 1) * alpha
        out = apply_palette(rgba[None], "ironbow")[0]
        np.testing.assert_array_equal(out[:, 3], rgba[:, 3])
        want = palette_colors("ironbow")[np.round(gray * 255).astype(int)] * alpha
        np.testing.assert_allclose(out[:, :3], want, atol=0.02)
        # The same values as heat of half the weight, beside colours of the other half.
        photo = np.array([0.1, 0.9, 0.2, 0.0]) * alpha
        heat = np.stack([gray, np.ones(4)], axis=1) * alpha / 2
        half = overlay_heat(np.broadcast_to(photo / 2, (1, 4, 4)), heat[None], "ironbow")[0]
        np.testing.assert_allclose(half[:, :3], (out[:, :3] + photo[:3]) / 2, atol=1e-9)
    empty = np.zeros((2, 2, 4))
    np.testing.assert_array_equal(apply_palette(empty, "turbo"), empty)
    np.testing.assert_array_equal(overlay_heat(empty, empty[..., :2], "turbo"), empty)


@pytest.mark.parametrize(("weight", "shown"), [(0, 0), (0.25, 0.5), (0.5, 1), (0.75, 1), (1, 1)])
def test_a_legend_fades_in_until_half_of_the_picture_is_thermal(weight, shown):
    assert legend_opacity(weight) == shown


def test_a_palette_is_laid_between_two_shares_of_the_range():
    """Its first and last colour beyond them; the table's own step, 1/255, is how sharp they are."""
    whole = palette_colors("ironbow")
    assert palette_between("ironbow", (0.0, 1.0)) is whole
    part = palette_between("ironbow", (0.2, 0.6))
    at = np.linspace(0, 1, 256)
    assert (part[at <= 0.2] == whole[0]).all() and (part[at >= 0.6] == whole[-1]).all()
    for share in (0.0, 0.25, 0.5, 1.0):
        here = palette_values(np.array([0.2 + 0.4 * share]), "ironbow", (0.2, 0.6))
        there = palette_values(np.array([share]), "ironbow")
        np.testing.assert_allclose(here, there, atol=0.02)
    rgba = np.array([[[0.4, 0.4, 0.4, 1.0]]], np.float32)
    shown = apply_palette(rgba, "gray", (0.2, 0.6))
    np.testing.assert_allclose(shown[0, 0, :3], 0.5, atol=0.01)
    for ends in ((0.5, 0.5), (0.6, 0.5), (np.nan, 1.0), (0.0, np.inf)):
        with pytest.raises(ValueError, match="heat_ends"):
            RenderSettings(heat_ends=ends)
