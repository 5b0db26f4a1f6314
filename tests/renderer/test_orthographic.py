"""Orthographic views: a lens so long that nobody tells it from a parallel projection."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.rasterizer.reference import blend
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.rotation import normalize, rotation_matrices
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import PARALLAX_PX, View, look_at, orthographic, perspective
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.renderer.renderers import EITHER_ON_GL
from tests.support.splat_scenes import random_layers

RENDERERS = EITHER_ON_GL
SIZE, EYE, RADIUS = (160, 120), (1.0, 2.0, 3.0), 2.5
DISTANCE = float(np.linalg.norm(EYE))
PLAIN = View(look_at(EYE, (0, 0, 0)), perspective(0.8, SIZE), 0.02, 500.0, SIZE)
OFF_CENTRE = replace(PLAIN, tangents=(-0.7, 0.35, -0.2, 0.6))


def parallel_pixels(view: View, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n, 2) pixels and (n,) depths of world points by parallel rays: no division by depth; and
    (2,) pixels a metre.
    """
    (left, right, low, high), (width, height) = view.tangents, view.size
    in_eye = points @ view.eye_from_world()[:3, :3].T + view.eye_from_world()[:3, 3]
    scale = np.array([width / (right - left), height / (high - low)]) / DISTANCE
    x = in_eye[:, 0] * scale[0] - left * scale[0] * DISTANCE
    y = high * scale[1] * DISTANCE - in_eye[:, 1] * scale[1]
    return np.stack([x, y], axis=1), -in_eye[:, 2], scale


def parallel_picture(layers, view: View) -> np.ndarray:
    """(H, W, 3) float64: EWA splatting of a parallel projection, whose Jacobian is constant."""
    pixels, depth, scale = parallel_pixels(view, layers.means.astype(np.float64))
    axes = rotation_matrices(normalize(layers.wxyz)) * layers.scales[:, None, :]
    flat = view.eye_from_world()[:3, :3] @ axes
    flat = flat[:, :2] * np.array([scale[0], -scale[1]])[:, None]
    covariance = flat @ np.swapaxes(flat, 1, 2) + 0.3 * np.eye(2)
    color = np.maximum(0.5 + 0.28209479177387814 * layers.sh[:, 0], 0).astype(np.float64)
    kept = layers.opacity >= 1 / 255
    order = np.flatnonzero(kept)[np.argsort(depth[kept], kind="stable")]
    threshold = 2 * np.log(layers.opacity[order].astype(np.float64) * 255)
    extent = np.sqrt(threshold[:, None] * np.diagonal(covariance[order], axis1=1, axis2=2))
    conic = np.linalg.inv(covariance[order])[:, (0, 0, 1), (0, 1, 1)]
    opacity = layers.opacity[order].astype(np.float64)
    parts = (pixels[order], conic, threshold, extent, opacity, color[order], view.size)
    return blend(*parts)[0]


@pytest.mark.parametrize("plain", [PLAIN, OFF_CENTRE], ids=["centred", "off centre"])
def test_every_point_of_the_scene_lies_where_parallel_rays_meet_the_picture(plain):
    view = orthographic(plain, DISTANCE, RADIUS)
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(4000, 3))
    points = directions / np.linalg.norm(directions, axis=1, keepdims=True) * RADIUS
    points *= rng.uniform(0, 1, (4000, 1))
    wanted, _, _ = parallel_pixels(plain, points)
    inside = ((wanted > 0) & (wanted < plain.size)).all(axis=1)
    camera, fx, fy, cx, cy = view.pinhole()
    at = points @ camera[:3, :3].T + camera[:3, 3]
    found = np.stack([fx * at[:, 0] / at[:, 2] + cx, fy * at[:, 1] / at[:, 2] + cy], axis=1)
    away = np.linalg.norm(found - wanted, axis=1)[inside]
    assert inside.sum() > 500 and away.max() < PARALLAX_PX
    assert away.max() > 0.2 * PARALLAX_PX, "the lens is no longer than it has to be"
    assert at[:, 2].min() > view.near and at[:, 2].max() < view.far


def test_the_plane_at_the_distance_keeps_its_size_exactly():
    view = orthographic(OFF_CENTRE, DISTANCE, RADIUS)
    axes = OFF_CENTRE.world_from_eye.matrix()[:3, :3]
    point = np.array(EYE) - DISTANCE * axes[:, 2] + 0.4 * axes[:, 0] - 0.3 * axes[:, 1]
    for plain, other in ((OFF_CENTRE, view),):
        places = []
        for one in (plain, other):
            camera, fx, fy, cx, cy = one.pinhole()
            at = camera[:3, :3] @ point + camera[:3, 3]
            places.append((fx * at[0] / at[2] + cx, fy * at[1] / at[2] + cy))
        np.testing.assert_allclose(*places, atol=1e-6)


@pytest.mark.parametrize("plain", [PLAIN, OFF_CENTRE], ids=["centred", "off centre"])
def test_the_picture_is_that_of_a_parallel_projection(renderer: Renderer, plain):
    layers = random_layers(400, coefficients=1)
    renderer.settings = RenderSettings()
    renderer.update(Scene((SceneObject("cloud", layers),)))
    renderer.draw([orthographic(plain, DISTANCE, RADIUS)])
    found, wanted = renderer.image()[..., :3].copy(), parallel_picture(layers, plain)
    renderer.draw([plain])
    eye = renderer.image()[..., :3]
    # A quarter of a pixel at the rim costs some dB; perspective differs by tens of pixels.
    assert psnr(found, wanted) > 40 > 30 > psnr(eye, wanted)


def test_the_near_plane_cuts_where_it_does_from_the_eye(renderer: Renderer):
    layers = random_layers(400, coefficients=1)
    renderer.update(Scene((SceneObject("cloud", layers),)))
    depth = -(layers.means @ PLAIN.eye_from_world()[2, :3] + PLAIN.eye_from_world()[2, 3])
    renderer.settings = RenderSettings(min_alpha=1e-3)
    behind = orthographic(PLAIN, DISTANCE, RADIUS, near_m=DISTANCE)
    drawn = renderer.draw([behind]).drawn
    whole = renderer.draw([orthographic(PLAIN, DISTANCE, RADIUS)]).drawn
    assert 0.3 < drawn / whole < 0.7 and 0.3 < (depth > DISTANCE).mean() < 0.7
