"""Turned objects: the cases of the tiles, drawn by quads with networks on either side."""

import pytest

from shapeshift.renderer.renderer import Renderer
from tests.renderer.test_turned_objects import (  # noqa: F401  collected here with this module's renderer
    test_a_turned_object_is_the_object_from_a_turned_eye,
    test_an_object_that_turns_is_coloured_anew_in_every_frame,
    test_both_eyes_of_a_turned_object,
    test_harmonics_turned_in_the_file_are_those_of_the_turned_object,
    test_networks_that_look_along_a_direction_turn_with_the_object,
    test_one_object_turns_beside_one_that_does_not,
    test_selectors_in_the_objects_space_turn_with_it,
    test_selectors_in_the_world_stay_while_an_object_turns_through_them,
    test_what_swings_about_the_eye_into_the_view_has_its_colours,
)

pytestmark = pytest.mark.usefixtures("ctx")


@pytest.fixture(scope="module", params=["gl", "onnxruntime"])
def renderer(request, session_gpu):
    with (
        session_gpu.ctx,
        Renderer(session_gpu.ctx, "quads", request.param, "numpy", "rgba32f") as made,
    ):
        yield made
