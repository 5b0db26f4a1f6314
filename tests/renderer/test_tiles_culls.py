"""Culls, fade and order of the tiles against the float64 oracle, reason by reason."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.debug.debug_map import classify
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import CULL_REASONS, RenderSettings
from shapeshift.scene.scene import Scene
from tests.support.renderer.cull_scenes import FRONT, LIMITS, SCENES, THRESHOLDS
from tests.support.renderer.reference_reasons import reference_counts
from tests.support.splat_scenes import alone, front_view, psnr_db, stereo_views, two_objects


def counts(renderer: Renderer, scene: Scene, views: list, settings: RenderSettings) -> dict:
    """{drawn, *CULL_REASONS} of the last view."""
    renderer.settings = settings
    renderer.update(scene)
    stats = renderer.draw(views)
    assert stats.splats == scene.splat_count == stats.drawn + sum(stats.culled.values())
    return {"drawn": stats.drawn, **stats.culled}


@pytest.mark.parametrize("limits", LIMITS)
@pytest.mark.parametrize("name", SCENES)
def test_counts_and_picture_are_the_oracle_s(renderer, name, limits):
    scene, view, settings = SCENES[name](), front_view((160, 120)), LIMITS[limits]
    renderer.update(Scene(tuple(replace(o, visible=True) for o in scene.objects)))  # decodes all
    told = counts(renderer, scene, [view], settings)
    assert list(told) == ["drawn", *CULL_REASONS]
    assert told == reference_counts(scene, view, settings)
    image = renderer.image()
    if limits in ("all hard", "all soft", "soft without limits"):
        assert psnr_db(image, reference_image(scene, view, settings)) > 80


@pytest.mark.parametrize("name", THRESHOLDS)
def test_a_threshold_met_exactly(renderer, name):
    layers, settings, want = THRESHOLDS[name]
    told = counts(renderer, alone(layers), [FRONT], settings)
    assert told == {reason: want.split().count(reason) for reason in told}
    reasons, _, _ = classify(renderer.drawing.splat_points(), np.eye(4)[None], FRONT, settings)
    assert [("drawn", *CULL_REASONS)[reason] for reason in reasons] == want.split()


@pytest.mark.parametrize("order", ["depth", "distance"])
def test_an_order_is_the_oracle_s(renderer, order):
    scene, view = two_objects(3000), front_view((120, 90))
    wide = replace(view, tangents=(-1.5, 1.5, -1.2, 1.2))  # where depth and distance differ
    settings = RenderSettings(order=order)
    counts(renderer, scene, [wide], settings)
    assert psnr_db(renderer.image(), reference_image(scene, wide, settings)) > 80


def test_depth_and_distance_are_not_the_same_order(renderer):
    scene = two_objects(3000)
    wide = replace(front_view((120, 90), distance=1.0), tangents=(-1.5, 1.5, -1.2, 1.2))
    images = []
    for order in ("depth", "distance"):
        counts(renderer, scene, [wide], RenderSettings(order=order))
        images.append(renderer.image().copy())
    assert psnr_db(*images) < 60


@pytest.mark.parametrize("limits", ["none", "all hard", "all soft"])
@pytest.mark.parametrize("order", ["depth", "distance"])
def test_a_stereo_pair_counts_as_each_eye_alone(renderer, order, limits):
    scene, views = two_objects(2000), stereo_views((120, 90))
    settings = replace(LIMITS[limits], order=order)
    told = counts(renderer, scene, views, settings)
    assert told == reference_counts(scene, views[1], settings)
    told = counts(renderer, scene, views[::-1], settings)
    assert told == reference_counts(scene, views[0], settings)
