"""Every case of `launch.py stability` on a small scene with GL quads."""

import gc

import pytest

from shapeshift.app.drawing import open_renderer
from shapeshift.app.stability_cases.table import CASES
from shapeshift.renderer.renderer import Renderer
from tests.support.renderer.case_context import failures, make_case
from tests.support.splat_scenes import random_layers


def reopen():
    return open_renderer("auto", "quads")


@pytest.mark.parametrize("name", CASES)
def test_the_case_holds(ctx, name):
    gc.freeze()  # "life" collects after every context, else what other tests left as well
    with Renderer(ctx, "quads") as renderer:
        case = make_case(renderer, ctx, reopen, random_layers(600, seed=3, layers=2))
        result = CASES[name](case)
    assert not failures(result)
    assert result.panels


def test_half_floats_lose_faint_layers(ctx):
    """What the default was: the case would have said so."""
    with Renderer(ctx, "quads", target="rgba16f") as renderer:
        found = failures(CASES["faint-layers"](make_case(renderer, ctx, reopen)))
    assert len(found) == 2, found


@pytest.mark.parametrize("name", ["disparity", "limits", "needles", "broken-heads", "crowd"])
def test_the_case_holds_where_all_runs_in_gl(ctx, name):
    with Renderer(ctx, "quads", mlps="gl", sort="gl", target="rgba32f") as renderer:
        assert not failures(CASES[name](make_case(renderer, ctx, reopen)))
