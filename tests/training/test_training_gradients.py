"""The whole step against finite differences in float64: every weight and all that anchors have."""

import pytest

from tests.support.training.situations import LAYOUT, OTHERS, compare_gradients


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_every_gradient(device, seed):
    compare_gradients(device, LAYOUT, seed)


LONG = ("colour alike from everywhere",)  # seven seconds; so is that of "all at once"


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n in LONG)) for n in OTHERS]
)
def test_every_gradient_of_other_networks(device, name):
    compare_gradients(device, OTHERS[name], seed=1)
