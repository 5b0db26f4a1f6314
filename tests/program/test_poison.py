"""Poisoned scenes by tiles: drawn cleanly or refused in a sentence, and nothing stays behind."""

import numpy as np
import pytest

import tests.support.renderer.poison as poison
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from tests.support.renderer.poison_judge import is_precise, judge
from tests.support.splat_scenes import alone, front_view, random_layers

SEEDS = 300
MANY = 20_000


def good_picture(renderer: Renderer) -> np.ndarray:
    renderer.settings = RenderSettings()
    renderer.update(alone(GOOD))
    renderer.draw([front_view((48, 48))])
    return np.array(renderer.image(0))


GOOD = random_layers(200)


def test_poison_is_drawn_cleanly_or_refused(renderer):
    before = good_picture(renderer)
    failures = [told for seed in range(SEEDS) if (told := judge(renderer, seed))]
    assert not failures, f"{len(failures)} of {SEEDS}\n" + "\n".join(failures[:20])
    np.testing.assert_array_equal(good_picture(renderer), before)


@pytest.mark.slow
def test_much_poison_is_drawn_cleanly_or_refused(renderer):
    failures = [told for seed in range(SEEDS, MANY) if (told := judge(renderer, seed))]
    assert not failures, f"{len(failures)} of {MANY}\n" + "\n".join(failures[:20])


def test_seeds_reach_every_kind_and_are_repeatable():
    kinds, made = set(), 0
    refused = 0
    for seed in range(SEEDS):
        try:
            kinds.add(poison.make(seed).told.split(";")[0])
            made = seed
        except ValueError as refusal:
            assert is_precise(str(refusal)), refusal
            refused += 1
    assert kinds == set(poison.KINDS)
    assert 0 < refused < SEEDS / 4
    a, b = poison.make(made), poison.make(made)
    assert a.told == b.told and a.settings == b.settings
