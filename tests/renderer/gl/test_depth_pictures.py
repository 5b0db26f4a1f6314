"""Depth beside the colours of a frame, as the compositor of a headset takes it."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import Scene
from tests.support.renderer.renderers import EITHER_ON_GL
from tests.support.renderer.surface_reference import reference_surface
from tests.support.splat_scenes import alone, front_view, one_splat, shell, two_objects

RENDERERS = EITHER_ON_GL
SIZE = (96, 80)

pytestmark = pytest.mark.usefixtures("ctx")


def depth_of(renderer: Renderer, i: int) -> np.ndarray:
    """(h, w, 4) float32, row 0 on top."""
    found = renderer.drawing.presentable_depth(i)
    if isinstance(found, np.ndarray):
        return found
    width, height = found.size
    return np.frombuffer(found.read(), np.float32).reshape(height, width, 4)[::-1]


def eyes(apart_m: float = 0.064) -> list[View]:
    left = front_view(SIZE)
    aside = left.world_from_eye.matrix()[:3, 0] * apart_m
    moved = Pose(left.world_from_eye.position + aside, left.world_from_eye.wxyz)
    return [left, replace(left, world_from_eye=moved, tangents=(-0.5, 0.3, -0.35, 0.3))]


@pytest.mark.parametrize("colors", ["each", "shared"])
def test_both_eyes_have_the_depth_of_rays_through_ellipsoids(renderer, colors):
    scene, views = two_objects(900), eyes()
    renderer.settings = RenderSettings(depth_scale=1.0, stereo_colors=colors)
    renderer.update(scene)
    renderer.draw(views)
    for i, view in enumerate(views):
        got, want = depth_of(renderer, i), reference_surface(scene, view)
        error = np.abs(got[..., 3] - want.coverage)
        assert error.mean() < 3e-4 and np.quantile(error, 0.999) < 6e-3
        solid = want.coverage > 0.6
        assert solid.mean() > 0.05
        # Halves of the ellipses' axes, as in test_surface.
        depth = got[solid, 0] / got[solid, 3]
        np.testing.assert_allclose(depth, want.depth()[solid], 5e-3)


def test_fewer_pixels_have_the_depth_of_the_middle_of_those_they_stand_for(renderer):
    """At an even part a pixel's middle is a corner of four."""
    scene, view = alone(shell(900)), front_view(SIZE)
    renderer.settings = RenderSettings(depth_scale=0.5)
    renderer.update(scene)
    renderer.draw([view])
    got = depth_of(renderer, 0)
    whole = renderer.surface(view)
    assert got.shape == (40, 48, 4)
    four = [whole.metres, whole.coverage]
    metres, coverage = (a.reshape(40, 2, 48, 2).mean(axis=(1, 3)) for a in four)
    flat = np.ptp(whole.coverage.reshape(40, 2, 48, 2), axis=(1, 3)) < 0.05
    solid = flat & (coverage > 0.6)
    assert solid.mean() > 0.1
    depth = got[solid, 0] / got[solid, 3]
    np.testing.assert_allclose(depth, metres[solid] / coverage[solid], rtol=0.02)


def test_all_pixels_are_those_of_a_surface(renderer):
    scene, view = alone(shell(900)), front_view(SIZE)
    renderer.settings = RenderSettings(depth_scale=1.0)
    renderer.update(scene)
    renderer.draw([view])
    np.testing.assert_array_equal(depth_of(renderer, 0)[..., 0], renderer.surface(view).metres)


@pytest.mark.parametrize("part", [0.5, 0.3, 0.125])
def test_fewer_pixels_have_the_depth_of_rays_through_their_own_middles(renderer, part):
    """Against the float64 reference of a picture of so many pixels, blurred as the whole one is."""
    scene, view = alone(shell(900)), front_view(SIZE)
    renderer.settings = RenderSettings(depth_scale=part)
    renderer.update(scene)
    renderer.draw([view])
    got = depth_of(renderer, 0)
    size = tuple(max(1, round(part * side)) for side in SIZE)
    assert got.shape == (*size[::-1], 4)
    blur = RenderSettings(low_pass=0.3 * part**2)  # of the whole one, in pixels of this one
    want = reference_surface(scene, view.resized(size), blur)
    solid = want.coverage > 0.6
    assert solid.mean() > 0.1
    np.testing.assert_allclose(got[solid, 0] / got[solid, 3], want.depth()[solid], 5e-3)


def test_a_picture_is_the_same_with_depth_beside_it(renderer):
    scene, views, pictures = two_objects(600), eyes(), []
    for scale in (0.0, 0.5):
        renderer.settings = RenderSettings(depth_scale=scale)
        renderer.update(scene)
        renderer.draw(views)
        pictures.append([renderer.image(i).copy() for i in range(2)])
    np.testing.assert_array_equal(pictures[0], pictures[1])
    renderer.draw(views)  # colours of the records are back after depth has had them
    np.testing.assert_array_equal(renderer.image(1), pictures[0][1])


@pytest.mark.parametrize("scene", [Scene(()), alone(one_splat(), visible=False)])
def test_nothing_has_no_depth(renderer, scene):
    renderer.settings = RenderSettings(depth_scale=1.0)
    renderer.update(scene)
    renderer.draw([front_view((20, 10))])
    assert not depth_of(renderer, 0).any()


@pytest.mark.parametrize("scale", [-0.1, 1.01, np.nan])
def test_a_part_of_a_picture_is_between_nothing_and_all(scale):
    with pytest.raises(ValueError, match=r"depth_scale is .*, expected 0\.0 to 1\.0"):
        RenderSettings(depth_scale=scale)
