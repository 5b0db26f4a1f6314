"""Shapes by rule on small scenes: what is learned is what the rule says, as far as it reaches."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.model import HEADS, BadFile, Splats
from shapeshift.runtime_models.rotation import normalize, rotation_matrices
from shapeshift.runtime_models.stops.change_stops import insert_stop
from shapeshift.training.styles.add_style import (
    RuleSettings,
    blended,
    raw_outputs,
    surroundings,
    with_rule,
)
from shapeshift.training.styles.style_rules import RULES, lying, unit, upright, waves
from tests.support.models import without_control
from tests.support.new_stops import framed_model

EYE = np.array([0.3, 0.5, 2.0], np.float32)
NEW = 1 / 3  # x of a stop after the first of three


def shown_at(model, x, eye=EYE) -> Splats:
    return evaluate(model, x, eye)


def learned(model, name: str, **asked) -> tuple[Splats, Splats, Splats]:
    """The source stop's splats, what the rule makes of them, and what was learned."""
    made = with_rule(insert_stop(model, "New", "RGB", "RGB"), "New", RULES[name],
                     RuleSettings(**asked))  # fmt: skip
    before = shown_at(model, 0.0)
    return before, RULES[name](before, surroundings(model)), shown_at(made, NEW)


@pytest.mark.parametrize("name", RULES)
def test_a_rule_gives_splats_that_can_be_drawn(name):
    model = framed_model(60)
    before = shown_at(model, 0.0)
    after = RULES[name](before, surroundings(model))
    for field in ("means", "scales", "wxyz", "opacity", "color"):
        table = getattr(after, field)
        assert table.shape == getattr(before, field).shape and np.isfinite(table).all(), field
    assert (after.scales > 0).all() and (after.opacity <= 1).all()
    assert (np.linalg.norm(after.wxyz, axis=1) > 0.5).all()
    there = before.opacity > 0
    assert (after.opacity[~there] < 0).all()  # absent splats stay absent
    changed = np.abs(after.scales - before.scales)[there].mean()
    assert changed > 0.05 * before.scales[there].mean() or name == "melt"


@pytest.mark.parametrize("name", RULES)
def test_what_is_learned_comes_near_to_the_rule(name):
    """Of random networks, which share nothing with each other: most of the way to the wished
    sizes and opacities; trained scenes come nearer (the demo: docs/bench/styles.csv).
    """
    before, wished, found = learned(framed_model(60), name, features=24)
    there = before.opacity > 0.05

    def away(a: Splats, b: Splats) -> float:
        return float(np.abs(np.log(a.scales / b.scales))[there].mean())

    assert away(found, wished) < 0.35 * away(before, wished)
    off = np.abs(found.opacity - wished.opacity)[there].mean()
    assert off < 0.6 * np.abs(before.opacity - wished.opacity)[there].mean() + 0.02


@pytest.mark.parametrize("change", ["none", "deep", "fixed", "no frames", "one anchor"])
def test_all_kinds_of_networks_learn_shapes(change):
    model = framed_model(
        1 if change == "one anchor" else 40, hidden=(9, 7) if change == "deep" else (32,)
    )
    if change == "fixed":
        model = without_control(model, "offset", "scale", "rotation", "opacity")
    if change == "no frames":
        model = replace(model, frames=None)
    before, wished, found = learned(model, "points", features=24)
    there = before.opacity > (-1 if change == "one anchor" else 0.05)
    off = np.abs(np.log(found.scales / wished.scales))[there].mean()
    assert off < 0.35 * np.abs(np.log(before.scales / wished.scales))[there].mean() + 1e-5


def test_no_strength_is_the_source_and_half_lies_between():
    model = framed_model(60)
    before, _, none = learned(model, "fur", strength=0.0)
    np.testing.assert_allclose(none.color, before.color, atol=1e-5)
    np.testing.assert_allclose(none.scales, before.scales, rtol=1e-4)
    whole, half = (learned(model, "points", strength=s)[2] for s in (1.0, 0.5))
    small, middle, large = (np.log(s.scales).mean() for s in (whole, half, before))
    assert small < middle < large


def test_outside_of_a_region_nothing_moves():
    model, inside = framed_model(60), np.arange(60) < 20
    made = with_rule(
        insert_stop(model, "New", "RGB", "RGB"), "New", RULES["blocks"], RuleSettings(), inside
    )
    one, other = shown_at(model, 0.0), shown_at(made, NEW)
    rows = np.repeat(~inside, 3)
    np.testing.assert_allclose(other.means[rows], one.means[rows], atol=1e-6)
    np.testing.assert_allclose(other.color[rows], one.color[rows], atol=1e-5)
    assert np.abs(other.scales - one.scales)[~rows].mean() > 1e-3


def test_the_same_asked_twice_gives_the_same_numbers():
    one, other = (learned(framed_model(40), "fur")[2] for _ in range(2))
    np.testing.assert_array_equal(one.means, other.means)
    np.testing.assert_array_equal(one.color, other.color)


def test_raw_outputs_of_what_is_shown_are_the_networks_own():
    """The way back through the activations and frames, against the networks themselves."""
    from shapeshift.training.heads.networks import HeadLayout
    from shapeshift.training.styles.stop_trainer import SourceOutputs

    model = framed_model(30)
    outputs = SourceOutputs(model, "RGB", HeadLayout(3, control=1))
    outputs.look_from(EYE)
    base = {h: outputs.rows[:, at : at + width] for h, (at, width) in outputs.at.items()}
    shown = shown_at(model, 0.0)
    raw = raw_outputs(model, shown, shown, base)
    for head in HEADS:  # what stays as it is stays to the bit
        np.testing.assert_array_equal(raw[head], base[head])
    moved = {n: getattr(shown, n) * np.float32(1 + 1e-6) for n in ("scales", "opacity", "color")}
    moved["means"] = shown.means + np.float32(1e-6)
    raw = raw_outputs(model, shown, replace(shown, **moved), base)
    for head, far in (("offset", np.arctanh(0.97)), ("color", 5.0), ("opacity", np.arctanh(0.97))):
        wanted = np.clip(base[head], -far, far)
        stays = base[head] < (0 if head == "opacity" else -np.inf)  # absent is absent
        np.testing.assert_allclose(raw[head][~stays], wanted[~stays], atol=0.03, err_msg=head)
    np.testing.assert_allclose(raw["scale"], np.clip(base["scale"], -6, 3), atol=1e-3)


def test_half_a_turn_is_half_a_turn():
    one, other = (np.array([[np.cos(a), 0, np.sin(a), 0]]) for a in (0.2, 0.8))
    flat = {"means": np.zeros((1, 3)), "scales": np.ones((1, 3)), "opacity": np.ones(1),
            "color": np.ones((1, 3))}  # fmt: skip
    for sign in (1, -1):  # the shorter way, whatever the sign
        half = blended(Splats(wxyz=one, **flat), Splats(wxyz=sign * other, **flat), 0.5)
        np.testing.assert_allclose(half.wxyz, [[np.cos(0.5), 0, np.sin(0.5), 0]], atol=1e-9)


def test_turns_take_axes_where_they_are_asked_to():
    rng = np.random.default_rng(0)
    normal = unit(np.concatenate([rng.normal(size=(50, 3)), [[0, 1, 0], [0, -1, 0], [1, 0, 0]]]))
    side = rng.normal(size=normal.shape)
    along = unit(side - normal * (side * normal).sum(axis=1, keepdims=True))
    axes = rotation_matrices(normalize(upright(normal)))
    np.testing.assert_allclose(axes[:-2, :, 1], normal[:-2], atol=1e-6)
    axes = rotation_matrices(lying(normal, along))
    keep = np.arange(len(normal)) != 51  # straight down any turn will do
    np.testing.assert_allclose(axes[keep, :, 1], normal[keep], atol=1e-6)
    np.testing.assert_allclose(axes[keep, :, 0], along[keep], atol=1e-6)


def test_waves_stay_within_their_bounds():
    places = np.random.default_rng(0).normal(size=(1000, 3)) * 10
    assert np.abs(waves(places)).max() <= 1
    np.testing.assert_allclose(unit(np.zeros((1, 3))), [[0, 1, 0]])


def test_networks_of_other_ends_are_refused():
    model = framed_model(3)
    other = replace(model.networks["opacity"], head="sigmoid")
    made = insert_stop(model, "New", "RGB")
    with pytest.raises(BadFile, match="the opacity network of this scene ends in sigmoid"):
        changed = replace(made, networks=made.networks | {"opacity": other})
        with_rule(changed, "New", RULES["fur"], RuleSettings())
