"""Scenes drawn by a budget: against the whole scene, what is hidden, what is refused."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.streaming.stream import Stream
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.appearance import Appearance
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Tint
from shapeshift.scene.sections.section_texts import read_section
from tests.support.splat_scenes import random_layers, shell
from tests.support.streamed_scenes import (
    open_levels,
    scene_of,
    view_at,
    walled,
    write_levels,
)

ALL = 1_000_000  # a budget that is enough for all of these scenes
SAME = 1e-5  # of a pixel: the same splats, whose equal depths may come in another order


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_levels(shell(4000, 1), tmp_path_factory.mktemp("levels") / "shell")


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    return write_levels(walled(), tmp_path_factory.mktemp("levels") / "wall", 512)


@pytest.fixture
def tiles():
    with Renderer(None, "tiles") as renderer:
        yield renderer


def drawn(renderer, scene, *views):
    renderer.update(scene)
    stats = renderer.draw(list(views))
    return [renderer.image(i).copy() for i in range(len(views))], stats


@pytest.mark.parametrize("coefficients", [1, 9])
def test_a_budget_for_all_draws_the_whole_scene(tiles, tmp_path, coefficients):
    """From outside and from within, and with harmonics, which follow the eye."""
    folder = write_levels(shell(2500, coefficients), tmp_path / "shell")
    scene, whole = scene_of(open_levels(folder, ALL)), scene_of(read_model(folder))
    for view in (view_at(), view_at((0.2, 0.1, 0.3)), view_at((3, 0, 0.5))):
        (image,), stats = drawn(tiles, scene, view)
        (expected,), _ = drawn(tiles, whole, view)
        np.testing.assert_allclose(image, expected, atol=SAME)
        assert stats.streaming.shown <= stats.streaming.whole == 2500
        assert stats.streaming.shown == stats.streaming.in_sight and not stats.streaming.pending


@pytest.mark.parametrize("budget", [1, 31, 32, 33, 1000, 1700, 2500, 3999, 4000, 4001])
def test_the_budget_is_never_exceeded(tiles, folder, budget):
    scene = scene_of(open_levels(folder, budget))
    for eye in ((0, 0.5, 6), (6, 0.5, 0), (0, 0.2, 0.4)):
        _, stats = drawn(tiles, scene, view_at(eye))
        assert stats.drawn <= stats.streaming.shown <= budget
        assert stats.splats == scene.splat_count == 4000


def test_more_budget_is_a_better_picture(tiles, wall):
    whole, view = scene_of(read_model(wall)), view_at((1.5, 0.3, 7))
    (expected,), _ = drawn(tiles, whole, view)
    scores = []
    for budget in (600, 1200, 2400, 4800, ALL):
        (image,), _ = drawn(tiles, scene_of(open_levels(wall, budget)), view)
        scores.append(psnr(image[..., :3], expected[..., :3]))
    assert all(before < after for before, after in pairwise(scores)), scores
    assert scores[-1] > 100


def test_what_a_wall_hides_gets_its_floor_alone(tiles, wall):
    """Two shells alike, one behind the wall: the look sees the other one alone, whose leaves
    then take what the budget has.
    """
    model = open_levels(wall, 4000)
    drawn(tiles, scene_of(model), view_at((0, 0, 7), fov_y=1.4, size=(240, 120)))
    stream: Stream = tiles.streaming.stream
    middle = (model.leaves.levels.low + model.leaves.levels.high) / 2
    behind = (middle[:, 2] < 0) & (middle[:, 0] < 0.2)
    beside = (middle[:, 2] < 0) & (middle[:, 0] > 2.6)
    level, coarsest = stream.table.level, model.leaves.levels.coarsest
    assert (level[behind] == coarsest[behind]).mean() > 0.9
    assert level[beside].min() <= coarsest.max() - 2
    splats = stream.table.splats
    assert splats[beside].sum() > 2 * splats[behind].sum()
    seen = stream.weights.pixels
    assert seen[behind].sum() < 0.03 * seen[beside].sum()
    assert seen.sum() <= 1.6 * 240 * 120  # a pixel's splats give 1 in all; the look is wider


def test_pixels_of_leaves_add_up_to_the_coverage(tiles, wall):
    """From outside: sums over the look's leaves are the coverage of the same picture."""
    from shapeshift.rasterizer.device import open_device
    from shapeshift.renderer.streaming.in_sight import PART, CoarseLook, look_view

    model, view = open_levels(wall, ALL), view_at((0, 0, 7))
    look = CoarseLook(open_device(), [model], np.array([0, len(model.leaves.part)]))
    pixels = look.pixels([view], [np.eye(4)], len(model.leaves.part))
    coarse = replace(model, leaves=None)
    (image,), _ = drawn(tiles, scene_of(coarse), look_view([view], PART))
    # Evidence counts in steps of 1/1024 a tile and splat.
    assert abs(pixels.sum() / PART**2 / image[..., 3].sum() - 1) < 0.01


def test_objects_share_one_budget_and_copies_the_files(tiles, folder):
    model = open_levels(folder, 3000)
    far = Pose(np.array([0.0, 0, -40]), np.array([1.0, 0, 0, 0]))
    one, two = scene_of(model, model).objects
    scene = replace(scene_of(model), objects=(one, replace(two, world_from_object=far)))
    _, stats = drawn(tiles, scene, view_at())
    assert stats.streaming.shown <= 3000 and stats.streaming.whole == 8000
    stream = tiles.streaming.stream
    per_object = [stream.table.splats[a:b].sum() for a, b in pairwise(stream.first)]
    assert per_object[0] > 2 * per_object[1] > 0
    assert model.leaves.cache.decoded <= model.leaves.part.max() + 1
    _, stats = drawn(tiles, scene, view_at(), view_at((0.06, 0.5, 6)))  # two eyes
    assert stats.streaming.shown <= 3000


def test_an_object_in_full_counts_for_the_budget(tiles, folder):
    fixed = random_layers(500)
    _, stats = drawn(tiles, scene_of(fixed, open_levels(folder, 1500)), view_at())
    assert 900 < stats.streaming.shown <= 1000
    with pytest.raises(BadFile, match="have 500 splats and the budget is 500"):
        tiles.update(scene_of(fixed, open_levels(folder, 500)))


LOOKS = {
    "darker": {"appearance": Appearance(exposure=-1.0)},
    "fainter": {"appearance": Appearance(opacity=0.5)},
    "tinted": {"tint": Tint((1.0, 0.0, 0.0), 0.5)},
    "cut": {"sections": (read_section("plane:1,0,0,0.1:hard", ()),)},
    "moved": {"world_from_object": Pose(np.array([0.3, 0, 0]), np.array([0.8, 0, 0.6, 0]))},
}


@pytest.mark.parametrize("look", LOOKS)
def test_looks_are_those_of_the_whole_scene_also_while_leaves_change(tiles, folder, look):
    model, whole = open_levels(folder, ALL), read_model(folder)
    with Renderer(None, "tiles") as other:
        for eye in ((0, 0.5, 6), (0.2, 0.1, 0.3), (0.2, 0.1, -0.3)):
            pair = []
            for renderer, each in ((tiles, model), (other, whole)):
                (obj,) = scene_of(each).objects
                scene = replace(scene_of(each), objects=(replace(obj, **LOOKS[look]),))
                pair.append(drawn(renderer, scene, view_at(eye))[0][0])
            np.testing.assert_allclose(*pair, atol=2e-5)


def test_a_hidden_object_takes_nothing(tiles, folder):
    (obj,) = scene_of(open_levels(folder, ALL)).objects
    scene = replace(scene_of(obj.model), objects=(replace(obj, visible=False),))
    (image,), stats = drawn(tiles, scene, view_at())
    assert not image.any() and stats.streaming.shown == 0


def test_another_budget_in_the_settings_makes_other_room(tiles, folder):
    scene = scene_of(open_levels(folder, ALL))
    for budget in (1000, 0, 2000):
        tiles.settings = replace(tiles.settings, budget=budget)
        _, stats = drawn(tiles, scene, view_at())
        assert stats.streaming.shown <= (budget or 1000)
    with pytest.raises(ValueError, match="budget is -1, expected 0 to"):
        replace(tiles.settings, budget=-1)


def test_a_broken_file_ends_a_picture_with_its_name(tiles, tmp_path):
    folder = write_levels(shell(1000), tmp_path / "a")
    scene = scene_of(open_levels(folder, ALL))
    (folder / "0_0" / "quats.webp").write_bytes(b"")
    tiles.update(scene)
    with pytest.raises(BadFile, match=r"a: 0_0/meta\.json cannot be read"):
        tiles.draw([view_at()])


def test_depth_of_the_whole_scene_comes_without_a_picture_before(tiles, folder):
    tiles.update(scene_of(open_levels(folder, ALL)))
    surface = tiles.surface(view_at())
    tiles.update(scene_of(read_model(folder)))
    expected = tiles.surface(view_at())
    np.testing.assert_allclose(surface.coverage, expected.coverage, atol=SAME)
