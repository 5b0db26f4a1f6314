"""Poisoned scenes by GL quads, with networks on the CPU and in GL, into both float targets."""

import numpy as np
import pytest

from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from tests.support.renderer.poison_judge import judge
from tests.support.splat_scenes import alone, front_view, random_layers

SEEDS = 50
MANY = 8000
WAYS = {
    "default": {},
    "gl": {"mlps": "gl", "sort": "gl"},
    "float32": {"target": "rgba32f"},
}


def picture(renderer: Renderer) -> np.ndarray:
    renderer.settings = RenderSettings()
    renderer.update(alone(random_layers(200)))
    renderer.draw([front_view((48, 48))])
    return np.array(renderer.image(0))


@pytest.mark.parametrize("way", WAYS)
def test_poison_is_drawn_cleanly_or_refused(ctx, way):
    first = list(WAYS).index(way) * SEEDS  # each way its own seeds
    with Renderer(ctx, "quads", **WAYS[way]) as renderer:
        before = picture(renderer)
        failures = [t for seed in range(first, first + SEEDS) if (t := judge(renderer, seed))]
        assert not failures, f"{len(failures)} of {SEEDS}\n" + "\n".join(failures[:20])
        np.testing.assert_array_equal(picture(renderer), before)


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_much_poison_is_drawn_cleanly_or_refused(ctx, way):
    with Renderer(ctx, "quads", **WAYS[way]) as renderer:
        failures = [t for seed in range(len(WAYS) * SEEDS, MANY) if (t := judge(renderer, seed))]
    assert not failures, f"{len(failures)} of {MANY}\n" + "\n".join(failures[:20])
