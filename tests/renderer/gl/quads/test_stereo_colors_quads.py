"""Colours of two eyes by quads: cases of the tiles; networks in GL, both views in one draw."""

import pytest

from shapeshift.renderer.renderer import Renderer
from tests.renderer.test_stereo_colors import (  # noqa: F401  collected here with this module's renderer
    test_a_trained_leg_in_both_eyes,
    test_at_rest_nothing_is_computed_again,
    test_auto_shares_just_where_it_says,
    test_colours_that_look_at_no_eye_are_shared,
    test_debug_pictures_of_two_eyes_have_their_numbers_in_both,
    test_each_eye_is_the_eye_drawn_alone,
    test_lenses_off_centre_and_of_other_sizes_and_more_than_two_views,
    test_settings_may_change_from_frame_to_frame,
    test_shared_colours_are_those_of_the_middle,
    test_shortcuts_of_colour_work_for_each_eye,
)


@pytest.fixture(scope="module", params=["gl", "onnxruntime", "pair"])
def renderer(request, session_gpu):
    """A draw a view with the networks in either place, and both views in one draw."""
    mlps = request.param.replace("pair", "onnxruntime")
    with session_gpu.ctx, Renderer(session_gpu.ctx, "quads", mlps, target="rgba32f") as made:
        if request.param != "pair":
            made.drawing.stereo_pair = None
        elif made.drawing.stereo_pair is None:
            pytest.skip("a GPU draws the views one after the other")
        yield made


def test_memory_of_a_second_eye_comes_and_goes(ctx, session_gpu):
    from tests.support.renderer.eye_scenes import SCENES, eyes
    from tests.support.renderer.frames import draw_told

    with Renderer(ctx, "quads") as renderer:
        scene, pair = SCENES["both"](), eyes()
        draw_told(renderer, scene, pair)
        arena, made = renderer.drawing._arena, renderer.drawing.allocations
        assert len(arena.colors) == 2
        for _ in range(3):
            draw_told(renderer, scene, pair)
        assert renderer.drawing.allocations == made, "nothing is made anew in a frame"
        draw_told(renderer, scene, pair[:1])
        assert len(arena.colors) == 1
