"""The whole step against finite differences in float64: every weight and all that anchors have."""

import pytest

from tests.support.training.situations import LAYOUT, OTHERS, compare_gradients


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_every_gradient(device, seed):
    compare_gradients(device, LAYOUT, seed)


# Seven seconds each, and what these change is changed in "3 layers" and "all at once", too.
LONG = ("2 layers", "shape fixed", "colour alike from everywhere")


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n in LONG)) for n in OTHERS]
)
def test_every_gradient_of_other_networks(device, name):
    compare_gradients(device, OTHERS[name], seed=1)
