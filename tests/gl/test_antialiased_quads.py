"""Antialiased scenes drawn with GL quads, by the oracle; alone, mixed, for one eye and for two."""

import numpy as np
import pytest

from renderer.reference import reference_counts, reference_image
from renderer.renderer import Renderer
from tests.splat_scenes import front_view, psnr_db, stereo_views
from tests.test_antialiased import CASES, LIMITS, SCENES, check_counts, decoded_all, mixed


@pytest.fixture(scope="module")
def renderer(session_gpu):
    with session_gpu.ctx as ctx, Renderer(ctx, "quads") as made:
        yield made


@pytest.mark.parametrize("name, limits", CASES)
def test_quads_draw_and_count_as_the_oracle(ctx, renderer, name, limits):
    scene, view, settings = SCENES[name](), front_view((160, 120)), LIMITS[limits]
    renderer.settings = settings
    renderer.update(decoded_all(scene))
    renderer.update(scene)
    stats = renderer.draw([view])
    want = reference_counts(scene, view, settings)
    check_counts({"drawn": stats.drawn, **stats.culled}, want, name)
    assert psnr_db(renderer.image(), reference_image(scene, view, settings)) > 58


@pytest.mark.parametrize("limits", ["none", "soft"])
def test_both_eyes_have_an_opacity_of_their_own(ctx, renderer, limits):
    scene, views, settings = mixed(900), stereo_views((96, 80)), LIMITS[limits]
    renderer.settings = settings
    renderer.update(scene)
    renderer.draw(views)
    centre = np.mean([view.world_from_eye.position for view in views], axis=0)
    for i, view in enumerate(views):
        want = reference_image(scene, view, settings, eye=centre)
        assert psnr_db(renderer.image(i), want) > 58
