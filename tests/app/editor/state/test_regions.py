"""Regions as a person edits them, the brush, and their outlines in the picture; no window."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app.editor.panels.outlines import on_screen, segments, up_arrows
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.regions import (
    KINDS,
    Region,
    Regions,
    brushed,
    region_of,
    selector_of,
)
from shapeshift.runtime_models.model import SplatLayers, Stop
from shapeshift.scene.cameras.upright import Up, Upright
from shapeshift.scene.pose import Pose, View, look_at, perspective
from shapeshift.scene.scene import SceneObject
from shapeshift.scene.selectors.selector import Box, HalfSpace, Lens, Painted, Sphere
from tests.support.models import make_random_model

SIZE = (400, 300)
VIEW = View(look_at(np.array([0.0, 0, 4]), np.zeros(3)), (-0.4, 0.4, -0.3, 0.3), 0.1, 50.0, SIZE)
ASIDE = Pose(np.array([0.5, 0, 0]), np.array([np.sqrt(0.5), 0, np.sqrt(0.5), 0]))


@pytest.fixture
def obj() -> SceneObject:
    return SceneObject("thing", make_random_model(300), x=0.0)


# Editing


def test_a_new_region_is_chosen_named_and_shows_the_stop_that_is_farthest(obj):
    regions = Regions(radius=2.0)
    for kind in KINDS:
        region = regions.add(kind, 0, obj, np.array([1.0, 2, 3]))
        assert regions.current is region and region.name == f"{kind} 1" and region.x == 1.0
        assert regions.placing == region.is_placed == (kind in ("box", "sphere", "half-space"))
    assert regions.add("box", 0, obj, np.zeros(3)).name == "box 2"
    regions.remove(0)
    assert regions.add("box", 0, obj, np.zeros(3)).name == "box 1"
    assert [r.name for r in regions.items].count("box 1") == 1


def test_version_counts_changes_and_nothing_else(obj):
    regions = Regions()
    regions.add("box", 0, obj, np.zeros(3))
    before = regions.version
    regions.edit(0, x=regions.current.x, half=regions.current.half.copy())
    regions.choose(-1)
    assert regions.version == before
    regions.edit(0, x=0.25)
    assert regions.version == before + 1 and regions.items[0].x == 0.25


def test_removing_keeps_a_valid_choice(obj):
    regions = Regions()
    for _ in range(3):
        regions.add("sphere", 0, obj, np.zeros(3))
    regions.choose(2)
    for left in (2, 1, 0):
        regions.remove(regions.chosen)
        assert len(regions.items) == left and regions.chosen == left - 1
    assert regions.current is None
    regions.add("lens", 0, obj, np.zeros(3))
    regions.clear()
    assert regions.items == () and regions.current is None


def test_placing_is_in_the_frame_of_the_object_that_was_met(obj):
    other = SceneObject("other", obj.model, ASIDE)
    regions = Regions()
    regions.add("sphere", 0, obj, np.zeros(3))
    point = np.array([0.3, 0.2, -0.1])
    regions.place(point, 1, (obj, other))
    region = regions.current
    assert region.index == 1
    world = ASIDE.matrix() @ np.append(region.centre, 1)
    np.testing.assert_allclose(world[:3], point, atol=1e-12)


def test_the_lens_is_one_switch(obj):
    regions = Regions()
    assert regions.toggle_lens(obj) and len(regions.items) == 1
    assert not regions.toggle_lens(obj) and not regions.items[0].enabled
    assert regions.toggle_lens(obj) and len(regions.items) == 1


# The brush


def in_pixels(points: np.ndarray, view: View = VIEW) -> np.ndarray:
    """(P, 2) by the view's own matrices, the slow way."""
    clip = np.c_[points, np.ones(len(points))] @ (view.clip_from_eye() @ view.eye_from_world()).T
    ndc = clip[:, :2] / clip[:, 3:]
    return (ndc * [1, -1] + 1) / 2 * view.size


@pytest.mark.parametrize("pose", [Pose(np.zeros(3), np.array([1.0, 0, 0, 0])), ASIDE])
def test_the_brush_takes_what_is_within_its_circle(obj, pose):
    obj = SceneObject("thing", obj.model, pose)
    places = obj.model.anchors.astype(float)
    world = places @ pose.matrix()[:3, :3].T + pose.matrix()[:3, 3]
    cursor, radius = (210.0, 140.0), 40.0
    inside = np.flatnonzero(np.linalg.norm(in_pixels(world) - cursor, axis=1) <= radius)
    under = brushed(VIEW, places, obj, cursor, radius)
    assert len(inside) > len(under) > 0 and np.isin(under, inside).all()
    depth = 4 - world[:, 2]
    assert depth[under].max() <= np.delete(depth, under)[np.isin(
        np.delete(np.arange(len(depth)), under), inside)].min()  # fmt: skip


def test_the_brush_paints_the_near_side_alone(obj):
    near, far = np.array([[0, 0, 1.0]] * 3), np.array([[0, 0, -1.0]] * 3)
    under = brushed(VIEW, np.r_[near, far], obj, (200.0, 150.0), 20.0)
    assert set(under) == {0, 1, 2}
    behind = np.array([[0, 0, 9.0], [0, 0, 4.0], [np.nan, 0, 0]])
    assert len(brushed(VIEW, behind, obj, (200.0, 150.0), 20.0)) == 0


def test_painting_and_erasing(obj):
    regions = Regions()
    regions.add("painted", 0, obj, np.zeros(3))
    args = (VIEW, (200.0, 150.0), 60.0, obj)
    count = regions.paint(*args, False)
    assert count == regions.current.painted.sum() > 0
    version = regions.version
    assert regions.paint(*args, False) == 0 and regions.version == version
    assert regions.paint(*args, True) == count and not regions.current.painted.any()


# Outlines


def test_outlines_lie_on_the_surface_of_the_region():
    centre, half = np.array([1.0, 2, 3]), np.array([0.5, 1, 2])
    box = segments(Region("box", "", centre=centre, half=half), 1.0)
    assert box.shape == (12, 2, 3)
    at = np.abs(box - centre) / half
    np.testing.assert_allclose(at, 1)
    assert ((box[:, 0] != box[:, 1]).sum(axis=1) == 1).all()  # each edge along one axis
    ball = segments(Region("sphere", "", centre=centre, half=half), 1.0)
    np.testing.assert_allclose(np.linalg.norm(ball - centre, axis=-1), 0.5)
    normal = np.array([1.0, 2, -1])
    *grid, arrow = segments(Region("half-space", "", centre=centre, normal=normal), 1.0)
    np.testing.assert_allclose((np.array(grid) - centre) @ normal, 0, atol=1e-12)
    assert (arrow[1] - arrow[0]) @ normal > 0
    for kind in ("lens", "painted"):
        assert segments(Region(kind, ""), 1.0).shape == (0, 2, 3)


def test_segments_are_cut_where_they_pass_the_eye():
    lines = np.array([
        [[0, 0, 0], [0.3, 0.2, 1]],  # before the eye
        [[0, 0, 8], [0, 1, 9]],  # behind it
        [[0.5, 0, 0], [0.5, 0, 8]],  # through the near plane
    ], float)  # fmt: skip
    places = on_screen(VIEW, lines, SIZE)
    assert len(places) == 2 and np.isfinite(places).all()
    np.testing.assert_allclose(places[0], in_pixels(lines[0]))
    np.testing.assert_allclose(places[1, 0], in_pixels(lines[2])[0])
    np.testing.assert_allclose(places[1, 1], in_pixels(np.array([[0.5, 0, 3.9]]))[0])


# What the scene knows them as

SELECTORS = (
    Box(centre=(1.0, 2, 3), half=(0.5, 1, 2), x=0.25, border=0.1),
    Sphere(centre=(1.0, 2, 3), radius=0.7, x=0.5),
    HalfSpace(point=(0.1, 0.2, 0.3), normal=(0, 0, -1.0), x=1.0, border=0.2),
    Lens(position=VIEW.world_from_eye.position, wxyz=VIEW.world_from_eye.wxyz,
         half_angle=0.3, x=0.75),
    Painted(np.arange(300) % 3 == 0, 1.0),
)  # fmt: skip


@pytest.mark.parametrize("selector", SELECTORS, ids=lambda s: type(s).__name__)
def test_a_region_is_the_selector_it_came_from(selector, obj):
    again = selector_of(region_of(selector, "name", 0), VIEW)
    places = obj.model.anchors
    if isinstance(selector, Lens):
        assert again.half_angle == pytest.approx(selector.half_angle)
        np.testing.assert_allclose(again.weights(places), selector.weights(places))
    else:
        assert again == selector


def test_a_half_space_takes_the_side_that_its_arrow_points_to():
    region = Region("half-space", "", centre=np.array([0, 1.0, 0]), normal=np.array([0, 1.0, 0]))
    weights = selector_of(region, VIEW).weights(np.array([[0, 2.0, 0], [0, 0.5, 0]]))
    np.testing.assert_array_equal(weights, [1, 0])


def test_regions_of_a_command_are_named_and_none_is_being_edited(obj):
    regions = Regions()
    regions.add_selectors(SELECTORS[:2] + SELECTORS[:1], 0)
    assert [r.name for r in regions.items] == ["box 1", "sphere 1", "box 2"]
    assert regions.current is None and not regions.placing
    regions.edit(1, enabled=False)
    assert regions.selectors(0, VIEW) == (SELECTORS[0], SELECTORS[0])
    assert regions.selectors(1, VIEW) == ()


# The state


def test_the_stage_makes_a_scene_anew_only_when_something_changed(obj):
    state = EditorState(lambda path: obj.model)
    state.open([Path("a"), Path("b")])
    other = dataclasses.replace(VIEW, world_from_eye=look_at(np.array([3.0, 0, 4]), np.zeros(3)))
    assert state.shown(VIEW) is state.scene  # without regions there is nothing to add
    state.add_region("box")
    first = state.shown(VIEW)
    assert first is state.shown(other) and len(first.objects[0].selectors) == 1
    assert first.objects[1].selectors == ()
    state.regions.edit(0, x=0.5)
    second = state.shown(VIEW)
    assert second is not first and second.objects[0].selectors[0].x == 0.5
    state.set_x(0, 0.3)
    third = state.shown(VIEW)
    assert third is not second and third.objects[0].x == 0.3
    state.toggle_lens()
    assert state.shown(VIEW) is state.shown(VIEW) is not state.shown(other)
    state.show(state.scene)
    assert state.regions.items == () and state.shown(VIEW) is state.scene


def test_picking_sees_what_a_region_shows():
    """A half-space hides the near layer of two: the ray goes on to the far one."""
    means = np.array([[0, 0, 1], [0, 0, -1]], np.float32)
    model = SplatLayers(
        means, np.full((2, 3), 0.1, np.float32),
        np.tile(np.array([1, 0, 0, 0], np.float32), (2, 1)), np.full(2, 0.9, np.float32),
        np.zeros((2, 1, 3), np.float32), np.zeros(2, np.int32),
        (Stop("there", 0.0), Stop("not there", 1.0)), mode="exclusive",
    )  # fmt: skip
    state = EditorState(lambda path: model)
    state.open([Path("a")])
    ray = np.array([0, 0, -1.0])
    assert state.pick(VIEW, ray, 0.001).point[2] == pytest.approx(1)
    state.regions.add_selectors((HalfSpace(point=(0, 0, 0), normal=(0, 0, -1.0), x=1.0),), 0)
    assert state.pick(VIEW, ray, 0.001).point[2] == pytest.approx(-1)


def test_arrows_of_up_point_as_each_way_says_and_fill_a_third_of_the_picture():
    tilted = Up("planes", (0.0, 0.6, 0.8))
    upright = Upright((Up("assumed", (0.0, 1.0, 0.0)), tilted), tilted)
    size = (300, 300)
    view = View(look_at((0, 0, 5), (0, 0, 0)), perspective(0.9, size), 0.05, 100.0, size)
    begin, end = up_arrows(upright, np.zeros(3), view)
    way = (end - begin) / np.linalg.norm(end - begin, axis=1)[:, None]
    np.testing.assert_allclose(way[1], (0, 1, 0), atol=1e-12)  # the one that is believed
    np.testing.assert_allclose(way[0] @ way[1], 0.6, atol=1e-12)  # as far apart as in the capture
    ((low, high),) = on_screen(view, np.stack([begin, end], 1)[1:], size)
    assert low[1] - high[1] == pytest.approx(100, abs=1e-9)
