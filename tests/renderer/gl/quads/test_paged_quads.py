"""Quads by a budget: the picture of the whole scene, and after a walk the one of tiles."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.gl.paging.paged_quads import runs_of
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.timing import PassTimer
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


def faded(renderer, folder) -> tuple[list[np.ndarray], list[int]]:
    """Frames of one view in motion as the budget doubles, until nothing changes; and how many
    leaves fade in each.
    """
    drawn(renderer, scene_of(open_levels(folder, 1500)), view_at())  # of 2,500
    stream, pictures, held = renderer.streaming.stream, [], []
    whole = stream.left
    for n, budget in enumerate((whole, whole // 2)):  # what frames want is read then
        stream.left = budget
        renderer.draw([replace(view_at(), near=0.06 + 0.001 * n)])  # another one: it is asked again
    stream.left = whole
    renderer.streaming.converges = False
    try:
        for _ in range(60):
            pending = renderer.draw([view_at()]).streaming.pending
            held.append(int(np.count_nonzero(np.unique(stream.table.left) >= 0)))
            pictures.append(renderer.image(0).copy())
            if not pending:
                return pictures, held
    finally:
        renderer.streaming.converges = True
    raise AssertionError("it never rests")


def test_levels_fade_as_those_of_tiles(quads, folder):
    """The other drawing as the oracle: frame by frame the same leaves fade by the same parts."""
    mine, held = faded(quads, folder)
    with Renderer(None, "tiles") as tiles:
        other, by_tiles = faded(tiles, folder)
    assert held == by_tiles and max(held) > 0 and held[-1] == 0
    for image, expected in zip(mine, other, strict=True):
        assert psnr(image, expected) > 45  # as of any scene


@pytest.mark.parametrize("part", [0.0, 0.25, 1.0])
def test_parts_survive_what_is_written_over_splats(quads, folder, part):
    """And what is read of them knows nothing of parts."""
    _, _ = drawn(quads, scene_of(open_levels(folder, ALL)), view_at())
    drawing, pages = quads.drawing, quads.drawing.pages_of(0)[::3]
    before = drawing.read_splats(0)
    whole = picture_of(quads)
    drawing.weigh_pages(pages, part)
    weighed = picture_of(quads)
    for was, now in zip(before, drawing.read_splats(0), strict=True):
        np.testing.assert_array_equal(was, now)
    drawing.write_splats(0, *before)
    np.testing.assert_array_equal(picture_of(quads), weighed)
    assert np.abs(weighed - whole).max() > 0.05 or part == 1
    drawing.weigh_pages(pages, 1.0)
    np.testing.assert_array_equal(picture_of(quads), whole)


def picture_of(renderer) -> np.ndarray:
    renderer.drawing.draw([view_at()], renderer.settings, PassTimer(None))
    return renderer.image(0).copy()
