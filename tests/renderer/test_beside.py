"""Parts of two eyes' pictures at another look, in the order that the eyes were drawn in."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.appearance import Appearance
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.renderer.heat_scenes import BEHIND, VIEW, model
from tests.support.renderer.renderers import EITHER_ON_GL
from tests.support.splat_scenes import random_layers

RENDERERS = EITHER_ON_GL
MODEL = model(40, "offset", "scale", "rotation", "opacity")  # networks that see no control
CLOUD = SceneObject("cloud", random_layers(100), Pose(np.ones(3) * 0.2, np.array([1.0, 0, 0, 0])))
APART_M = 0.064
PAIRS = {  # x of the eyes and of the parts: stops RGB 0, Hot 0.5, Open 0.8, Hotter 1
    "photo and heat": (0.0, 0.5), "heat and photo": (0.5, 0.0), "photo and half": (0.0, 0.3),
    "two palettes": (0.5, 1.0), "several palettes": (0.2, 0.9),
}  # fmt: skip


def scene(x: float, **changes) -> Scene:
    return Scene((SceneObject("thing", MODEL, x=x, **changes), CLOUD))


def eyes() -> list[View]:
    right = np.array([APART_M, 0, 0])
    moved = (VIEW.world_from_eye.position + right * way for way in (-0.5, 0.5))
    return [replace(VIEW, world_from_eye=Pose(at, VIEW.world_from_eye.wxyz)) for at in moved]


EYES = eyes()
PARTS = [eye.part(20 - 4 * i, 11, (48, 40)) for i, eye in enumerate(EYES)]


def settings(colors: str = "each") -> RenderSettings:
    return RenderSettings(background=BEHIND, stereo_colors=colors)


def drawn(renderer: Renderer, what: Scene, views: list[View]) -> list[np.ndarray]:
    renderer.keeps_beside = False
    renderer.update(what)
    renderer.draw(views)
    return [renderer.resolved(i).copy() for i in range(len(views))]


@pytest.mark.parametrize("colors", ["each", "shared"])
@pytest.mark.parametrize("xs", PAIRS.values(), ids=PAIRS)
def test_parts_are_those_of_the_other_scene_and_the_eyes_stay(renderer, xs, colors):
    """Against frames of one scene each, which know nothing of a second look."""
    renderer.settings = settings(colors)
    one, other = scene(xs[0]), scene(xs[1], appearance=Appearance(exposure=0.5))
    wanted = drawn(renderer, one, EYES)
    renderer.settings = settings("shared")  # parts have the colours of the middle
    inside = drawn(renderer, other, PARTS)
    renderer.settings = settings(colors)
    for _ in range(2):  # after other frames, and after itself
        renderer.keeps_beside = True
        renderer.update(one)
        stats = renderer.draw(EYES)
        renderer.draw_beside(PARTS, other, 2)
        assert (stats.sorts, stats.geometry_runs) == (1, 0)
        for i in range(2):
            np.testing.assert_allclose(renderer.resolved(i), wanted[i], atol=2e-5)
            np.testing.assert_allclose(renderer.resolved(2 + i), inside[i], atol=2e-5)
    for again, before in zip(drawn(renderer, one, EYES), wanted, strict=True):
        np.testing.assert_allclose(again, before, atol=2e-5)


def test_at_rest_nothing_is_shaded_and_another_stop_shades_itself_alone(renderer):
    renderer.settings = settings("shared")
    renderer.keeps_beside = True
    runs = []
    for x in (0.5, 0.5, 1.0):
        renderer.update(scene(0.0))
        runs.append(renderer.draw(EYES).color_runs)
        renderer.draw_beside(PARTS, scene(x), 2)
    renderer.update(scene(0.0))
    runs.append(renderer.draw(EYES).color_runs)
    # Those of the parts are counted with the next frame: both objects at first, then who changed.
    assert runs == [2, 2, 0, 1]


def test_what_has_another_shape_is_refused(renderer):
    renderer.settings = settings()
    renderer.update(scene(0.0))
    renderer.draw(EYES)
    with pytest.raises(ValueError, match="colours alone"):
        renderer.draw_beside(PARTS, scene(0.5, visible=False), 2)
