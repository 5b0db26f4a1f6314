"""One sort over all objects: the cases of the tiles, drawn by quads with either sort."""

import pytest

from shapeshift.renderer.renderer import Renderer
from tests.renderer.test_one_sort import (  # noqa: F401  collected here with this module's renderer
    test_a_hidden_object_takes_no_part,
    test_an_object_that_moves_through_another_is_sorted_anew_in_every_frame,
    test_both_eyes_share_it,
    test_moved_objects_are_the_cloud_baked_in_place_to_the_bit,
    test_objects_of_one_splat_each,
    test_one_model_as_several_objects_at_several_x,
    test_splats_of_one_depth_keep_the_order_of_the_objects,
    test_turned_objects_are_the_cloud_baked_in_place,
    test_twenty_objects_and_empty_ones_between,
    test_two_interleaved_objects_are_the_merged_cloud_to_the_bit,
    test_wherever_the_second_object_begins,
)

pytestmark = pytest.mark.usefixtures("ctx")


@pytest.fixture(scope="module", params=["gl", "numpy"])
def renderer(request, session_gpu):
    with (
        session_gpu.ctx,
        Renderer(session_gpu.ctx, "quads", "auto", request.param, "rgba32f") as made,
    ):
        yield made
