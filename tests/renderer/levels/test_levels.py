"""Levels of detail in a frame: chosen by pixels, with hysteresis; drawn as the level alone is."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.levels import HYSTERESIS, choose_level, object_pixels
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.lod.average_anchors import average_anchors
from shapeshift.runtime_models.model import CoarserAnchors
from shapeshift.scene.appearance import Appearance
from shapeshift.scene.pose import Pose, View, look_at
from shapeshift.scene.scene import Scene, SceneObject, Tint
from tests.support.models import make_random_model

NEXT, FAR = 60.0, 20.0  # pixels, from which on the levels are drawn


def leveled(anchors=300):
    model = make_random_model(anchors)
    coarser = []
    for cell, pixels in ((0.4, NEXT), (0.9, FAR)):
        one = average_anchors(model, cell)
        parts = (one.anchors, one.features, one.frames, one.labels, one.light)
        coarser.append(CoarserAnchors(*parts, cell, pixels))
    return model.with_coarser(tuple(coarser))


def view_of(away: float, aside: float = 0.0) -> View:
    pose = look_at((aside, 0, away), (aside, 0, 0))
    return View(pose, (-0.4, 0.4, -0.3, 0.3), 0.05, 500, (160, 120))  # 200 pixels a tangent


def placed(model, place=(0.0, 0, 0), **more) -> SceneObject:
    pose = Pose(np.array(place, float), np.array([1.0, 0, 0, 0]))
    return SceneObject("it", model, pose, **more)


def test_thresholds_exactly_and_hysteresis():
    model = leveled(40)
    up = np.nextafter
    for now in (0, 1, 2):
        assert choose_level(model, NEXT, now) >= 1 and choose_level(model, FAR, now) == 2
        assert choose_level(model, 0.0, now) == 2 and choose_level(model, np.inf, now) == 0
        assert choose_level(model, np.nan, now) == 0
    assert choose_level(model, up(NEXT, 99), 0) == 0 and choose_level(model, up(FAR, 99), 1) == 1
    # once there, it stays until the object is larger by HYSTERESIS
    assert choose_level(model, HYSTERESIS * NEXT, 1) == 1
    assert choose_level(model, up(HYSTERESIS * NEXT, 99), 1) == 0
    assert choose_level(model, HYSTERESIS * FAR, 2) == 2
    assert choose_level(model, up(HYSTERESIS * FAR, 99), 2) == 1


def test_pixels_are_those_of_the_nearest_eye():
    obj, bounds = placed(leveled(40), (0, 0, 0)), (np.zeros(3), 0.5)
    assert object_pixels(obj, bounds, [view_of(10)]) == pytest.approx(2 * 0.5 / 10 * 200)
    both = [view_of(10), view_of(5)]
    assert object_pixels(obj, bounds, both) == pytest.approx(2 * 0.5 / 5 * 200)
    assert object_pixels(obj, bounds, [view_of(0.5)]) == np.inf  # from within
    assert object_pixels(obj, bounds, []) == 0
    twice = replace(view_of(10), size=(320, 240))
    assert object_pixels(obj, bounds, [twice]) == pytest.approx(40)


def test_a_level_is_drawn_as_it_is_drawn_alone():
    model = leveled()
    with Renderer(None, "tiles") as renderer, Renderer(None, "tiles") as alone:
        for away, level in ((3.0, 0), (9.0, 1), (40.0, 2), (3.0, 0)):
            for x in (0.0, 0.4, 1.0):
                renderer.update(Scene((placed(model, x=x),)))
                stats = renderer.draw([view_of(away)])
                assert renderer.levels.levels == (level,)
                assert stats.splats == len(model.levels[level].anchors) * 5
                one = model.levels[level] if level else replace(model, coarser=())
                alone.update(Scene((placed(one, x=x),)))
                alone.draw([view_of(away)])
                np.testing.assert_array_equal(renderer.image(), alone.image())
                np.testing.assert_array_equal(renderer.resolved(), alone.resolved())


def test_objects_choose_for_themselves_and_eyes_together():
    model = leveled(100)
    scene = Scene(tuple(placed(model, (0, 0, -z)) for z in (0.0, 10, 60)))
    with Renderer(None, "tiles") as renderer:
        renderer.update(scene)
        assert renderer.levels.levels == (2, 2, 2)  # until views are known, the least work
        renderer.draw([view_of(3)])
        assert renderer.levels.levels == (0, 1, 2)
        renderer.draw([view_of(3), view_of(3, aside=0.06)])  # two eyes, one choice
        assert renderer.levels.levels == (0, 1, 2)
        renderer.update(Scene((*scene.objects, placed(make_random_model(9)))))
        renderer.draw([view_of(3)])
        assert renderer.levels.levels == (0, 1, 2, 0)


def test_what_is_marked_by_anchors_is_drawn_whole():
    model = leveled(100)
    tint = Tint(np.ones(3), np.linspace(0, 1, 100).astype(np.float32))
    with Renderer(None, "tiles") as renderer:
        for marked, count in ((None, len(model.levels[2].anchors)), (tint, 100)):
            renderer.update(Scene((placed(model, tint=marked),)))
            assert renderer.draw([view_of(40)]).splats == 5 * count


def test_two_looks_have_one_level():
    model = leveled(100)
    one, other = (Scene((placed(model, x=0.0, tint=t),)) for t in (None, Tint((1.0, 0, 0), 0.5)))
    with Renderer(None, "tiles") as renderer:
        renderer.update(one)
        renderer.draw_two((view_of(40), view_of(40)), other)
        assert renderer.levels.levels == (2,)
        assert renderer.image(0)[..., 3].max() > 0


def test_quads_draw_the_same_level(ctx):
    model = leveled(100)
    with Renderer(ctx, "quads", mlps="onnxruntime", sort="numpy") as renderer:
        for away, level in ((3.0, 0), (40.0, 2)):
            renderer.update(Scene((placed(model),)))
            assert renderer.draw([view_of(away)]).splats == 5 * len(model.levels[level].anchors)


def test_a_switch_leaves_other_objects_decoded():
    model, other = leveled(100), make_random_model(50, seed=2)
    scene = Scene((placed(other, (1, 0, 0)), placed(model, x=0.3), placed(other, (-1, 0, 0))))
    with Renderer(None, "tiles") as renderer, Renderer(None, "tiles") as fresh:
        # The first frame decodes all; later ones the object that has another level.
        for away, level, runs in ((40.0, 2, 3), (9.0, 1, 1), (3.0, 0, 1), (40.0, 2, 1)):
            renderer.update(scene)
            stats = renderer.draw([view_of(away), view_of(away, 0.06)])
            assert (renderer.levels.levels, stats.geometry_runs) == ((0, level, 0), runs)
            whole = Scene((scene.objects[0], placed(model.levels[level], x=0.3), scene.objects[2]))
            fresh.update(whole)
            fresh.draw([view_of(away), view_of(away, 0.06)])
            for eye in range(2):
                np.testing.assert_array_equal(renderer.image(eye), fresh.image(eye))


def test_cut_and_faint_objects_stay_so_through_a_switch():
    model = leveled(100)
    faint = Appearance(opacity=0.5)
    still = placed(make_random_model(50, seed=2), (1, 0, 0), appearance=faint)
    with Renderer(None, "tiles") as renderer, Renderer(None, "tiles") as fresh:
        for away in (9.0, 40.0, 9.0):
            scene = Scene((placed(model, appearance=faint), still))
            renderer.update(scene)
            renderer.draw([view_of(away)])
            level = renderer.levels.levels[0]
            fresh.update(Scene((placed(model.levels[level], appearance=faint), still)))
            fresh.draw([view_of(away)])
            np.testing.assert_array_equal(renderer.image(), fresh.image())


def test_who_measures_has_all_of_it():
    model = leveled(100)
    with Renderer(None, "tiles") as renderer:
        scene = Scene((placed(model),))
        renderer.update(scene)
        with renderer.levels.all_whole():
            renderer.update(scene)
            assert renderer.draw([view_of(40)]).splats == 500
            assert renderer.surface(view_of(40)).depth().shape == (120, 160)
            assert renderer.draw([view_of(40)]).splats == 500
        renderer.update(scene)
        assert renderer.draw([view_of(40)]).splats == 5 * len(model.levels[2].anchors)
