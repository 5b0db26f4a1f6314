"""Copies of one object draw the same pages: beside objects that were read one by one."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.debug.debug import object_color
from shapeshift.renderer.gl import buffers
from shapeshift.renderer.gl.gpu import overwrite
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.splats.parents import with_parents
from shapeshift.scene.appearance import Appearance
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Scene, SceneObject, Tint
from shapeshift.scene.sections.section_texts import read_section
from tests.support.splat_scenes import random_layers, shell
from tests.support.streamed_scenes import open_levels, scene_of, view_at, write_levels

BUDGET = 6000
VIEWS = [view_at((2 * np.sin(turn), 0.4, 5 * np.cos(turn))) for turn in np.linspace(0, 1, 12)]
EDITS = {
    "fainter": {"appearance": Appearance(opacity=0.5)},
    "cut": {"sections": (read_section("plane:1,0,0,0.1:hard", ()),)},
    "darker": {"appearance": Appearance(exposure=-1.0)},
    "tinted": {"tint": Tint((1.0, 0.0, 0.0), 0.5)},
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_levels(shell(3000, 1), tmp_path_factory.mktemp("levels") / "shell")


@pytest.fixture(params=["tiles", "quads"])
def opened(request):
    """Opens a renderer: both drawings share pages, each in its own way."""
    if request.param == "tiles":
        yield lambda: Renderer(None, "tiles")
        return
    with request.getfixturevalue("session_gpu").ctx as ctx:
        yield lambda: Renderer(ctx, "quads")
        assert ctx.error == "GL_NO_ERROR"


UPRIGHT = np.array([1.0, 0, 0, 0])


def standing(scene: Scene, **first) -> Scene:
    """Its objects in a row, turned a little more each; the first one looks otherwise."""
    objects = []
    for i, obj in enumerate(scene.objects):
        pose = Pose(np.array([2.1 * i - 3, 0, -1.3 * i]), np.array([np.cos(i), 0, np.sin(i), 0]))
        objects.append(replace(obj, world_from_object=pose, **(first if i == 0 else {})))
    return replace(scene, objects=tuple(objects))


def both(folder, count: int = 4) -> tuple[Scene, Scene]:
    """Copies of one model, and as many that were read one by one."""
    one = open_levels(folder, BUDGET)
    return scene_of(*[one] * count), scene_of(*[open_levels(folder, BUDGET) for _ in range(count)])


def pages_in_use(renderer: Renderer) -> tuple[int, int]:
    """Those drawn, and those that their splats lie in."""
    pages = renderer.drawing.paged
    assert pages.uses.sum() == np.count_nonzero(pages.stored >= 0)
    np.testing.assert_array_equal(
        pages.uses, np.bincount(pages.stored[pages.stored >= 0], minlength=len(pages.uses))
    )
    return int(pages.uses.sum()), int(np.count_nonzero(pages.uses))


@pytest.mark.parametrize("coefficients", [1, 9])
def test_pictures_are_those_of_separate_objects_to_the_bit(opened, tmp_path, coefficients):
    folder = write_levels(shell(2000, coefficients), tmp_path / "shell")
    shared, apart = map(standing, both(folder))
    with opened() as one, opened() as other:
        one.update(shared)
        other.update(apart)
        for view in VIEWS[::3]:
            pair = (view, replace(view, size=(80, 48)))
            one.draw([*pair])
            other.draw([*pair])
            for i in range(2):
                np.testing.assert_array_equal(one.image(i), other.image(i))
        assert one.image(0)[..., 3].max() > 0.9
        drawn, stored = pages_in_use(one)
        assert stored < 0.7 * drawn  # four copies, at levels of their own
        assert pages_in_use(other)[0] == pages_in_use(other)[1] == drawn
        np.testing.assert_array_equal(one.surface(VIEWS[0]).metres, other.surface(VIEWS[0]).metres)


@pytest.mark.parametrize("edit", EDITS)
def test_a_copy_that_is_changed_changes_alone_also_in_motion(opened, folder, edit):
    """It gets pages of its own when it is changed, others go on sharing, and back."""
    shared, apart = both(folder)
    with opened() as one, opened() as other:
        one.streaming.converges = other.streaming.converges = True
        for n, view in enumerate(VIEWS):
            first = EDITS[edit] if 4 <= n < 8 else {}
            for renderer, scene in ((one, shared), (other, apart)):
                renderer.update(standing(scene, **first))
                renderer.draw([view])
            np.testing.assert_array_equal(one.image(0), other.image(0))
            drawn, stored = pages_in_use(one)
            assert stored < drawn


def test_frames_in_motion_share_too(opened, folder):
    shared = standing(both(folder)[0])
    with opened() as one:
        one.streaming.converges = False
        one.update(shared)
        for view in VIEWS:
            for _ in range(3):
                one.draw([view])
            drawn, stored = pages_in_use(one)
            table, pages = one.streaming.stream.table, one.drawing.paged
            # Copies at the same level draw the same rows.
            counts = np.unique(pages.stored[(pages.stored >= 0) & (table.left < 0)])
            levels = table.level.reshape(4, -1)
            shown = [set(column[column >= 0]) for column in levels.T]
            assert stored <= drawn
            sources = shared.objects[0].model.leaves.levels.counts
            most = sum(-(-sources[i, k] // 32) for i, each in enumerate(shown) for k in each)
            assert 0 < len(counts) <= most


def test_a_hundred_copies_lie_in_the_pages_of_one(opened, folder):
    model = open_levels(folder, 20_000)
    with opened() as renderer:
        renderer.update(standing(scene_of(*[model] * 100)))
        stats = renderer.draw([view_at((0, 2, 8))])
        drawn, stored = pages_in_use(renderer)
        assert stats.streaming.shown <= 20_000 and drawn > 4 * stored
        every = with_parents(model)[0].leaves.levels.counts  # parents have pages, too
        assert len(every) > len(model.leaves.levels.counts)
        assert len(renderer.drawing.paged.uses) == (-(-every // 32)).sum()


def test_colors_of_copies_write_no_map_of_pages(session_gpu, folder, monkeypatch):
    """The map is of all pages: written for each copy, a thousand would write half a gigabyte."""
    written = []

    def note(buffer, data):
        written.append(buffer)
        overwrite(buffer, data)

    monkeypatch.setattr(buffers, "overwrite", note)
    model = open_levels(folder, BUDGET)
    with session_gpu.ctx as ctx, Renderer(ctx, "quads") as renderer:
        renderer.streaming.converges = False
        renderer.update(standing(scene_of(*[model] * 20)))
        renderer.draw(VIEWS[:1])
    maps = sum(buffer is renderer.drawing.paged.buffer for buffer in written)
    assert len(written) - maps >= 9, "a list of pages for each copy in sight"
    assert maps <= 3, "new pages, their colours and a frame"


@pytest.mark.parametrize("converges", [True, False])
def test_a_small_budget_shows_something_of_every_copy(opened, folder, converges):
    """Where their coarsest levels are seven times the budget: parents stand for them."""
    model, places = open_levels(folder, 6000), np.mgrid[-4:5, -3:4].reshape(2, -1).T
    assert 63 * int(np.bincount(model.leaves.coarse_leaf).sum()) > 7 * 6000
    objects = [
        SceneObject(f"object {i}", model, Pose(np.array([3.0 * x, 3.0 * y, 0]), UPRIGHT))
        for i, (x, y) in enumerate(places)
    ]
    with opened() as renderer:
        renderer.streaming.converges = converges
        renderer.update(Scene(tuple(objects)))
        for step in range(4):
            view = view_at((step, 0.2 * step, 30), size=(320, 240))
            stats = renderer.draw([view])
            assert 3000 < stats.streaming.shown <= 6000
            assert set(renderer.drawing.paged.owner) >= set(range(63))
            eyes = view.eye_from_world() @ np.c_[3.0 * places, 0 * places + [0, 1]].T
            assert (eyes[2] < 0).all()
            left, right, down, up = view.tangents
            across = (eyes[0] / -eyes[2] - left) / (right - left) * 320
            below = (up - eyes[1] / -eyes[2]) / (up - down) * 240
            alpha = renderer.image(0)[below.astype(int), across.astype(int), 3]
            assert alpha.min() > 0.5


def test_objects_in_full_and_other_models_stand_beside(opened, folder, tmp_path):
    """Rows of objects without levels come first and stay where they are."""
    other = write_levels(shell(900, 4), tmp_path / "other")
    scenes = []
    for again in (False, True):
        one, two = open_levels(folder, BUDGET), open_levels(other, BUDGET)
        models = [one, random_layers(77), two, one, two]
        if again:
            models[3:] = [open_levels(folder, BUDGET), open_levels(other, BUDGET)]
        scenes.append(standing(scene_of(*models)))
    pictures, points = [], []
    for scene in scenes:
        with opened() as renderer:
            renderer.update(scene)
            renderer.draw([VIEWS[0]])
            pictures.append(renderer.image(0))
            mean_opacity, owner, _ = renderer.drawing.splat_points()
            there = mean_opacity[:, 3] > 0
            rows = np.column_stack([owner, mean_opacity])[there]
            points.append(rows[np.lexsort(rows.T)])
    np.testing.assert_array_equal(*pictures)
    np.testing.assert_array_equal(*points)


def test_the_debug_picture_of_objects_tells_copies_apart(opened, folder):
    """Pages lie anywhere: each copy has its own colour, and the legend its own number."""
    scene = standing(both(folder)[0])
    with opened() as renderer:
        renderer.settings = RenderSettings(debug="object")
        renderer.update(scene)
        for view in (view_at((0, 1, 9)), view_at((4, 1, 8)), view_at((0, 1, 9))):
            stats = renderer.draw([view])
        mean_opacity, owner, _ = renderer.drawing.splat_points()
        shown = np.bincount(owner[mean_opacity[:, 3] > 0], minlength=4)
        assert list(stats.debug.values()) == shown.tolist() and shown.sum() == stats.streaming.shown
        picture = renderer.resolved(0)
        renderer.settings = RenderSettings()
        for i, obj in enumerate(scene.objects):
            one = replace(scene, objects=tuple(
                replace(other, visible=other is obj) for other in scene.objects))  # fmt: skip
            renderer.update(one)
            renderer.draw([view])
            alone = renderer.image(0)[..., 3] > 0.99
            others = np.stack([object_color(k) for k in range(4)])
            unit = picture / np.maximum(picture.max(axis=2, keepdims=True), 1e-6)
            off = np.abs(unit[:, :, None] - others / others.max(axis=1, keepdims=True)).sum(axis=3)
            mine = alone & (np.argmin(off, axis=2) == i)
            assert mine.sum() > 0.3 * alone.sum() > 0  # copies before it hide the rest
