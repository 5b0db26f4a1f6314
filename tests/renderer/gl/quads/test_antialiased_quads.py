"""Antialiased scenes drawn with GL quads, by the oracle; alone, mixed, for one eye and for two."""

import pytest

from tests.support.renderer.antialiased_scenes import CASES, check_eyes, check_frame
from tests.support.renderer.renderers import quads

RENDERERS = {"quads": quads(target=None)}


@pytest.mark.parametrize("name, limits", CASES)
def test_quads_draw_and_count_as_the_oracle(ctx, renderer, name, limits):
    check_frame(renderer, name, limits, 58)


@pytest.mark.parametrize("limits", ["none", "soft"])
def test_both_eyes_have_an_opacity_of_their_own(ctx, renderer, limits):
    check_eyes(renderer, limits, 58)
