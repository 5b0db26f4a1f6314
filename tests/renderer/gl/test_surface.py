"""Depth, normals and coverage: both drawings against rays through ellipsoids in float64."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene
from tests.support.renderer.renderers import EITHER_ON_GL
from tests.support.renderer.surface_reference import reference_surface
from tests.support.splat_scenes import (
    alone,
    front_view,
    one_splat,
    poisoned,
    random_layers,
    random_model,
    shell,
    two_objects,
)
from tests.support.splats.scaffold_scenes import random_raw, write_run

RENDERERS = EITHER_ON_GL

pytestmark = pytest.mark.usefixtures("ctx")


def surface_of(renderer: Renderer, scene: Scene, view: View, **settings):
    renderer.settings = RenderSettings(**settings)
    renderer.update(scene)
    return renderer.surface(view)


OFF_CENTRE = replace(front_view((90, 61)), tangents=(-0.5, 0.3, -0.2, 0.45))
SCENES = {
    "cloud": (lambda: two_objects(900), front_view((96, 80))),
    "shell": (lambda: alone(shell(900)), OFF_CENTRE),
    "anchors": (lambda: alone(random_model(60)), front_view((64, 64))),
}


@pytest.mark.parametrize("order", ["depth", "distance"])
@pytest.mark.parametrize("name", SCENES)
def test_it_is_that_of_rays_through_ellipsoids(renderer, name, order):
    make, view = SCENES[name]
    scene = make()
    got = surface_of(renderer, scene, view, order=order)
    want = reference_surface(scene, view, RenderSettings(order=order))
    # Quads keep ellipses as half floats: 0.05 %, and fragments on a splat's edge may differ.
    for a, b, scale in (
        (got.metres, want.metres, view.world_from_eye.position[2]),
        (got.normal, want.normal, 1),
        (got.coverage, want.coverage, 1),
    ):
        error = np.abs(a - b) / scale
        assert error.mean() < 3e-4 and np.quantile(error, 0.999) < 6e-3, (error.mean(), error.max())
    solid = want.coverage > 0.6
    assert solid.mean() > 0.1
    depth = got.depth()
    assert np.isnan(depth[got.coverage < 0.5]).all()
    np.testing.assert_allclose(depth[solid], want.depth()[solid], rtol=5e-3)
    turned = (got.normals()[solid] * want.normals()[solid]).sum(axis=1)
    assert np.quantile(np.degrees(np.arccos(np.clip(turned, -1, 1))), 0.99) < 1.0


@pytest.mark.parametrize("kind", ["poisoned", "antialiased", "limits", "follows the eye"])
def test_what_is_left_out_and_what_is_fainter(renderer, kind, tmp_path):
    view, limits, layers = front_view((48, 40)), {}, random_layers(500, seed=3)
    if kind == "poisoned":
        layers, _ = poisoned(layers)
    elif kind == "antialiased":
        layers = replace(layers, antialiased=True, scales=layers.scales * np.float32(0.2))
    elif kind == "follows the eye":
        layers = read_model(write_run(random_raw(60), tmp_path / "run"))
    else:
        limits = {"max_distance": 4.0, "max_pixels": 6.0, "min_pixels": 1.0, "fade": 0.3}
    scene = alone(layers)
    got = surface_of(renderer, scene, view, **limits)
    want = reference_surface(scene, view, RenderSettings(**limits))
    assert want.coverage.max() > 0.2
    for name in ("metres", "normal", "coverage"):
        error = np.abs(getattr(got, name) - getattr(want, name))
        assert error.mean() < 2e-3 and np.quantile(error, 0.99) < 0.03, (name, error.max())


def test_coverage_is_the_picture_s(renderer):
    scene, view = two_objects(600), front_view((80, 60))
    got = surface_of(renderer, scene, view)
    np.testing.assert_allclose(got.coverage, reference_image(scene, view)[..., 3], atol=6e-3)


def test_a_frame_before_and_after_is_the_same(renderer):
    """The order that is kept, the counts and the pictures are the frame's, not the surface's."""
    scene, view = two_objects(600), front_view((80, 60))
    renderer.settings = RenderSettings(resort_frames=0)
    renderer.update(scene)
    first = renderer.draw([view])
    before = renderer.image().copy()
    renderer.surface(replace(front_view((40, 30)), tangents=(-0.1, 0.1, -0.1, 0.1)))
    np.testing.assert_array_equal(renderer.image(), before)
    second = renderer.draw([view])
    np.testing.assert_array_equal(renderer.image(), before)
    assert (first.drawn, first.culled) == (second.drawn, second.culled)


def test_a_flat_splat_faces_its_own_way_and_a_round_one_the_eye(renderer):
    half = np.sqrt(0.5)
    view = front_view((64, 64))
    flat = one_splat(scales=[[0.3, 1e-4, 0.3]], opacity=[0.99], wxyz=[[1, 0, 0, 0]])
    normal = surface_of(renderer, alone(flat), view).normals()[32, 32]
    up = view.world_from_eye.matrix()[:3, :3].T @ [0, 1, 0]
    np.testing.assert_allclose(normal, up, atol=2e-3)
    ball = one_splat(scales=[[0.3] * 3], opacity=[0.99], wxyz=[[half, 0, half, 0]])
    got = surface_of(renderer, alone(ball), view)
    np.testing.assert_allclose(got.normals()[32, 32], [0, 0, 1], atol=2e-3)
    np.testing.assert_allclose(
        got.depth()[32, 32], np.linalg.norm(view.world_from_eye.position), rtol=1e-4
    )


@pytest.mark.parametrize("scene", [Scene(()), alone(one_splat(), visible=False)])
def test_nothing_to_see_is_nothing(renderer, scene):
    got = surface_of(renderer, scene, front_view((20, 10)))
    assert got.coverage.shape == (10, 20) and not got.coverage.any() and not got.metres.any()
    assert np.isnan(got.depth()).all() and np.isnan(got.normals()).all()
