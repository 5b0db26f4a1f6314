"""The sky behind a scene: one formula in numpy, OpenCL and GLSL, by the direction of sight."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.appearance import Sky
from shapeshift.scene.pose import Pose, View, look_at
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.renderer.frames import step_error
from tests.support.renderer.heat_scenes import model
from tests.support.renderer.renderers import EITHER_ON_GL

RENDERERS = EITHER_ON_GL
SKY = Sky((0.1, 0.3, 0.9), (0.9, 0.8, 0.7), (0.3, 0.2, 0.1))
OFF_CENTRE = (-0.9, 0.6, -0.5, 0.8)
LEVEL = View(look_at((0, 1, 4), (0, 1, 0)), (-0.8, 0.8, -0.6, 0.6), 0.1, 50, (64, 48))
VIEWS = {
    "level": LEVEL,
    "up": View(look_at((0, 0, 0), (0.3, 4, 0.1)), OFF_CENTRE, 0.1, 50, (48, 33)),
    "down, off centre": View(look_at((2, 3, 4), (0, 0, 0)), OFF_CENTRE, 0.1, 50, (31, 40)),
    "rolled": replace(LEVEL, world_from_eye=Pose(np.zeros(3), np.array([0.6, 0.0, 0.0, 0.8]))),
}


def by_rays(view: View) -> np.ndarray:
    """(H, W, 3): a ray a pixel, in the world, its elevation by the arcsine."""
    (left, right, low, high), (width, height) = view.tangents, view.size
    out = np.zeros((height, width, 3))
    for row in range(height):
        for column in range(width):
            x = left + (right - left) * (column + 0.5) / width
            y = high + (low - high) * (row + 0.5) / height
            ray = view.world_from_eye.matrix()[:3, :3] @ np.array([x, y, -1.0])
            elevation = np.arcsin(ray[1] / np.linalg.norm(ray))
            end = SKY.zenith if elevation > 0 else SKY.ground
            part = abs(np.sin(elevation))
            out[row, column] = (1 - part) * np.array(SKY.horizon) + part * np.array(end)
    return out


def shown(renderer: Renderer, view: View) -> np.ndarray:
    """(H, W, 3) uint8, row 0 on top, as a window shows it."""
    ctx = renderer.gpu.ctx
    target = ctx.framebuffer([ctx.texture(view.size, 4)])
    try:
        renderer.draw([view], target)
        pixels = np.frombuffer(target.read(components=3, alignment=1), np.uint8)
        return pixels.reshape(view.size[1], view.size[0], 3)[::-1].astype(int)
    finally:
        target.color_attachments[0].release()
        target.release()


@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)
def test_an_empty_scene_shows_the_sky_of_each_ray(ctx, renderer, view):
    renderer.settings = RenderSettings(background=SKY)
    renderer.update(Scene(()))
    wanted = by_rays(view)
    pixels = shown(renderer, view)
    np.testing.assert_allclose(renderer.resolved(), wanted, atol=1e-6)
    assert np.abs(pixels - 255 * wanted).max() <= step_error(ctx)


@pytest.mark.parametrize("x", [0.0, 0.3, 0.5], ids=["colours", "heat beside", "palette"])
def test_a_scene_stands_before_it(renderer, x):
    scene = Scene((SceneObject("thing", model(40), x=x),))
    renderer.settings = RenderSettings()
    renderer.update(scene)
    renderer.draw([LEVEL])
    plain, through = renderer.resolved().copy(), 1 - renderer.image()[..., 3:]
    renderer.settings = RenderSettings(background=SKY)
    pixels = shown(renderer, LEVEL)
    wanted = plain + through * by_rays(LEVEL)
    np.testing.assert_allclose(renderer.resolved(), wanted, atol=1e-5)
    assert np.abs(pixels - 255 * np.clip(wanted, 0, 1)).max() <= 0.6  # the nearest step, rounding


def test_one_colour_everywhere_is_that_background(renderer):
    color = (0.25, 0.5, 0.75)
    renderer.update(Scene((SceneObject("thing", model(40), x=0.2),)))
    pictures = []
    for background in (color, Sky(color, color, color)):
        renderer.settings = RenderSettings(background=background)
        pixels = shown(renderer, LEVEL)
        pictures.append((renderer.resolved().copy(), pixels))
    np.testing.assert_allclose(pictures[1][0], pictures[0][0], atol=1e-7)
    np.testing.assert_array_equal(pictures[1][1], pictures[0][1])


def test_each_eye_has_its_own_sky(renderer):
    up = replace(VIEWS["up"], size=LEVEL.size)
    renderer.settings = RenderSettings(background=SKY)
    renderer.update(Scene(()))
    renderer.draw([LEVEL, up])
    for i, view in enumerate((LEVEL, up)):
        np.testing.assert_allclose(renderer.resolved(i), by_rays(view), atol=1e-6)


def test_a_colour_that_is_none_is_refused():
    for bad in ((0.1, 0.2), (0.1, 0.2, 1.1), (0.1, 0.2, np.nan), (-0.1, 0, 0)):
        with pytest.raises(ValueError, match="zenith is"):
            Sky(bad, (0, 0, 0), (0, 0, 0))
        with pytest.raises(ValueError, match="background is"):
            RenderSettings(background=bad)
