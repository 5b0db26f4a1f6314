"""Two eyes from one projection and one order: where things stand, and what is shared when."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.gl.context import is_software
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.pose import View, look_at
from tests.support.renderer.eye_views import APART, eyes
from tests.support.renderer.frames import draw
from tests.support.renderer.renderers import TILES, quads
from tests.support.splat_scenes import (
    alone,
    front_view,
    one_splat,
    psnr_db,
    stereo_views,
    two_objects,
)

RENDERERS = {
    "tiles": TILES,
    "gl": quads(sort="gl", pair=False),
    "numpy": quads(sort="numpy", pair=False),
    "pair": quads(sort="numpy", pair=True),
}


def skip_a_pair(renderer: Renderer) -> None:
    if getattr(renderer.drawing, "stereo_pair", None) is not None:
        pytest.skip("two views in one draw are rounded otherwise: see test_one_draw_is_two")


def centre_of(image: np.ndarray) -> np.ndarray:
    """(x, y) pixels of the centre of coverage."""
    weight = image[..., 3].astype(np.float64)
    y, x = np.mgrid[: image.shape[0], : image.shape[1]] + 0.5
    return np.array([(weight * x).sum(), (weight * y).sum()]) / weight.sum()


@pytest.mark.parametrize("z", [1.0, 0.0, -3.0])
def test_disparity_is_the_baseline_times_the_focal_length_over_depth(renderer, z):
    tangents = (-0.5, 0.5, -0.3125, 0.3125)  # 320 pixels a unit of tangent
    scene = alone(one_splat(means=[[0.03, -0.02, z]], scales=[[0.02] * 3]))
    left, right = draw(renderer, scene, eyes(tangents))
    shift = centre_of(left) - centre_of(right)
    np.testing.assert_allclose(shift, [APART * 320 / (2 - z), 0], atol=0.01)


def test_fields_of_view_that_differ_from_eye_to_eye_put_things_where_they_are(renderer):
    views = eyes((-0.9, 0.5, -0.4, 0.3), (-0.5, 0.9, -0.4, 0.3))
    place = np.array([0.1, 0.05, 0.3])
    images = draw(renderer, alone(one_splat(means=[place], scales=[[0.004] * 3])), views)
    for view, image in zip(views, images, strict=True):
        camera_from_world, fx, fy, cx, cy = view.pinhole()
        p = camera_from_world[:3, :3] @ place + camera_from_world[:3, 3]
        want = [fx * p[0] / p[2] + cx, fy * p[1] / p[2] + cy]
        np.testing.assert_allclose(centre_of(image), want, atol=0.02)


@pytest.mark.parametrize("order", ["depth", "distance"])
def test_a_shared_order_is_a_sort_for_each_eye_bit_for_bit(renderer, order):
    skip_a_pair(renderer)
    scene, views = two_objects(6000), stereo_views((160, 120))
    shared = draw(renderer, scene, views, order=order)
    each = draw(renderer, scene, views, order=order, stereo_sort="each")
    alone_each = [draw(renderer, scene, [view], order=order)[0] for view in views]
    for one, two, three in zip(shared, each, alone_each, strict=True):
        if order == "depth":  # parallel eyes see the same depths; distances differ a little
            np.testing.assert_array_equal(one, two)
            np.testing.assert_array_equal(two, three)  # nothing is shared but the order
        assert psnr_db(one, two) > 40
        assert psnr_db(two, three) > 90  # one order of distances, or each eye's own


@pytest.mark.parametrize("cant", [0.3, 4.0])
def test_canted_eyes_are_the_reference(renderer, cant):
    scene = two_objects(3000)
    views = eyes((-0.9, 0.6, -0.5, 0.5), (-0.6, 0.9, -0.5, 0.5), cant)
    images = draw(renderer, scene, views)
    for view, image in zip(views, images, strict=True):
        want = reference_image(scene, view)
        # Below a degree of cant the order is the centre's: nearly each eye's.
        assert psnr_db(image, want) > (80 if cant > 1 else 45)


def test_canted_eyes_sort_each_for_itself(renderer):
    skip_a_pair(renderer)
    scene = two_objects(3000)
    views = eyes((-0.9, 0.6, -0.5, 0.5), (-0.6, 0.9, -0.5, 0.5), 4.0)
    for one, two in zip(
        draw(renderer, scene, views), draw(renderer, scene, views, stereo_sort="each"), strict=True
    ):
        np.testing.assert_array_equal(one, two)


def test_eyes_of_different_sizes_and_more_than_two(renderer):
    scene, views = two_objects(3000), stereo_views((96, 80))
    other = replace(views[1], size=(60, 90))
    behind = View(look_at((0.4, 0.8, -4.0), (0, 0, 0)), (-0.4, 0.4, -0.4, 0.4), 0.05, 50, (50, 40))
    for group in ([views[0], other], [*views, front_view((64, 48))], [*views, behind]):
        for view, image in zip(group, draw(renderer, scene, group), strict=True):
            assert image.shape == (view.size[1], view.size[0], 4)
            # Hardware interpolates a splat's place less finely: 78.5 dB on an H100.
            quads = renderer.backends["drawing"].startswith("quads")
            hardware = quads and not is_software(renderer.gpu.ctx)
            assert psnr_db(image, reference_image(scene, view)) > (78 if hardware else 80)


def test_a_view_of_nothing_beside_one_of_something(renderer):
    scene, (view, _) = two_objects(1000), stereo_views((96, 80))
    beside = replace(view, tangents=(3, 4, 3, 4))
    something, nothing = draw(renderer, scene, [view, beside])
    np.testing.assert_array_equal(something, draw(renderer, scene, [view])[0])
    assert something.any() and not nothing.any()
