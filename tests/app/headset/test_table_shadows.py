"""Shadows that follow a scene's objects: their planes, when they are worked out anew."""

import time
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app.headset.over import over_splats
from shapeshift.app.headset.over.over_splats import RESTS_S, TableShadows
from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.pose import Pose, View, look_at, perspective
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.renderer.renderers import EITHER_ON_GL
from tests.support.splat_scenes import shell

RENDERERS = EITHER_ON_GL
BALL = shell(600)
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def a_scene(*heights: float, visible: bool = True) -> Scene:
    return Scene(tuple(
        SceneObject(f"ball {i}", BALL, Pose(np.array([3.0 * i, y, 0.0]), UPRIGHT), visible=visible)
        for i, y in enumerate(heights)
    ))  # fmt: skip


def settle(shadows: TableShadows, renderer: Renderer, scene: Scene, seconds: float = 0.0) -> None:
    """Until nothing is worked out any more."""
    renderer.update(scene)
    for _ in range(4 * len(scene.objects) + 2):
        shadows.follow(renderer, scene, seconds)
        until = time.monotonic() + 60
        while any(s.work is not None and not s.work.done() for s in shadows.standing.values()):
            assert time.monotonic() < until
            time.sleep(0.002)
    shadows.follow(renderer, scene, 0.0)


def heights(shadows: TableShadows) -> dict[str, float]:
    return {cast.name: float(cast.place[1]) for cast in shadows.casts}


def test_each_object_has_one_where_it_ends_below(renderer, ctx):
    shadows = TableShadows(ctx)
    settle(shadows, renderer, a_scene(0.0, 2.0))
    planes = heights(shadows)
    assert planes.keys() == {"ball 0", "ball 1"}
    bottom = planes["ball 0"]
    points = shadows.standing["ball 0"].blocks.points
    assert np.quantile(points[:, 1], 0.05) > bottom >= points[:, 1].min()
    assert planes["ball 1"] == pytest.approx(bottom + 2.0, abs=1e-6)
    assert [tuple(cast.place[[0, 2]]) for cast in shadows.casts] == [(0.0, 0.0), (3.0, 0.0)]
    settle(shadows, renderer, a_scene(0.0, 2.0, visible=False))
    assert not shadows.casts
    shadows.close()


def test_what_is_lifted_leaves_its_shadow_on_the_table(renderer, ctx):
    shadows = TableShadows(ctx)
    settle(shadows, renderer, a_scene(0.0))
    plane, dark = heights(shadows)["ball 0"], shadows.casts[0].shadow.occlusion.max()
    settle(shadows, renderer, a_scene(0.7))  # no time passes: it is held
    assert heights(shadows)["ball 0"] == plane
    paler = shadows.casts[0].shadow.occlusion.max()
    assert paler < 0.6 * dark
    settle(shadows, renderer, a_scene(0.7), RESTS_S)  # on a shelf
    assert heights(shadows)["ball 0"] == pytest.approx(plane + 0.7, abs=1e-6)
    assert shadows.casts[0].shadow.occlusion.max() == pytest.approx(dark, abs=1e-6)
    settle(shadows, renderer, a_scene(-0.4))  # off the table, falling
    assert heights(shadows)["ball 0"] == pytest.approx(plane - 0.4, abs=1e-6)
    shadows.close()


def test_what_only_goes_along_its_plane_is_not_worked_out_again(renderer, ctx, monkeypatch):
    asked = []

    def counted(*given):
        asked.append(given)
        return made(*given)

    made = over_splats.shadow_on
    monkeypatch.setattr(over_splats, "shadow_on", counted)
    shadows = TableShadows(ctx)
    settle(shadows, renderer, a_scene(0.0))
    assert len(asked) == 1
    scene = a_scene(0.0)
    aside = replace(scene.objects[0], world_from_object=Pose(np.array([0.4, 0.0, 0.2]), UPRIGHT))
    settle(shadows, renderer, Scene((aside,)))
    assert len(asked) == 1 and tuple(shadows.casts[0].place[[0, 2]]) == (0.4, 0.2)
    half = np.sqrt(0.5)
    turned = replace(aside, world_from_object=Pose(np.zeros(3), np.array([half, half, 0.0, 0.0])))
    settle(shadows, renderer, Scene((turned,)))
    assert len(asked) >= 2
    before = len(asked)
    settle(shadows, renderer, a_scene())
    assert not shadows.casts and len(asked) == before
    shadows.close()


def test_they_darken_the_room_below_the_splats(renderer, ctx):
    """Drawn to an eye: alpha grows around the ball, and nowhere else."""
    size = (96, 72)
    view = View(look_at((0.0, 2.5, 4.0), (0, -0.5, 0)), perspective(1.0, size), 0.05, 50.0, size)
    shadows, framebuffer = TableShadows(ctx), ctx.framebuffer([ctx.texture(size, 4)])
    framebuffer.clear()
    shadows.draw(framebuffer, view)
    assert not any(framebuffer.read(components=4))
    settle(shadows, renderer, a_scene(0.0))
    shadows.draw(framebuffer, view)
    alpha = np.frombuffer(framebuffer.read(components=4, alignment=1), np.uint8)
    alpha = alpha.reshape(72, 96, 4)[::-1, :, 3]
    assert alpha.max() > 100 and not alpha[:20].any()
    shadows.close()
