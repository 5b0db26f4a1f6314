"""Verdicts on parts of a model: differences with their spread, and what settings can do without."""

import numpy as np
import pytest

from shapeshift.runtime_models.model import Stop
from shapeshift.training.fit.ablation import (
    COMPONENTS,
    DROPPED,
    KEPT,
    SHAPE_HEADS,
    UNSURE,
    DbChange,
    Trial,
    change_of,
    decide,
)
from shapeshift.training.settings import TrainSettings
from tests.support.models import STOPS, make_random_model

BY_NAME = {part.name: part for part in COMPONENTS}
RNG = np.random.default_rng


def measured(rgb, thermal, size=1000, ms=1.0, seconds=10.0) -> Trial:
    psnr = {"RGB": np.atleast_2d(rgb), "Thermal": np.atleast_2d(thermal)}
    return Trial(psnr, (make_random_model(3, k=1),), "float16", size, ms, seconds)


def test_what_photos_have_in_common_falls_out():
    rng = RNG(0)
    hard = 20 + 10 * rng.random(40)  # some photos are far harder than others
    change = change_of(hard[None], (hard - 0.3 + 0.01 * rng.normal(size=40))[None])
    assert change.mean == pytest.approx(-0.3, abs=0.01)
    assert change.error == pytest.approx(0.01 / 40**0.5, rel=0.3)
    assert str(DbChange(-0.25, 0.06)) == "-0.25 ± 0.06"


@pytest.mark.parametrize("seeds", [2, 3])
def test_the_error_is_that_of_photos_and_of_seeds(seeds):
    """By hand, and as often as a standard error promises: both kinds of spread were put in."""
    rng, within = RNG(seeds), 0
    for _ in range(400):
        photos, runs = rng.normal(size=12), 0.5 * rng.normal(size=(seeds, 1))
        change = change_of(np.zeros((seeds, 12)), photos + runs)
        by_hand = (photos + runs).mean(0).var(ddof=1) / 12 + runs.var(ddof=1) / seeds
        assert change.error == pytest.approx(by_hand**0.5)
        within += abs(change.mean) < 2 * change.error
    assert within > 0.85 * 400


def test_one_photo_of_one_seed_tells_no_spread():
    assert np.isnan(change_of(np.zeros((1, 1)), np.ones((1, 1))).error)
    one = measured([30.0], [30.0])
    assert decide("a part", one, one, one, 0.1).verdict == UNSURE  # NaN never lets a part go


@pytest.mark.parametrize(
    ("thermal", "word", "needed_by"),
    [
        ([0.0, 0.0, 0.0], DROPPED, ()),
        ([-0.08, -0.09, -0.10], DROPPED, ()),
        ([-0.3, 0.1, 0.0], UNSURE, ("Thermal",)),
        ([-0.5, -0.4, -0.6], KEPT, ("Thermal",)),
        ([5.0, -3.0, -3.0], KEPT, ("Thermal",)),
    ],
)
def test_every_modality_has_a_say(thermal, word, needed_by):
    full = measured([30, 31, 32], [25, 26, 27], 1000, 1.0, 10.0)
    after = measured([30.5, 31.5, 32.5], np.add([25, 26, 27], thermal), 900, 0.75, 8.0)
    verdict = decide("a part", full, full, after, 0.1)
    assert (verdict.verdict, verdict.needed_by) == (word, needed_by)
    assert (verdict.bytes, verdict.decode_ms, verdict.train_s) == (100, 0.25, 2.0)
    assert verdict.change["RGB"].mean == pytest.approx(0.5)
    row = verdict.as_dict()
    assert row["change"]["Thermal"]["db"] == pytest.approx(np.mean(thermal), abs=1e-3)
    assert row["saves_bytes"] == 100


def test_small_losses_do_not_add_up_to_more_than_the_tolerance():
    full = measured([30, 30.001], [30, 30.001])
    before = measured([29.93, 29.931], [30, 30.001])
    after = measured([29.86, 29.861], [30, 30.001])
    verdict = decide("a part", full, before, after, 0.1)
    assert verdict.verdict == KEPT and verdict.needed_by == ("RGB",)
    assert verdict.change["RGB"].mean == pytest.approx(-0.07)
    assert verdict.total["RGB"].mean == pytest.approx(-0.14)


def test_what_another_part_won_is_not_used_up():
    full = measured([30, 30.001], [30, 30.001])
    before = measured([31, 31.001], [30, 30.001])
    after = measured([30.5, 30.501], [30, 30.001])
    verdict = decide("a part", full, before, after, 0.1)
    assert verdict.total["RGB"].mean == pytest.approx(0.5)
    assert verdict.verdict == KEPT and verdict.needed_by == ("RGB",)


def test_settings_without_each_part():
    settings = TrainSettings(anchor_attributes="frame,color,light")
    found = {name: part.without(settings, STOPS) for name, part in BY_NAME.items()}
    assert found["shape that follows x"].layout(2).fixed == SHAPE_HEADS
    assert found["scale that follows x"].fixed == "scale"
    assert found["colour that follows x"].fixed == "color"
    assert not found["colour that follows the eye"].view_dependent
    assert found["half of the hidden units"].hidden == 16
    assert found["half of the features"].features == 8
    assert found["one splat of every anchor"].splats_per_anchor == 4
    assert found["a third of the anchors"].max_anchors == 8000
    assert found["anchors' own axes and sizes"].anchor_attributes == "color,light"
    assert found["anchors' own base colours"].anchor_attributes == "frame,light"
    assert found["anchors' own light by direction"].anchor_attributes == "frame,color"
    each = BY_NAME["a base colour for each stop"]
    assert each.without(settings, STOPS) is None
    more = TrainSettings(anchor_attributes="frame,stop_color,light")
    assert each.without(more, STOPS).anchor_attributes == "frame,color,light"
    assert each.without(more, STOPS[:1]) is None
    assert BY_NAME["anchors' own base colours"].without(more, STOPS).anchor_attributes == (
        "frame,light"
    )
    grey = BY_NAME["light of red, green and blue each"].without(settings, STOPS)
    assert grey.anchor_attributes == "frame,color,gray_light"
    layout = grey.layout(2)
    assert layout.light_channels == 1 and layout.own_widths["light"] == 8
    assert BY_NAME["light of red, green and blue each"].without(grey, STOPS) is None
    without = BY_NAME["anchors' own light by direction"].without(grey, STOPS)
    assert without.anchor_attributes == "frame,color"
    both = TrainSettings(anchor_attributes="light,gray_light").layout(2)
    assert both.light_channels == 3 and both.own == ("light",)
    for none in ({}, {"view_dependent": False, "anchor_attributes": "frame,light"}):
        usual = TrainSettings(**none)  # blind colours have no light, so nothing is taken away
        assert BY_NAME["anchors' own light by direction"].without(usual, STOPS) is None
        assert BY_NAME["light of red, green and blue each"].without(usual, STOPS) is None


def test_parts_that_are_not_there_are_not_tried():
    small = TrainSettings(
        fixed="offset, color", view_dependent=False, hidden=8, features=4, splats_per_anchor=1,
        max_anchors=60, anchor_attributes="",
    )  # fmt: skip
    left = [name for name, part in BY_NAME.items() if part.without(small, STOPS)]
    assert left == ["scale that follows x", "rotation that follows x", "opacity that follows x"]
    assert BY_NAME["scale that follows x"].without(small, STOPS).layout(2).fixed == (
        "offset", "color", "scale",
    )  # fmt: skip
    one_stop = (Stop("RGB", 0.0),)
    assert not any("follows x" in n for n, p in BY_NAME.items() if p.without(small, one_stop))


def test_settings_can_be_taken_down_to_nothing():
    """Every part ends: the search does."""
    for part in COMPONENTS:
        settings, steps = TrainSettings(), 0
        while settings is not None:
            settings, steps = part.without(settings, STOPS), steps + 1
        assert steps < 30
