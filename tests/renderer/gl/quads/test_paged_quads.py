"""Quads by a budget: the picture of the whole scene, and after a walk the one of tiles."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.gl.paged_quads import runs_of
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


def picture_of(renderer, view=None) -> np.ndarray:
    renderer.drawing.draw([view or view_at()], renderer.settings, PassTimer(None))
    return renderer.image(0).copy()


def test_surfaces_are_those_of_tiles(quads, folder):
    """Of pages and of rows: metres and normals where something is seen."""
    model, place = open_levels(folder, 6000), Pose(np.array([2.5, 0, 0]), np.array([1.0, 0, 0, 0]))
    first, fixed, second = scene_of(model, random_layers(100), model).objects
    second = replace(second, world_from_object=place)
    scene = replace(scene_of(model), objects=(first, fixed, second))
    with Renderer(None, "tiles") as tiles:
        surfaces = []
        for renderer in (quads, tiles):
            drawn(renderer, scene, view_at())
            surfaces.append(renderer.surface(view_at()))
        mine, expected = surfaces
        seen = (expected.coverage > 0.5) & (mine.coverage > 0.5)
        assert seen.mean() > 0.2
        np.testing.assert_allclose(mine.coverage, expected.coverage, atol=0.02)
        off = np.abs(mine.metres - expected.metres)[seen] / expected.metres[seen]
        assert np.median(off) < 1e-4 and np.percentile(off, 99) < 1e-2
        assert np.percentile(np.abs(mine.normal - expected.normal)[seen], 99) < 0.02


def test_an_antialiased_model_stands_beside_a_plain_one(quads, folder):
    """Of two models in pages one is: tiles as the oracle, and neither kind for both."""
    plain, faint = open_levels(folder, ALL), open_levels(folder, ALL)
    faint = replace(faint, antialiased=True)
    far, pictures = view_at((0.0, 1.0, 40.0), size=(96, 64)), []
    place = Pose(np.array([6.0, 0, 0]), np.array([1.0, 0, 0, 0]))
    for models in ((plain, faint), (plain, plain), (faint, faint)):
        one, two = scene_of(*models).objects
        scene = replace(scene_of(plain), objects=(one, replace(two, world_from_object=place)))
        pictures.append(drawn(quads, scene, far)[0])
        with Renderer(None, "tiles") as tiles:
            assert psnr(pictures[-1], drawn(tiles, scene, far)[0]) > 45
    for other in pictures[1:]:
        assert np.abs(pictures[0] - other).max() > 0.02


def test_pages_that_are_edited_grow_beyond_those_of_one_model(quads, folder):
    """Copies that are all changed have splats of their own; their pictures, and what is read."""
    model, objects = open_levels(folder, ALL), []
    far = view_at((6.0, 0.5, 24.0), (6.0, 0.0, 0.0))
    for i, obj in enumerate(scene_of(*[model] * 6).objects):
        place = Pose(np.array([2.5 * i, 0, 0]), np.array([1.0, 0, 0, 0]))
        objects.append(replace(obj, world_from_object=place))
    whole, _ = drawn(quads, replace(scene_of(model), objects=tuple(objects)), far)
    before = len(quads.drawing.paged.uses)
    rows = quads.drawing.read_splats(0)
    for i in range(6):
        mean_opacity, covariance = (array.copy() for array in quads.drawing.read_splats(i))
        np.testing.assert_array_equal(mean_opacity, rows[0])
        mean_opacity[:, 3] *= 0.5 if i else 1.0
        quads.drawing.write_splats(i, mean_opacity, covariance if i % 2 else None)
    assert (quads.drawing.paged.uses <= 1).all() and len(quads.drawing.paged.uses) > before
    for was, now in zip(rows, quads.drawing.read_splats(0), strict=True):
        np.testing.assert_array_equal(was, now)
    np.testing.assert_array_equal(quads.drawing.read_splats(4)[1], rows[1])
    changed = np.abs(picture_of(quads, far) - whole).max(axis=(0, 2))
    assert changed[: len(changed) // 3].max() == 0 and changed.max() > 0.1
