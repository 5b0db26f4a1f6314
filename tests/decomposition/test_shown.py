"""What views show of anchors: masks together as one by one, parts as the whole, pictures."""

import numpy as np
import pytest

pytest.importorskip("pyopencl")

from shapeshift.decomposition.shown import ShownAnchors
from shapeshift.rasterizer.device import NoDevice, open_device
from shapeshift.runtime_models.model import SplatLayers, Stop
from shapeshift.scene.cameras.framing import framing_view, model_points
from tests.support.models import make_random_model

SIZE = (50, 34)


@pytest.fixture(scope="module")
def device():
    try:
        return open_device()
    except NoDevice as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def shown(device):
    return ShownAnchors(device, make_random_model(anchors=60, k=3, features=4, hidden=(4,)))


@pytest.fixture(scope="module")
def view(shown):
    return framing_view(*model_points(shown.model), SIZE)


def some_masks(count: int) -> list[np.ndarray]:
    rng = np.random.default_rng(count)
    return [rng.random(SIZE[::-1]) < 0.4 for _ in range(count)]


@pytest.mark.parametrize("count", [0, 1, 2, 7, 8, 15])
def test_masks_at_once_are_those_one_by_one(shown, view, count):
    """Seven share a launch; rounded to 1/1024 a splat, tile and label: .004 measured at worst."""
    masks = some_masks(count)
    together, total = shown.masks(view, 0.0, masks)
    assert len(together) == count and total.shape == (60,) and total.sum() > 20
    for mask, inside in zip(masks, together, strict=True):
        (alone,), whole = shown.masks(view, 0.0, [mask])
        np.testing.assert_allclose(inside, alone, atol=0.02)
        np.testing.assert_allclose(whole, total, atol=0.02)


def test_a_mask_and_its_opposite_are_the_whole(shown, view):
    (mask,) = some_masks(1)
    (inside, outside), total = shown.masks(view, 1.0, [mask, ~mask])
    np.testing.assert_allclose(inside + outside, total, rtol=1e-12)
    assert (inside >= 0).all() and inside.sum() > 0 and outside.sum() > 0


def test_what_anchors_show_is_what_a_picture_of_ones_shows(shown, view):
    """Another pass, another kernel: the sum over the picture is the sum over the anchors."""
    _, total = shown.masks(view, 0.0, [])
    ones = shown.picture(view, 0.0, np.ones((60, 3)))
    assert ones.shape == (*SIZE[::-1], 3)
    assert ones[..., 0].sum() == pytest.approx(total.sum(), rel=0.01)
    one = np.zeros((60, 3))
    at = int(total.argmax())
    one[at, 1] = 1
    picture = shown.picture(view, 0.0, one)
    assert picture[..., 1].sum() == pytest.approx(total[at], rel=0.02)
    assert not picture[..., [0, 2]].any()


def test_another_control_is_another_picture_and_back_again(shown, view):
    first = shown.masks(view, 0.0, [])[1]
    assert np.abs(shown.masks(view, 1.0, [])[1] - first).max() > 1e-3
    np.testing.assert_array_equal(shown.masks(view, 0.0, [])[1], first)


def test_plain_splats_are_counted_one_by_one(device):
    rng = np.random.default_rng(0)
    model = SplatLayers(
        rng.normal(size=(30, 3)).astype(np.float32), np.full((30, 3), 0.1, np.float32),
        np.tile(np.array([1, 0, 0, 0], np.float32), (30, 1)), np.full(30, 0.8, np.float32),
        np.zeros((30, 1, 3), np.float32), np.zeros(30, np.int32), (Stop("RGB", 0.0),),
    )  # fmt: skip
    shown = ShownAnchors(device, model)
    _, total = shown.masks(framing_view(*model_points(model), SIZE), 0.0, [])
    assert total.shape == (30,) and (total > 0).sum() > 20
