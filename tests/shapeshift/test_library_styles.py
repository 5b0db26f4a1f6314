"""Scene.add_style and without_stop: what the command does, as functions."""

import numpy as np
import pytest

import shapeshift as ss
from tests.support.new_stops import framed_model


@pytest.fixture(scope="module")
def scene() -> ss.Scene:
    return ss.Scene.from_model(framed_model(150))


def test_a_stop_goes_in_and_out(scene, tmp_path):
    told = []
    furry = scene.add_style(
        "Fur", shape="fur", after="RGB", pace=False, progress=lambda what, done: told.append(what)
    )
    assert [stop.name for stop in furry.stops] == ["RGB", "Fur", "Thermal", "Opened"]
    assert [stop.name for stop in scene.stops] == ["RGB", "Thermal", "Opened"]  # as it was
    assert told == ["shape: fur"]
    furry.save(tmp_path / "fur.shift")
    again = ss.load(tmp_path / "fur.shift")
    for name in ("RGB", "Thermal", "Opened"):
        for one, other in ((scene, again), (scene, furry.without_stop("Fur"))):
            a, b = (s.splats(name, palette=False) for s in (one, other))
            np.testing.assert_allclose(a.means, b.means, atol=1e-5)


def test_a_function_paints_a_region(scene, device):
    """Green inside, as it was outside."""
    seen = []

    def green(picture: np.ndarray) -> np.ndarray:
        seen.append(picture.shape)
        return np.broadcast_to(np.array([0.0, 1.0, 0.0], np.float32), picture.shape)

    made = scene.add_style("Green", paint=green, region=["label:pump"], steps=40, views=4, size=64,
                           pace=False)  # fmt: skip
    assert seen == [(48, 64, 3)] * 4
    before, after = (s.splats(x, palette=False) for s, x in ((scene, "RGB"), (made, "Green")))
    change = (after.sh - before.sh)[:, 0]
    rows = np.abs(change).max(axis=1) > 0.02
    assert rows.any() and change[rows, 1].mean() > 0 > change[rows, 0].mean()
    assert rows.mean() < 0.5  # a third of the anchors is the pump


@pytest.mark.parametrize(("asked", "wanted"), [
    ({}, "a new stop needs one of shape, network, pictures"),
    ({"shape": "fur", "source": "X"}, "from is 'X'"),
    ({"paint": lambda picture: picture[:2]}, "gave an array of shape"),
    ({"paint": lambda picture: picture, "network": "a.onnx"}, "leave the other ways"),
    ({"text": "hairy"}, "text needs clip_model"),
    ({"shape": "fur", "strength": 2.0}, "strength is 2.0"),
])  # fmt: skip
def test_what_cannot_be_is_refused(scene, asked, wanted):
    with pytest.raises(ss.UsageError, match=wanted):
        scene.add_style("New", views=2, size=32, steps=1, pace=False, **asked)
    with pytest.raises(ss.BadFile, match="no stop 'X'"):
        scene.without_stop("X")
