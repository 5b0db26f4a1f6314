"""Two eyes by quads: what one projection of both, and one draw of both, must not change."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.gl.stereo_pair import disparities
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import Pose, View
from tests.support.renderer.eye_scenes import SCENES as COLOURED
from tests.support.renderer.eye_scenes import eyes as coloured_eyes
from tests.support.renderer.eye_views import eyes
from tests.support.renderer.frames import draw, draw_counted
from tests.support.renderer.renderers import quads
from tests.support.splat_scenes import (
    alone,
    front_view,
    psnr_db,
    random_layers,
    stereo_views,
    two_objects,
)

RENDERERS = {
    "gl": quads(sort="gl", pair=False),
    "numpy": quads(sort="numpy", pair=False),
    "pair": quads(sort="numpy", pair=True),
}


SETTINGS = {
    "exact": {},
    "culls": {"max_pixels": 4.0, "max_distance": 4.3, "min_pixels": 1.5},
    "faded": {"max_pixels": 4.0, "max_distance": 4.3, "min_pixels": 1.5, "fade": 0.4},
    "16 bits": {"key_bits": 16},
    "sharp": {"low_pass": 0.1},
    "by distance": {"order": "distance"},
}


@pytest.mark.parametrize("name", SETTINGS)
@pytest.mark.parametrize("apart", [0.0, 0.02, 0.3])
@pytest.mark.parametrize("leaning", [False, True])
def test_one_draw_is_two(ctx, monkeypatch, name, apart, leaning):
    """Where both are drawn the difference is rounding, and where alpha just ends (1/255) a pixel
    may come or go.  `leaning`: fields of view that differ from eye to eye, so that the whole
    picture is shifted.
    """
    tangents = ((-0.55, 0.35, -0.5, 0.4), (-0.35, 0.55, -0.5, 0.4)) if leaning else (
        (-0.4, 0.4, -0.4, 0.4),) * 2  # fmt: skip
    pose, scene = front_view().world_from_eye, two_objects(3000)
    views = [
        View(Pose(pose.position + side * pose.matrix()[:3, 0] * apart, pose.wxyz), t, 0.05, 50,
             (120, 90))
        for side, t in zip((-0.5, 0.5), tangents, strict=True)
    ]  # fmt: skip
    with Renderer(ctx, "quads", target="rgba32f") as renderer:
        drawing = renderer.drawing
        if drawing.stereo_pair is None:
            pytest.skip("a GPU draws the views one after the other")
        monkeypatch.setattr("shapeshift.renderer.gl.stereo_pair.MAX_RESIDUAL_DISPARITY", 1e9)
        shifts = []
        keep = drawing.stereo_pair.draw
        monkeypatch.setattr(drawing.stereo_pair, "draw", lambda *a: shifts.append(a[2]) or keep(*a))
        together = draw(renderer, scene, views, **SETTINGS[name])
        monkeypatch.setattr(drawing, "stereo_pair", None)
        apart_ = draw(renderer, scene, views, **SETTINGS[name])
    assert len(shifts) == 1 and (abs(shifts[0]) > 15) == leaning
    for one, two in zip(together, apart_, strict=True):
        difference = np.abs(one - two).max(axis=2)
        assert two.any() and difference.max() < 1.5 / 255
        assert (difference > 2e-4).mean() < 2e-3


def test_eyes_too_far_apart_are_drawn_one_by_one(ctx, monkeypatch):
    scene, views = two_objects(1000), eyes((-0.5, 0.5, -0.3, 0.3))
    with Renderer(ctx, "quads") as renderer:
        if renderer.drawing.stereo_pair is None:
            pytest.skip("a GPU draws the views one after the other")
        calls = []
        monkeypatch.setattr(renderer.drawing.stereo_pair, "draw", lambda *a: calls.append(a))
        poses = [v.world_from_eye for v in views]
        wide = [
            replace(v, world_from_eye=Pose(pose.position * (60, 1, 1), pose.wxyz))
            for v, pose in zip(views, poses, strict=True)
        ]
        draw(renderer, scene, wide)
        assert not calls
        draw(renderer, scene, [replace(views[0], size=(80, 60)), views[1]])
        draw(renderer, scene, views, low_pass=0.0)
        assert not calls
        renderer.settings = RenderSettings()
        renderer.draw(views)
        assert len(calls) == 1


def test_a_grid_that_is_too_narrow_is_made_anew(ctx, monkeypatch):
    """A head comes closer: the second frame is the one of a renderer that never saw the first."""
    monkeypatch.setattr("shapeshift.renderer.gl.stereo_pair.MAX_RESIDUAL_DISPARITY", 1e9)
    scene, shown, widths = two_objects(1000), [], []
    for leans in ((0.0, 0.3), (0.3,)):
        with Renderer(ctx, "quads") as renderer:
            pair = renderer.drawing.stereo_pair
            if pair is None:
                pytest.skip("a GPU draws the views one after the other")
            drawn, keep = [], pair.draw
            monkeypatch.setattr(pair, "draw", lambda *a, k=keep, d=drawn: d.append(a[2]) or k(*a))
            renderer.update(scene)
            for lean in leans:  # shifts one picture by lean / 0.8 of its width
                tangents = ((-0.4 - lean, 0.4 - lean, -0.3, 0.3), (-0.4, 0.4, -0.3, 0.3))
                renderer.draw(
                    [replace(v, tangents=t) for v, t in zip(AHEAD, tangents, strict=True)]
                )
            shown.append([renderer.image(i).copy() for i in range(2)])
            widths.append(drawn)
    assert len(widths[0]) == 2 and abs(widths[0][1] - widths[0][0]) > 64  # pixels: a step of grids
    for one, other in zip(*shown, strict=True):
        assert one.any()
        np.testing.assert_array_equal(one, other)


AHEAD = stereo_views((320, 240))
LENS = ((-0.4, 0.4, -0.3, 0.3), 0.05, 50, (320, 240))


def test_a_moving_head_allocates_once_and_a_narrow_driver_draws_twice(ctx, monkeypatch):
    scene = two_objects(1000)

    def at(distance: float) -> list[View]:  # closer: more disparity
        pose = front_view(distance=distance).world_from_eye
        right = pose.matrix()[:3, 0]
        return [
            View(Pose(pose.position + side * right, pose.wxyz), *LENS) for side in (-0.032, 0.032)
        ]

    with Renderer(ctx, "quads") as renderer:
        pair = renderer.drawing.stereo_pair
        if pair is None:
            pytest.skip("a GPU draws the views one after the other")
        monkeypatch.setattr("shapeshift.renderer.gl.stereo_pair.MAX_RESIDUAL_DISPARITY", 1e9)
        renderer.update(scene)
        renderer.draw(at(0.6))
        made = renderer.drawing.allocations
        widest = pair.targets.width
        for distance in (0.8, 3.0, 9.0, 0.7, 0.6):
            renderer.draw(at(distance))
        assert renderer.drawing.allocations == made and pair.targets.width == widest > 320
        near = [renderer.image(i).copy() for i in range(2)]
        monkeypatch.setattr(renderer.gpu, "max_side", 320)
        monkeypatch.setattr(pair, "draw", lambda *a: pytest.fail("the grid is too wide"))
        renderer.draw(at(0.6))
        for i in range(2):
            assert psnr_db(renderer.image(i), near[i]) > 60


@pytest.mark.parametrize("count", [0, 1, 5, 255, 257])
def test_few_splats_in_two_views(ctx, count):
    scene, views = alone(random_layers(count)), stereo_views((60, 50))
    with Renderer(ctx, "quads", target="rgba32f") as renderer:
        for view, image in zip(views, draw(renderer, scene, views), strict=True):
            assert psnr_db(image, reference_image(scene, view)) > 65


@pytest.mark.parametrize("key_bits", [16, 32])
@pytest.mark.parametrize("order", ["depth", "distance"])
def test_views_one_by_one_are_views_at_once(renderer, monkeypatch, order, key_bits):
    """As on a driver whose storage blocks do not hold the records of two views."""
    scene, views = two_objects(3000), stereo_views((96, 80))
    at_once = draw(renderer, scene, views, order=order, key_bits=key_bits)
    monkeypatch.setattr("shapeshift.renderer.gl.buffers.Arena.holds_views", lambda arena, n: n == 1)
    one_by_one = draw(renderer, scene, views, order=order, key_bits=key_bits)
    for a, b in zip(at_once, one_by_one, strict=True):
        if key_bits == 32 and renderer.drawing.stereo_pair is None:
            np.testing.assert_array_equal(a, b)
        assert np.abs(a - b).max() < 0.05  # 16 bits: the range of the keys is another


def test_sorts_and_counts_are_told(renderer):
    scene, views = two_objects(3000), stereo_views((96, 80))
    renderer.settings = RenderSettings()
    renderer.update(scene)
    shared = renderer.draw(views)
    assert (shared.sorts, shared.order_age) == (1, 0)
    alone = renderer.draw(views[1:])
    assert (alone.drawn, alone.culled) == (shared.drawn, shared.culled) and alone.sorts == 1
    renderer.settings = RenderSettings(stereo_sort="each")
    each = renderer.draw(views)
    assert each.sorts == 2 and (each.drawn, each.culled) == (shared.drawn, shared.culled)


def test_a_kept_order_still_holds_what_was_outside(renderer):
    scene, (view, _) = two_objects(3000), stereo_views((96, 80))
    settings = RenderSettings(resort_frames=3)
    narrow = replace(view, tangents=(-0.05, 0.05, -0.05, 0.05))
    wide = draw(renderer, scene, [view])[0]
    renderer.settings = settings
    told = []
    for seen in (narrow, view, narrow, view):
        stats = renderer.draw([seen])
        told.append((stats.sorts, stats.order_age))
        if seen is view:
            # The same eye: a kept order by depth is exact, whatever was outside when it was made.
            np.testing.assert_array_equal(renderer.image(), wide)
    assert told == [(1, 0), (0, 1), (0, 2), (1, 0)]
    renderer.settings = replace(settings, resort_frames=0)
    assert [renderer.draw([view]).sorts for _ in range(3)] == [0, 0, 0]
    both = stereo_views((96, 80))
    assert [renderer.draw(both).sorts for _ in range(3)] == [1, 0, 0]
    assert [renderer.draw(eyes((-0.9, 0.6, -0.5, 0.5), cant=4.0)).sorts for _ in range(2)] == [2, 2]


def test_memory_of_a_second_eye_comes_and_goes(ctx):
    with Renderer(ctx, "quads") as renderer:
        scene, pair = COLOURED["both"](), coloured_eyes()
        draw_counted(renderer, scene, pair)
        arena, made = renderer.drawing.arena, renderer.drawing.allocations
        assert len(arena.colors) == 2
        for _ in range(3):
            draw_counted(renderer, scene, pair)
        assert renderer.drawing.allocations == made, "nothing is made anew in a frame"
        draw_counted(renderer, scene, pair[:1])
        assert len(arena.colors) == 1


@pytest.mark.parametrize("key_bits", [16, 32])
def test_the_disparity_is_that_of_the_same_splats_whatever_sorts(ctx, monkeypatch, key_bits):
    """The GPU's sort leaves sorted keys behind, so a row's key there is another splat's; records of
    splats that are culled now are those of the frame that drew them last.
    """
    scene, views, samples = two_objects(5000), stereo_views((120, 90)), {}
    for sort in ("numpy", "gl"):
        found = []

        def kept(*words, found=found):
            found.append(disparities(*words))
            return found[-1]

        monkeypatch.setattr("shapeshift.renderer.gl.stereo_pair.disparities", kept)
        with Renderer(ctx, "quads", target="rgba32f", sort=sort) as renderer:
            if renderer.drawing.stereo_pair is None:
                pytest.skip("a GPU draws the views one after the other")
            renderer.update(scene)
            sorts = []
            for limit, frames in ((1e9, 1), (4.3, 1), (4.3, 5), (4.3, 5)):
                renderer.settings = RenderSettings(
                    key_bits=key_bits, resort_frames=frames, max_distance=limit
                )
                renderer.draw(views)
                sorts.append(renderer.drawing.sorts)
        assert len(found) == 4 and sorts == [1, 1, 1, 0]  # the last has the order before, own keys
        samples[sort] = found
    counts = [len(each) for each in samples["numpy"]]
    assert 100 < counts[1] == counts[2] < counts[0] - 100
    for one, other in zip(samples["numpy"], samples["gl"], strict=True):
        np.testing.assert_array_equal(one, other)
