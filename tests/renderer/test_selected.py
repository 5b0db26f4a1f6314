"""Scenes with selectors, drawn: against the oracle; decoded when something changed, then only."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.colors.palette import value_blend, value_weights
from shapeshift.renderer.reference import reference_image
from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.stop_weights import StopBlend
from shapeshift.scene.control import control_of
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.selectors.selector import HalfSpace, Painted, Sphere
from tests.support.renderer.selected_scenes import ASIDE, BALL, VIEW, selected_scene, thermal
from tests.support.splat_scenes import front_view, psnr_db, random_layers, random_model


def scene_of(model, **changes) -> Scene:
    return Scene((SceneObject("thing", model, **changes),))


def drawn(renderer, scene) -> np.ndarray:
    renderer.update(scene)
    renderer.draw([VIEW])
    return renderer.image().copy()


@pytest.mark.parametrize("model", [random_model(400), random_layers(400, layers=2)], ids=["A", "N"])
def test_the_arena_holds_what_the_plain_networks_give_at_every_control_value(renderer, model):
    scene = scene_of(model, x=0.3, selectors=(BALL,))
    drawn(renderer, scene)
    x = control_of(scene.objects[0])
    assert np.ndim(x) == 1 and len(np.unique(x)) > 10
    wanted = evaluate(model, x, VIEW.world_from_eye.position)
    mean_opacity = renderer.drawing.splat_points()[0]
    # Of one pass: nothing later has a colour a splat.
    color = renderer.drawing.device.download(renderer.drawing._color)
    np.testing.assert_allclose(mean_opacity[:, :3], wanted.means, atol=1e-5)
    np.testing.assert_allclose(mean_opacity[:, 3], wanted.opacity, atol=1e-5)
    np.testing.assert_allclose(color[:, :3], wanted.color, atol=2e-5)


def test_all_selected_is_the_picture_of_that_value(renderer):
    model = random_model(300)
    everywhere = HalfSpace(point=(0, 99, 0), normal=(0, 1, 0), x=0.75)
    got = drawn(renderer, scene_of(model, selectors=(everywhere,)))
    np.testing.assert_array_equal(got, drawn(renderer, scene_of(model, x=0.75)))
    nowhere = replace(everywhere, point=(0, -99, 0))
    got = drawn(renderer, scene_of(model, x=0.25, selectors=(nowhere,)))
    np.testing.assert_array_equal(got, drawn(renderer, scene_of(model, x=0.25)))


def runs(renderer, scene) -> tuple[int, int]:
    renderer.update(scene)
    stats = renderer.draw([VIEW])
    return stats.geometry_runs, stats.color_runs


def test_decoded_when_something_changed_and_only_then(renderer):
    model = random_model(100)
    scene = scene_of(model, selectors=(BALL,))
    assert runs(renderer, scene) == (1, 1)
    again = scene_of(model, selectors=(Sphere(**vars(BALL)),))
    assert runs(renderer, again) == (0, 0), "equal, and another object"
    assert runs(renderer, scene_of(model, selectors=(replace(BALL, border=0.3),))) == (1, 1)
    moved = scene_of(model, selectors=(replace(BALL, border=0.3),), world_from_object=ASIDE)
    assert runs(renderer, moved)[0] == 0, "it moves with its object"
    in_world = (replace(BALL, border=0.3, space="world"),)
    assert runs(renderer, scene_of(model, selectors=in_world))[0] == 0, "the same anchors"
    assert runs(renderer, scene_of(model, selectors=in_world, world_from_object=ASIDE)) == (1, 1)
    assert runs(renderer, scene_of(model, selectors=in_world, world_from_object=ASIDE)) == (0, 0)
    assert runs(renderer, scene_of(model, world_from_object=ASIDE)) == (1, 1)
    far = (Sphere(centre=(9, 9, 9), radius=1, x=1),)
    assert runs(renderer, scene_of(model, world_from_object=ASIDE, selectors=far)) == (0, 0)


def test_a_legend_tells_of_a_selector_too():
    model = thermal(random_model(20))
    ball = replace(BALL, x=0.4)
    name, weight, stop = value_blend(scene_of(model, selectors=(ball,)))
    assert (name, stop.name) == ("ironbow", "Hot") and weight == pytest.approx(0.8)
    assert value_weights(StopBlend(()), np.zeros(3))[1] is None


def test_skipping_the_unseen_never_shares_heat_twice(renderer):
    model = thermal(random_model(300))
    scene = scene_of(model, selectors=(replace(BALL, x=0.5),))
    views = [VIEW, front_view((160, 120), distance=3.0), VIEW, front_view((90, 20), distance=1.0)]
    pictures = []
    for skip in (True, False):
        renderer.settings = replace(renderer.settings, skip_unseen=skip)
        renderer.update(Scene(()))
        renderer.update(scene)
        for view in views:
            renderer.draw([view])
            pictures.append(renderer.image().copy())
    for got, want in zip(pictures[:4], pictures[4:], strict=True):
        np.testing.assert_array_equal(got, want)


@pytest.mark.parametrize("name", ["offset", "scale", "rotation", "opacity", "color"])
@pytest.mark.parametrize("selectors", [(), (BALL,)])
def test_a_network_of_nan_is_culled_and_no_pixel_is_nan(renderer, name, selectors):
    model = random_model(60)
    head = model.networks[name]
    broken = replace(head, weights=(*head.weights[:-1], np.full_like(head.weights[-1], np.nan)))
    model = replace(model, networks=model.networks | {name: broken})
    renderer.update(scene_of(model, x=0.4, selectors=selectors))
    stats = renderer.draw([VIEW])
    assert (
        stats.drawn == 0 and not renderer.image().any() and np.isfinite(renderer.resolved()).all()
    )


def test_two_values_are_two_objects(renderer):
    """Against the same scene made of two models, each of one value."""
    model = random_model(300)
    inside = model.anchors[:, 0] < 0
    scene = scene_of(model, x=0.2, selectors=(Painted(inside, 0.9),))
    got = drawn(renderer, scene)
    parts = [model.with_anchors(rows) for rows in (inside, ~inside)]
    both = Scene((SceneObject("in", parts[0], x=0.9), SceneObject("out", parts[1], x=0.2)))
    assert psnr_db(got, drawn(renderer, both)) > 80


def test_the_picture_is_the_oracles(renderer):
    scene = selected_scene()
    assert psnr_db(drawn(renderer, scene), reference_image(scene, VIEW)) > 60
