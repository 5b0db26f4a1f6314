"""The name of the stop on the glass's rim, and its scale: colours, values, unit."""

import numpy as np
import pytest

from shapeshift.renderer.colors.palette import palette_colors
from shapeshift.runtime_models.model import Stop
from shapeshift.vr.cards import METRES_PER_PIXEL, PAD_PX
from shapeshift.vr.glass import BAR_PX, RADIUS_M, GlassScale, cards_of, held_glass, scale_picture
from tests.support.vr.vr_glass import upright
from tests.support.vr.vr_hands import HEAD

HOT = Stop("Thermal", 0.5, "thermal", "ironbow", (10.0, 90.0), "\u00b0C")


def test_only_a_thermal_stop_with_known_values_has_a_scale():
    assert GlassScale.of(None, "ironbow", (0, 1)) is None
    assert GlassScale.of(Stop("RGB", 0.0), "", (0, 1)) is None
    assert GlassScale.of(HOT, "ironbow", (0, 1)) == GlassScale("ironbow", 10.0, 90.0, "\u00b0C")


@pytest.mark.parametrize("palette", ["ironbow", "viridis"])
def test_its_colours_go_from_the_coldest_below_to_the_hottest_on_top(palette):
    picture = scale_picture(GlassScale(palette, 10.0, 90.0, "\u00b0C"))
    column = picture[:, PAD_PX + BAR_PX // 2].astype(int)
    colors = np.rint(255 * palette_colors(palette)).astype(int)
    ground = picture[4, picture.shape[1] // 2].astype(int)
    bar = np.flatnonzero((np.abs(column - ground).max(axis=1) > 0) & (column[:, 3] == 255))
    bar = bar[bar > PAD_PX + 50]  # below the unit
    assert np.abs(column[bar[0], :3] - colors[-1]).max() <= 2
    assert np.abs(column[bar[-1], :3] - colors[0]).max() <= 2
    middle = (bar[0] + bar[-1]) // 2
    assert np.abs(column[middle, :3] - colors[len(colors) // 2]).max() <= 4
    assert picture.dtype == np.uint8 and (picture[..., :3].max(axis=2) <= picture[..., 3]).all()


@pytest.mark.parametrize("scale", [
    GlassScale("ironbow", 10.0, 10.0, ""), GlassScale("gray", -1e-3, 1e-3, "a long unit"),
    GlassScale("turbo", 0.0, 1e6, "\u6e29\u5ea6"),
])  # fmt: skip
def test_ranges_of_all_kinds_have_one(scale):
    picture = scale_picture(scale)
    assert picture[..., 3].max() == 255 and picture.shape[1] < 1500


@pytest.mark.parametrize(("side", "way"), [("left", -1), ("right", 1)])
def test_the_name_stands_on_the_rim_and_the_scale_outwards(side, way):
    glass = held_glass(upright(), HEAD)
    scale = GlassScale.of(HOT, "ironbow", (0.0, 1.0))
    name, legend = cards_of(glass, side, "Thermal", scale)
    assert name.lines == ("Thermal",)
    into = np.linalg.inv(glass.play_from_glass.matrix())
    at = [into[:3, :3] @ c.play_from_card.position + into[:3, 3] for c in (name, legend)]
    assert at[0][1] - name.size_m[1] / 2 == pytest.approx(RADIUS_M, abs=0.01)
    assert abs(at[0][0]) < 1e-9 and abs(at[1][1]) < 1e-9
    assert way * at[1][0] - legend.size_m[0] / 2 > RADIUS_M
    height, width = legend.picture().shape[:2]
    assert legend.size_m == (width * METRES_PER_PIXEL, height * METRES_PER_PIXEL)
    assert len(cards_of(glass, side, "Thermal", None)) == 1
    assert legend.key != name.key
