"""Two scenes that differ in their colours alone, in one frame: one projection, one sort."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.colors.decode_colors import same_shape
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.appearance import Appearance
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Scene, SceneObject, Tint
from tests.support.renderer.heat_scenes import BEHIND, VIEW, model
from tests.support.renderer.renderers import EITHER_ON_GL
from tests.support.splat_scenes import random_layers

RENDERERS = EITHER_ON_GL
SHAPE = ("offset", "scale", "rotation", "opacity")  # networks that do not see the control
MODEL = model(40, *SHAPE)
PAIRS = {  # x left and right: stops RGB 0, Hot 0.5, Open 0.8, Hotter 1
    "photo and heat": (0.0, 0.5), "photo and half": (0.0, 0.3), "heat and half": (0.5, 0.3),
    "two palettes": (0.5, 1.0), "half and two palettes": (0.2, 0.9), "the same": (0.2, 0.2),
}  # fmt: skip


def scene(x: float, **changes) -> Scene:
    return Scene((SceneObject("thing", MODEL, x=x, **changes), CLOUD))


CLOUD = SceneObject("cloud", random_layers(100), Pose(np.ones(3) * 0.2, np.array([1.0, 0, 0, 0])))


def alone(renderer: Renderer, drawn: Scene, view) -> np.ndarray:
    renderer.update(drawn)
    renderer.draw([view])
    return renderer.resolved().copy()


@pytest.mark.parametrize("xs", PAIRS.values(), ids=PAIRS)
def test_each_view_is_the_picture_of_its_scene_alone(renderer, xs):
    renderer.settings = RenderSettings(background=BEHIND)
    left, right = scene(xs[0]), scene(xs[1], appearance=Appearance(exposure=0.5))
    cut = 41
    views = VIEW.part(0, 0, (cut, 72)), VIEW.part(cut, 0, (96 - cut, 72))
    wanted = [alone(renderer, left, views[0]), alone(renderer, right, views[1])]
    for _ in range(2):  # after other frames, and after itself
        renderer.update(left)
        stats = renderer.draw_two(views, right)
        assert (stats.sorts, stats.color_sets) == (1, 2)
        for i in range(2):
            # Heat beside colours, or as a picture of values, adds up in another order.
            np.testing.assert_allclose(renderer.resolved(i), wanted[i], atol=2e-5)
    assert stats.geometry_runs == 0
    # A plain frame afterwards is what it was.
    np.testing.assert_array_equal(alone(renderer, left, views[0]), wanted[0])


def test_another_x_on_one_side_decodes_that_side_alone(renderer):
    renderer.settings = RenderSettings()
    left = scene(0.0)
    renderer.update(left)
    renderer.draw_two((VIEW, VIEW), scene(0.5))
    renderer.update(left)
    assert renderer.draw_two((VIEW, VIEW), scene(0.5)).color_runs == 0
    renderer.update(left)
    assert renderer.draw_two((VIEW, VIEW), scene(0.4)).color_runs == 1


def test_what_has_another_shape_is_refused(renderer):
    one = scene(0.0)
    thing, cloud = one.objects
    others = {
        "moved": replace(thing, world_from_object=Pose(np.ones(3), np.array([1.0, 0, 0, 0]))),
        "hidden": replace(thing, visible=False), "model": replace(thing, model=model(40)),
        "opacity": replace(thing, appearance=Appearance(opacity=0.5)),
    }  # fmt: skip
    assert same_shape(one, scene(0.7)) and same_shape(one, scene(0.7, tint=Tint((1, 0, 0), 0.5)))
    renderer.update(one)
    for name, other in others.items():
        assert not same_shape(one, Scene((other, cloud))), name
        with pytest.raises(ValueError, match="colours alone"):
            renderer.draw_two((VIEW, VIEW), Scene((other, cloud)))
    assert not same_shape(one, Scene((thing,)))
    follows = SceneObject("thing", model(40))  # its networks see the control
    assert not same_shape(Scene((follows,)), Scene((replace(follows, x=0.5),)))
