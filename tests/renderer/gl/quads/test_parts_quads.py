"""Parts of a picture by quads: the cases of the tiles."""

import pytest

from shapeshift.renderer.renderer import Renderer
from tests.renderer.reference.test_parts import (  # noqa: F401  collected here with this module's renderer
    test_a_part_at_the_edge_is_drawn_as_in_the_whole_that_it_does_not_know,
    test_a_part_is_drawn_as_in_the_whole,
    test_a_picture_in_tiles_is_the_picture,
    test_lenses_that_lean_are_parts_of_the_lens_that_holds_both,
    test_the_debug_view_s_reasons_are_the_reference_s,
)


@pytest.fixture(scope="module")
def renderer(session_gpu):
    with session_gpu.ctx, Renderer(session_gpu.ctx, "quads", target="rgba32f") as made:
        yield made
