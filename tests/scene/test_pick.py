"""Picking: the depth at which the light of a ray is half gone, whatever draws the splats."""

import numpy as np
import pytest

from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.model import SplatLayers, Stop
from shapeshift.scene.pick import Picker
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.models import make_random_model

EYE = np.array([0.0, 0.0, 5.0])
AHEAD = np.array([0.0, 0.0, -1.0])


def layers(means, scales, opacity, layer=None, wxyz=None) -> SplatLayers:
    count = len(means)
    return SplatLayers(
        np.asarray(means, np.float32),
        np.broadcast_to(np.asarray(scales, np.float32), (count, 3)).copy(),
        np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1)) if wxyz is None else wxyz,
        np.asarray(opacity, np.float32),
        np.zeros((count, 1, 3), np.float32),
        np.zeros(count, np.int32) if layer is None else np.asarray(layer, np.int32),
        (Stop("a", 0.0), Stop("b", 1.0)),
        mode="exclusive",
    )


def scene_of(model, **fields) -> Scene:
    return Scene((SceneObject("thing", model, **fields),))


def under(scene, origin=EYE, ray=AHEAD, **more):
    return Picker().under(scene, origin, ray, **more)


def test_an_opaque_splat_hides_what_is_behind_and_a_faint_one_does_not():
    hit = under(scene_of(layers([[0, 0, 1], [0, 0, -1]], 0.1, [0.9, 0.9])))
    np.testing.assert_allclose(hit.point, [0, 0, 1], atol=1e-6)
    assert hit.depth == pytest.approx(4) and hit.index == 0
    hit = under(scene_of(layers([[0, 0, 1], [0, 0, -1]], 0.1, [0.1, 0.9])))
    np.testing.assert_allclose(hit.point, [0, 0, -1], atol=1e-6)


def test_the_depth_is_where_the_gaussian_is_largest_along_the_ray():
    """A thin splat that leans by 45 degrees, hit beside its mean."""
    half = np.pi / 8  # half the turn about x
    wxyz = np.array([[np.cos(half), np.sin(half), 0, 0]], np.float32)
    scene = scene_of(layers([[0, 0, 0]], [0.5, 0.5, 0.001], [0.9], wxyz=wxyz))
    hit = under(scene, np.array([0, 0.2, 5.0]), spread=0.0)
    np.testing.assert_allclose(hit.point, [0, 0.2, 0.2], atol=1e-4)


def test_layers_that_x_does_not_show_are_not_met():
    model = layers([[0, 0, 1], [0, 0, -1]], 0.1, [0.9, 0.9], layer=[0, 1])
    picker = Picker()
    for x, z in [(0.0, 1), (1.0, -1), (0.0, 1)]:
        assert picker.under(scene_of(model, x=x), EYE, AHEAD).point[2] == pytest.approx(z)


def test_poses_count_and_hidden_objects_do_not():
    model = layers([[0, 0, 0]], 0.1, [0.9])
    turned = Pose(np.array([0.0, 0, 2]), np.array([np.sqrt(0.5), 0, np.sqrt(0.5), 0]))
    scene = Scene(
        (
            SceneObject("near but hidden", model, Pose(np.array([0, 0, 3.0]), turned.wxyz),
                        visible=False),
            SceneObject("far", model),
            SceneObject("met", model, turned),
        )
    )  # fmt: skip
    hit = under(scene)
    assert hit.index == 2
    np.testing.assert_allclose(hit.point, [0, 0, 2], atol=1e-6)


def test_beside_behind_and_in_an_empty_scene_there_is_nothing():
    scene = scene_of(layers([[0, 0, 0]], 0.1, [0.9]))
    assert under(scene, ray=np.array([1.0, 0, 0])) is None
    assert under(scene, ray=-AHEAD) is None
    assert under(Scene(())) is None
    assert under(scene_of(layers([[0, 0, 0]], 0.1, [0.04]))) is None  # too faint to be meant


def test_a_thin_splat_is_met_by_a_hand_that_is_a_pixel_off():
    scene = scene_of(layers([[0.005, 0, 0]], 1e-4, [0.9]))
    assert under(scene, spread=0.0) is None
    assert under(scene, spread=0.002) is not None


def test_a_decoded_model_is_met_where_its_splats_are():
    """The ray through an opaque splat's mean meets light no later than that mean."""
    model = make_random_model()
    splats = evaluate(model, 0.3, EYE)
    solid = np.flatnonzero(splats.opacity > 0.5)[:20]
    assert len(solid)
    for i in solid:
        ray = splats.means[i] - EYE
        hit = under(scene_of(model, x=0.3), EYE, ray)
        assert hit is not None and hit.depth <= np.linalg.norm(ray) * 1.05 + 0.2
