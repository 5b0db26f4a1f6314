"""Frames in motion: no more than a part of the budget changes, what rests becomes whole."""

import time

import numpy as np
import pytest

from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.streaming import stream as module
from shapeshift.renderer.streaming.in_sight import STEPS, views_ahead
from shapeshift.renderer.streaming.stream import Stream
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import View
from tests.support.splat_scenes import shell
from tests.support.streamed_scenes import open_levels, scene_of, view_at, write_levels

BUDGET = 6000


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_levels(shell(12_000), tmp_path_factory.mktemp("levels") / "shell", 400)


@pytest.fixture
def moving():
    with Renderer(None, "tiles") as renderer:
        renderer.streaming.converges = False
        yield renderer


def rest(renderer: Renderer, view: View, most: int = 400):
    """Frames of the same view until nothing is on its way."""
    for _ in range(most):
        stats = renderer.draw([view]).streaming
        if not stats.pending:
            return stats
        time.sleep(0.002)  # for the thread that reads
    raise AssertionError(f"still on its way after {most} frames: {stats}")


def orbit(count: int) -> list[View]:
    turns = np.linspace(0, 2, count)
    return [view_at((4 * np.sin(turn), 0.4, 4 * np.cos(turn))) for turn in turns]


def test_the_first_frame_has_the_coarsest_of_all_that_is_in_sight(moving, folder):
    model = open_levels(folder, BUDGET)
    moving.update(scene_of(model))
    stats = moving.draw([view_at()]).streaming
    held = moving.streaming.stream.find_sight([np.eye(4)], [True], [view_at()]).held
    assert (moving.streaming.stream.table.level[held] >= 0).all()
    assert stats.pending and stats.shown >= model.splat_count * held.mean() * 0.5


def test_a_view_that_rests_becomes_what_a_still_picture_has(moving, folder):
    """The same levels as one picture of its own chooses, but for what hysteresis keeps: none at
    the first rest."""
    view = view_at((0, 0.5, 3.5))
    moving.update(scene_of(open_levels(folder, BUDGET)))
    rest(moving, view)
    image = moving.image(0).copy()
    assert not moving.streaming.due
    with Renderer(None, "tiles") as still:
        still.update(scene_of(open_levels(folder, BUDGET)))
        still.draw([view])
        expected, held = still.image(0), still.streaming.stream.table
    table = moving.streaming.stream.table
    drawn = held.level >= 0
    assert (table.level[drawn] == held.level[drawn]).mean() > 0.9
    with Renderer(None, "tiles") as other:
        other.update(scene_of(read_model(folder)))
        other.draw([view])
        whole = other.image(0)
    assert psnr(image, whole) > psnr(expected, whole) - 0.5


def test_in_motion_few_change_and_never_more_than_the_budget(moving, folder, monkeypatch):
    monkeypatch.setattr(module, "CHANGED", 0.1)
    moving.update(scene_of(open_levels(folder, BUDGET)))
    rest(moving, orbit(1)[0])
    stream: Stream = moving.streaming.stream
    for view in orbit(60):
        before = stream.table.level.copy()
        stats = moving.draw([view]).streaming
        table = stream.table
        assert table.splats.sum() == stats.shown <= BUDGET
        uploaded = np.flatnonzero((table.level != before) & (table.level >= 0))
        # What comes into sight is there at once, and at least one leaf gets finer.
        finer = uploaded[before[uploaded] >= 0]
        assert table.splats[finer].sum() <= 0.1 * BUDGET + 400
        pages = np.bincount(table.leaf_of[table.leaf_of >= 0], minlength=len(table.level))
        assert (pages == -(-table.splats // 32)).all()
    rest(moving, orbit(60)[-1])


def test_what_is_in_the_arena_is_what_the_table_says(moving, folder):
    """After a walk every page holds the rows of its leaf at its level, and no other opacity is
    above 0."""
    model = open_levels(folder, BUDGET)
    moving.update(scene_of(model))
    for view in orbit(40):
        moving.draw([view])
    table, drawing = moving.streaming.stream.table, moving.drawing
    mean_opacity, _, _ = drawing.splat_points()
    rows = mean_opacity.reshape(-1, 32, 4)
    assert not rows[table.is_free][..., 3].any()
    for leaf in np.flatnonzero(table.level >= 0)[::5]:
        (part,) = model.leaves.read(np.array([leaf]), table.level[[leaf]])
        mine = rows[np.flatnonzero(table.leaf_of == leaf)].reshape(-1, 4)[: len(part.means)]
        np.testing.assert_array_equal(mine[:, :3], part.means)
        np.testing.assert_array_equal(mine[:, 3], part.opacity)


def test_a_file_that_breaks_on_the_way_leaves_its_leaves_coarse_and_is_named(moving, tmp_path):
    folder = write_levels(shell(3000), tmp_path / "half")
    model = open_levels(folder, 100_000)
    (folder / "0_0" / "sh0.webp").write_bytes(b"RIFF")
    moving.update(scene_of(model))
    stats = rest(moving, view_at())
    assert "half: 0_0/meta.json cannot be read" in stats.problem
    assert stats.shown == model.leaves.levels.counts[:, 1].sum()
    assert not moving.streaming.due


def test_pages_of_many_files_come_through_a_cache_that_holds_one(moving, folder):
    model = open_levels(folder, BUDGET, cache=1)
    moving.update(scene_of(model))
    moving.streaming.converges = True
    stats = moving.draw([view_at()]).streaming
    assert stats.shown > 0.9 * BUDGET and model.leaves.cache.taken <= 1


def test_steps_lead_on():
    turned = [view_at((np.sin(t), 0, np.cos(t))) for t in (0.0, 0.01)]
    (ahead,) = views_ahead(turned[:1], turned[1:])
    step = turned[1].world_from_eye.position - turned[0].world_from_eye.position
    place = turned[1].world_from_eye.position + STEPS * step
    np.testing.assert_allclose(ahead.world_from_eye.position, place)
    look = ahead.world_from_eye.matrix()[:3, 2]
    expected = [np.sin(0.01 * (1 + STEPS)), 0, np.cos(0.01 * (1 + STEPS))]
    np.testing.assert_allclose(look, expected, atol=1e-9)
    assert views_ahead(turned[:1], turned[:1]) == [] and views_ahead([], turned) == []
    jump = [view_at((np.sin(3.0), 0, np.cos(3.0)))]
    assert views_ahead(turned[:1], jump) == []
