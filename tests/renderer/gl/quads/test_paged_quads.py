"""Quads by a budget: the picture of the whole scene, and after a walk the one of tiles."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.gl.paging.paged_quads import runs_of
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.appearance import Appearance
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import Pose
from tests.support.splat_scenes import random_layers, shell
from tests.support.streamed_scenes import open_levels, scene_of, view_at, write_levels

ALL = 1_000_000


@pytest.fixture(scope="module")
def quads(session_gpu):
    with session_gpu.ctx as ctx, Renderer(ctx, "quads") as renderer:
        yield renderer
        assert ctx.error == "GL_NO_ERROR"


@pytest.fixture(scope="module", params=[1, 9], ids=["sh0", "sh2"])
def folder(request, tmp_path_factory):
    where = tmp_path_factory.mktemp("levels") / "shell"
    return write_levels(shell(2500, request.param), where)


def drawn(renderer, scene, view):
    renderer.update(scene)
    stats = renderer.draw([view])
    return renderer.image(0).copy(), stats


def test_a_budget_for_all_draws_the_whole_scene(quads, folder):
    """Of 16 bits a colour: 70 dB, where covariances made here and there differ in their last bits
    and equal depths come in another order."""
    for view in (view_at(), view_at((0.2, 0.1, 0.3))):
        image, stats = drawn(quads, scene_of(open_levels(folder, ALL)), view)
        whole, _ = drawn(quads, scene_of(read_model(folder)), view)
        assert stats.streaming.shown == stats.streaming.in_sight > 0
        assert psnr(image, whole) > 70 and whole[..., 3].max() > 0.9


def test_a_walk_by_a_small_budget_is_what_tiles_draw(quads, folder):
    """Two objects and one in full share the arena, pages come and go; then as tiles, which choose
    the same leaves."""
    model, place = open_levels(folder, 2500), Pose(np.array([2.5, 0, 0]), np.array([1.0, 0, 0, 0]))
    first, fixed, second = scene_of(model, random_layers(100), model).objects
    second = replace(second, world_from_object=place, appearance=Appearance(exposure=-0.5))
    scene = replace(scene_of(model), objects=(first, fixed, second))
    with Renderer(None, "tiles") as tiles:
        for turn in (0.0, 0.4, 2.0):
            view = view_at((6 * np.sin(turn), 0.4, 6 * np.cos(turn)))
            image, stats = drawn(quads, scene, view)
            expected, by_tiles = drawn(tiles, scene, view)
            assert stats.streaming.shown == by_tiles.streaming.shown <= 2400
            assert psnr(image, expected) > 45  # as of any scene
            assert stats.drawn == by_tiles.drawn


def test_runs_of_pages():
    assert list(runs_of(np.array([], int))) == []
    assert list(runs_of(np.array([3]))) == [(3, 4)]
    assert list(runs_of(np.array([0, 1, 2, 5, 7, 8]))) == [(0, 3), (5, 6), (7, 9)]
