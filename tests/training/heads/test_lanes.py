"""heads.cl in vectors of 16 and of 8 floats: the same bits, so that a seed gives the same file on
processors with and without AVX-512.
"""

import numpy as np
import pytest

from shapeshift.rasterizer.device import open_device
from shapeshift.training.heads.networks import HeadLayout, Heads, padded

LAYOUTS = {
    "usual": HeadLayout(5, 16, 32, 3),
    # Eights left over: of units (24), of features (8), of outputs (a splat: 3, 3, 4, 1, 3).
    "odd": HeadLayout(1, 8, 24, 2),
}


def run(layout: HeadLayout, anchors: int, lanes: int) -> list[np.ndarray]:
    """Everything that both ways of the heads write, as bits."""
    device, rng = open_device("cpu"), np.random.default_rng(anchors)
    weights = (0.2 * rng.normal(size=layout.weights_at[-1])).astype(np.float32)
    places, grad = rng.normal(size=(anchors, 3)), rng.normal(size=(anchors, layout.raw_at[-1]))
    features = rng.normal(size=(anchors, padded(layout.features)))
    arrays = [device.upload(a.astype(np.float32)) for a in (weights, places, features, grad)]
    heads, moved = Heads(device, layout, "cpu", lanes), device.zeros((anchors, 3))
    raw = heads.forward(*arrays[:3], rng.random((5, layout.control)), np.array([0.0, 1.0, 3.0]))
    found = [raw, heads.hidden, *heads.backward(*arrays, moved), moved]
    return [device.download(array).view(np.uint32) for array in found]


# Of a work-item of the forward kernel 4 or 8 anchors, of a block backward 8 or 16, and chunks of
# one anchor and of several.
@pytest.mark.parametrize("anchors", [1, 7, 8, 9, 15, 16, 17, 1000])
@pytest.mark.parametrize("name", LAYOUTS)
def test_sixteen_lanes_give_the_bits_of_eight(name, anchors):
    wide, narrow = (run(LAYOUTS[name], anchors, lanes) for lanes in (16, 8))
    assert any(array.any() for array in wide)
    for one, other in zip(wide, narrow, strict=True):
        np.testing.assert_array_equal(one, other)
