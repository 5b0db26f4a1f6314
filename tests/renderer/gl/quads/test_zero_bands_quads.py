"""Harmonics that are zero in a whole file, by quads."""

import pytest

from shapeshift.renderer.renderer import Renderer
from tests.runtime_models.splats.test_zero_bands import (  # noqa: F401  collected here with this module's renderer
    test_nothing_is_coloured_again_where_no_colour_looks_at_the_eye,
    test_pictures_are_equal_to_the_last_bit,
)


@pytest.fixture(scope="module")
def renderer(session_gpu):
    with session_gpu.ctx, Renderer(session_gpu.ctx, "quads") as made:
        yield made
