"""Modalities that are not treated alike: how often each comes, and heat that is smooth."""

from dataclasses import replace

import numpy as np
import pytest

import tests.support.training.fit_scenes as fit_scenes
from shapeshift.rasterizer.reference import finite_differences
from shapeshift.runtime_models.model import BadFile
from shapeshift.training.losses.smooth import roughness, smooth_picture
from shapeshift.training.schedule import Schedule, balance_of, turns_of
from shapeshift.training.settings import TrainSettings
from shapeshift.training.train import Trainer


def test_turns_are_read_out_of_a_sentence():
    assert balance_of("") == {} == balance_of(" , ")
    assert balance_of("RGB=3, Thermal = 1,") == {"RGB": 3, "Thermal": 1}
    assert balance_of("a=b=2") == {"a=b": 2}


@pytest.mark.parametrize("text", ["RGB", "RGB=", "=3", "RGB=0", "RGB=-1", "RGB=1.5", "RGB=101"])
def test_turns_that_are_none_are_refused(text):
    with pytest.raises(ValueError, match="RGB=3,Thermal=1"):
        TrainSettings(balance=text)


def test_turns_are_spread_evenly_and_none_is_forgotten():
    names = ["RGB", "Thermal", "Open"]
    assert turns_of({}, names) == ()
    assert turns_of({"RGB": 1}, names) == (0, 1, 2)
    order = turns_of({"RGB": 6, "Thermal": 2}, names)
    assert [order.count(i) for i in range(3)] == [6, 2, 1]
    again = np.flatnonzero(np.array(order * 2) == 1)
    assert np.diff(again).max() <= 6  # 4.5 on average
    with pytest.raises(BadFile, match=r"'Heat'.*RGB, Thermal, Open"):
        turns_of({"Heat": 2}, names)
    assert turns_of({"RGB": 3}, ["Thermal"]) == ()  # a separate model of one of them


@pytest.mark.parametrize("turns", [(0, 1), (0, 1, 0, 0), (1, 0)])
def test_every_modality_goes_through_all_of_its_photos(turns):
    photos = {"a": [f"a{i}" for i in range(5)], "b": [f"b{i}" for i in range(3)]}
    schedule = Schedule(photos, 3, None, turns)
    seen = [schedule.photo(i) for i in range(60 * len(turns))]
    for which, name in enumerate(photos):
        mine = [photo for photo in seen if photo[0] == name]
        assert len(mine) == 60 * turns.count(which)
        size = len(photos[name])
        for start in range(0, len(mine), size):
            assert set(mine[start : start + size]) == set(photos[name])
    if turns == (0, 1):  # as without turns
        plain = Schedule(photos, 3, None)
        assert seen == [plain.photo(i) for i in range(len(seen))]


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (8, 5), (64, 2), (13, 65)])
def test_roughness_has_its_gradient(device, size):
    height, width = size
    rng = np.random.default_rng(width)
    image = rng.permutation(3 * width * height).reshape(3, height, width) / 100
    given = rng.normal(size=image.shape).astype(np.float32)
    grad = device.upload(given)
    smooth_picture(device, device.upload(image.astype(np.float32)), grad, 0.6)
    wanted = given + 0.6 * finite_differences(roughness, image, 1e-4)
    np.testing.assert_allclose(device.download(grad), wanted, atol=1e-6)


def test_flat_pictures_are_smooth(device):
    grad, image = device.zeros((3, 9, 7)), device.upload(np.full((3, 9, 7), 0.3, np.float32))
    smooth_picture(device, image, grad, 0.6)
    assert not device.download(grad).any() and roughness(device.download(image)) == 0


def test_thermal_pictures_alone_become_smoother(device, tmp_path):
    capture = fit_scenes.make_shapes(tmp_path, "shared", rig=True)
    # An even encoding tells two stops apart within fewer steps than one unit a stop does.
    plain = TrainSettings(iterations=120, grow=False, max_anchors=500, encoding="even")
    rough = {}
    for share in (0.0, 6.0):
        trainer = Trainer(device, capture, replace(plain, thermal_smooth=share))
        assert trainer.roughness == {"Thermal": share}
        for _ in trainer.steps():
            pass
        for stop in capture.stops:
            drawing = trainer.step.draw(
                trainer.held_out[0].view, trainer.control(stop.name), (1.0, 1.0, 1.0)
            )
            rough[stop.name, share] = roughness(device.download(drawing.frame.image))
    assert rough["Thermal", 6.0] < 0.9 * rough["Thermal", 0.0]
    assert rough["RGB", 6.0] > 0.93 * rough["RGB", 0.0]


def test_more_turns_help_the_modality_that_has_them(device, tmp_path):
    capture = fit_scenes.make_shapes(tmp_path, "shared")
    found = {}
    for balance in ("RGB=4", "Thermal=4"):
        settings = TrainSettings(iterations=120, grow=False, max_anchors=500, balance=balance)
        trainer = Trainer(device, capture, settings)
        for _ in trainer.steps():
            pass
        found[balance] = trainer.held_out_psnr(4)
    for name in ("RGB", "Thermal"):
        mine, other = f"{name}=4", next(b for b in found if not b.startswith(name))
        assert found[mine][name] > found[other][name], name
