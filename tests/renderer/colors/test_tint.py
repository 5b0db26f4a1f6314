"""A tint: a colour over an object's own at any x, that costs no network and leaves nothing."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.scene.scene import Scene, SceneObject, Tint
from tests.support.renderer.heat_scenes import BEHIND, CASES, VIEW, model
from tests.support.renderer.renderers import EITHER_ON_GL
from tests.support.splat_scenes import random_layers

RENDERERS = EITHER_ON_GL
ACCENT = (0.2, 0.9, 0.4)
HALF = 2.0**-11  # quads hold colours below 1 as half floats: 11 bits; tiles are within 2e-5
STOPS = {"pure thermal": {"x": 0.5}, "pure RGB": {"x": 0.0}, **CASES}


def drawn(renderer: Renderer, thing: SceneObject, view=VIEW) -> np.ndarray:
    """(H, W, 4): the picture over BEHIND, and alpha."""
    renderer.settings = replace(renderer.settings, background=BEHIND)
    renderer.update(Scene((thing,)))
    drawn.stats = renderer.draw([view])
    alpha = renderer.image()[..., 3:]
    return np.concatenate([renderer.resolved(), alpha], axis=2)


@pytest.mark.parametrize("changes", STOPS.values(), ids=STOPS)
def test_a_whole_tint_is_one_colour_at_every_stop(renderer, changes):
    thing = SceneObject("thing", model(40), **changes)
    plain = drawn(renderer, thing)
    tinted = drawn(renderer, replace(thing, tint=Tint(ACCENT, 1.0)))
    alpha = plain[..., 3:]
    assert alpha.max() > 0.5
    wanted = alpha * ACCENT + (1 - alpha) * np.array(BEHIND)  # of every splat the same colour
    np.testing.assert_allclose(tinted[..., :3], wanted, atol=HALF)
    np.testing.assert_array_equal(tinted[..., 3:], alpha)


@pytest.mark.parametrize("changes", STOPS.values(), ids=STOPS)
def test_a_tint_that_goes_leaves_the_very_same_picture(renderer, changes):
    thing = SceneObject("thing", model(40), **changes)
    plain = drawn(renderer, thing)
    some = (np.arange(40) % 3 == 0).astype(np.float32)
    for strength in (some, some / 2, np.zeros(40, np.float32), np.ones(40, np.float32)):
        drawn(renderer, replace(thing, tint=Tint(ACCENT, strength)))
    np.testing.assert_array_equal(drawn(renderer, thing), plain)


def test_another_tint_runs_no_network(renderer):
    thing = SceneObject("thing", model(40), x=0.2)
    drawn(renderer, replace(thing, tint=Tint(ACCENT, np.zeros(40, np.float32))))
    for row in range(5):
        strength = np.zeros(40, np.float32)
        strength[row] = 0.7
        drawn(renderer, replace(thing, tint=Tint(ACCENT, strength)))
        assert (drawn.stats.geometry_runs, drawn.stats.color_runs) == (0, 0)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 1.0])
def test_a_tint_is_a_mix_of_both_pictures(renderer, share):
    thing = SceneObject("thing", model(40), x=0.0)
    plain = drawn(renderer, thing)
    whole = drawn(renderer, replace(thing, tint=Tint(ACCENT, 1.0)))
    part = drawn(renderer, replace(thing, tint=Tint(ACCENT, share)))
    # Blending is linear in the splats' colours.
    np.testing.assert_allclose(part, (1 - share) * plain + share * whole, atol=HALF)


def test_the_tinted_splats_are_those_of_the_anchors(renderer):
    """A part against the whole: black where tinted black, and the rest alone gives the rest."""
    made, rows = model(40), np.arange(40) % 4 == 1
    thing = SceneObject("thing", made, x=0.0)
    colors = np.where(rows[:, None], (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    picture = drawn(renderer, replace(thing, tint=Tint(colors, 1.0)))
    swapped = drawn(renderer, replace(thing, tint=Tint(1 - colors, 1.0)))
    both = picture[..., :3] + swapped[..., :3]
    alpha = picture[..., 3:]
    np.testing.assert_allclose(both, alpha + 2 * (1 - alpha) * np.array(BEHIND), atol=HALF)
    alone = drawn(renderer, SceneObject("thing", made.with_anchors(rows), x=0.0))
    hidden = drawn(renderer, replace(thing, tint=Tint(ACCENT, rows.astype(np.float32))))
    assert 0.02 < alone[..., 3].mean() < hidden[..., 3].mean()
    # Where those anchors have nothing the tint changes nothing.
    plain = drawn(renderer, thing)
    beside = alone[..., 3] == 0
    assert beside.mean() > 0.05
    np.testing.assert_array_equal(hidden[beside], plain[beside])


def test_plain_splats_and_two_objects(renderer):
    layers = random_layers(300)
    assert isinstance(layers, SplatLayers)
    first, second = SceneObject("a", layers), SceneObject("b", model(40), x=0.25)
    renderer.settings = replace(renderer.settings, background=BEHIND)
    pictures = []
    for tint in (None, Tint(ACCENT, np.linspace(0, 1, 300)), None):
        renderer.update(Scene((replace(first, tint=tint), second)))
        renderer.draw([VIEW])
        pictures.append(renderer.resolved().copy())
    assert np.abs(pictures[0] - pictures[1]).max() > 0.05
    np.testing.assert_array_equal(pictures[0], pictures[2])


def test_it_follows_x_and_the_eye(renderer):
    """What is decoded anew under a tint is tinted, and comes back as it is then."""
    strength = np.linspace(0, 1, 40).astype(np.float32)
    fresh = Renderer(None, **RENDERERS["tiles"])
    with fresh:
        made = model(40)
        for x in (0.0, 0.2, 0.5, 0.5, 0.7):
            thing = SceneObject("thing", made, x=x)
            tinted = drawn(renderer, replace(thing, tint=Tint(ACCENT, strength)))
            anew = drawn(fresh, replace(thing, tint=Tint(ACCENT, strength)))
            assert np.abs(tinted - anew).max() < 0.02  # quads against tiles
        np.testing.assert_allclose(drawn(renderer, thing), drawn(fresh, thing), atol=0.02)
