"""A coarser level learns: nearer to the package than its averages, the networks the same."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.rasterizer.device import open_device
from shapeshift.runtime_models.lod.average_anchors import average_anchors
from shapeshift.runtime_models.model import HEADS, BadFile
from shapeshift.scene.cameras.framing import orbit_path
from shapeshift.scene.metrics import psnr
from shapeshift.training.distill import PictureError, StillHeads, controls_of, distill
from tests.support.models import make_random_model, with_light

SIZE = (40, 40)


def views(turn=0.0):
    return orbit_path(3, np.zeros(3), 1.0, SIZE, start=turn)


def worst_db(device, model, coarse, turn):
    """Of views that it has not learned from, at all stops and between them."""
    whole, part = StillHeads(device, model), StillHeads(device, coarse)
    found = []
    for view in views(turn):
        for control in controls_of(model, (0.4,)):
            pair = [
                device.download(each.step.draw(view, control, (0, 0, 0)).frame.image).copy()
                for each in (whole, part)
            ]
            found.append(psnr(*pair))
    return min(found)


def lit_as_by_train(model, channels):
    """The model with light that two units a channel of the colour network add to the logits."""
    color = model.networks["color"]
    first, last = color.weights
    both = np.concatenate([np.eye(channels), -np.eye(channels)]).astype(np.float32)
    carry = np.pad(both, ((0, 0), (first.shape[1], 0)))
    first = np.vstack([np.pad(first, ((0, 0), (0, channels))), carry])
    adds = np.tile(both.T, (len(last) // channels, 1))  # output o is of channel o % 3
    last, more = np.hstack([last, adds]), 2 * channels
    color = replace(
        color, weights=(first, last), biases=(np.pad(color.biases[0], (0, more)), color.biases[1]),
        inputs=(*color.inputs, "light"),
    )  # fmt: skip
    light = np.random.default_rng(8).normal(size=(len(model.anchors), 8 * channels))
    light = light.astype(np.float32)
    return replace(model, networks=model.networks | {"color": color}, light=light)


@pytest.mark.parametrize("lit", [0, 1, 3])
def test_it_comes_nearer_at_every_x_and_networks_stay(lit):
    model = make_random_model(200)
    model = lit_as_by_train(model, lit) if lit else model
    device, coarse = open_device(), average_anchors(model, 0.5)
    learned, steps = distill(device, model, coarse, views(), 1e9, most_steps=60)
    assert steps == 60 and learned.networks is model.networks
    assert learned.features.shape == coarse.features.shape
    # 60 steps gain 3 dB and more in the worst of views that were not learned from
    assert worst_db(device, model, learned, 0.5) > worst_db(device, model, coarse, 0.5) + 2


def test_the_same_steps_give_the_same_bits_and_no_time_none():
    model = make_random_model(60)
    device, coarse = open_device(), average_anchors(model, 0.6)
    one, other = (distill(device, model, coarse, views(), 1e9, most_steps=5)[0] for _ in range(2))
    np.testing.assert_array_equal(one.features, other.features)
    assert distill(device, model, coarse, views(), 0.0) == (coarse, 0)


def test_the_gradient_is_that_of_half_the_squared_difference():
    device, rng = open_device(), np.random.default_rng(1)
    image, target = (rng.random((3, 4, 5), np.float32) for _ in range(2))
    grad = PictureError(device).compare(device.upload(image), device.upload(target))

    def loss(values):
        return 0.5 * np.square(values - target, dtype=np.float64).mean()

    step = np.zeros_like(image, np.float64)
    step[1, 2, 3] = 1e-4
    slope = (loss(image + step) - loss(image - step)) / 2e-4
    assert device.download(grad)[1, 2, 3] == pytest.approx(slope, rel=1e-4)


def test_colours_between_a_thermal_stop_and_another_are_those_of_either():
    model = make_random_model(5)  # RGB at 0, thermal with a palette at 1
    found = controls_of(model, (0.5,))
    assert len(found) == 4
    color = HEADS.index("color")
    for mixed, x in zip(found[2:], (0.0, 1.0), strict=True):
        np.testing.assert_array_equal(mixed[color], model.psi(x)[0])
        np.testing.assert_array_equal(mixed[0], model.psi(0.5)[0])
    plain = replace(model, stops=tuple(replace(s, palette="") for s in model.stops))
    (middle,) = controls_of(plain, (0.5,))[2:]
    np.testing.assert_array_equal(middle, np.tile(model.psi(0.5), (5, 1)))


def test_networks_that_cannot_be_learned_with_are_refused():
    deep = make_random_model(30, hidden=(16, 16))
    mixed = with_light(make_random_model(30))  # light that other inputs meet
    for model, said in ((deep, "hidden layers"), (mixed, "mixes light by direction")):
        with pytest.raises(BadFile, match=f"--distill 0 averages alone.*{said}"):
            distill(open_device(), model, average_anchors(model, 0.5), views(), 1.0)
