"""Two eyes by quads: the cases of the tiles, and what one projection of both must not change."""

from dataclasses import replace

import numpy as np
import pytest

from renderer.renderer import Renderer
from renderer.settings import RenderSettings
from tests.splat_scenes import stereo_views, two_objects
from tests.test_tiles_stereo import (  # noqa: F401  collected here with this module's renderer
    draw,
    eyes,
    test_a_shared_order_is_a_sort_for_each_eye_bit_for_bit,
    test_a_view_of_nothing_beside_one_of_something,
    test_canted_eyes_are_the_reference,
    test_canted_eyes_sort_each_for_itself,
    test_disparity_is_the_baseline_times_the_focal_length_over_depth,
    test_eyes_of_different_sizes_and_more_than_two,
    test_fields_of_view_that_differ_from_eye_to_eye_put_things_where_they_are,
)


@pytest.fixture(scope="module", params=["gl", "numpy"])
def renderer(request, session_gpu):
    with session_gpu.ctx, Renderer(session_gpu.ctx, "quads", "auto", request.param, "rgba32f") as r:
        yield r


@pytest.fixture(autouse=True)
def current(session_gpu):
    with session_gpu.ctx as ctx:
        yield
        assert ctx.error == "GL_NO_ERROR"


@pytest.mark.parametrize("key_bits", [16, 32])
@pytest.mark.parametrize("order", ["depth", "distance"])
def test_views_one_by_one_are_views_at_once(renderer, monkeypatch, order, key_bits):
    """As on a driver whose storage blocks do not hold the records of two views."""
    scene, views = two_objects(3000), stereo_views((96, 80))
    at_once = draw(renderer, scene, views, order=order, key_bits=key_bits)
    monkeypatch.setattr("renderer.buffers.Arena.holds_views", lambda arena, n: n == 1)
    one_by_one = draw(renderer, scene, views, order=order, key_bits=key_bits)
    for a, b in zip(at_once, one_by_one, strict=True):
        if key_bits == 32:
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
