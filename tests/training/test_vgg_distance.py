"""The VGG distance: its arithmetic by hand, what it may be asked, and the real network if there."""

import json

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.training.evaluation.vgg_distance import MEAN_BGR, VggDistance, distance_of
from tests.support.training.vgg_files import write_small

RNG = np.random.default_rng


def by_hand(weights, image, photo) -> float:
    """The distance of that network, pixel by pixel in float64."""
    found = []
    pixels = [(255 * p[..., ::-1].astype(np.float64) - MEAN_BGR) for p in (image, photo)]
    for weight in weights:
        pixels = [np.maximum(p @ weight.T, 0) for p in pixels]
        units = [p / (np.linalg.norm(p, axis=2, keepdims=True) + 1e-10) for p in pixels]
        found.append((np.subtract(*units) ** 2).sum(axis=2).mean())
    return float(np.mean(found))


@pytest.fixture
def small(tmp_path):
    weights = write_small(tmp_path / "small.onnx")
    return VggDistance(tmp_path / "small.onnx"), weights


def test_it_is_what_a_hand_calculates(small):
    distance, weights = small
    image, photo = RNG(1).random((2, 17, 31, 3)).astype(np.float32)
    assert distance(image, photo) == pytest.approx(by_hand(weights, image, photo), rel=1e-5)
    assert distance(photo, photo) == 0
    assert distance(3 * image - 1, photo) == distance(np.clip(3 * image - 1, 0, 1), photo)


def test_what_does_not_count_is_as_the_photo(small):
    distance, _ = small
    image, photo = RNG(1).random((2, 20, 20, 3)).astype(np.float32)
    weight = np.zeros((20, 20), np.float32)
    assert distance(image, photo, weight) == pytest.approx(0, abs=1e-9)
    weight[5:] = 1
    mixed = np.where(weight[..., None] > 0, image, photo)
    assert distance(image, photo, weight) == pytest.approx(distance(mixed, photo), rel=1e-5)


def test_equal_and_opposite_features():
    same = np.ones((2, 4, 3, 3), np.float32)
    apart = np.zeros((2, 4, 3, 3), np.float32)
    apart[0, 0], apart[1, 1] = 5, 0.1  # at right angles: length does not matter
    assert distance_of([same]) == 0 and distance_of([apart]) == pytest.approx(2)
    assert distance_of([same, apart]) == pytest.approx(1)
    assert distance_of([np.zeros((2, 4, 3, 3), np.float32)]) == 0  # no features, no NaN


def test_files_that_are_no_such_network_are_refused(tmp_path):
    with pytest.raises(BadFile, match="is no file"):
        VggDistance(tmp_path / "absent.onnx")
    (tmp_path / "text.onnx").write_text("no network")
    with pytest.raises(BadFile, match="is not a readable ONNX file"):
        VggDistance(tmp_path / "text.onnx")
    write_small(tmp_path / "other.onnx", outputs=("relu1_2", "fc7"))
    with pytest.raises(BadFile, match="the outputs relu1_2, relu2_2, relu3_3, relu4_3"):
        VggDistance(tmp_path / "other.onnx")


def test_tiny_photos_are_refused(small):
    with pytest.raises(BadFile, match="15x40 pixels are too small"):
        small[0](np.zeros((40, 15, 3)), np.zeros((40, 15, 3)))


def test_the_real_network_sees_blur_and_noise(data):
    file = data / "models_vgg16" / "vgg16_caffe_relu1_2-4_3.onnx"
    if not file.is_file():
        pytest.skip("the VGG16 file is absent")
    distance = VggDistance(file)
    assert "sha256" in json.dumps(distance.name)
    photo = RNG(0).random((8, 8, 3)).repeat(6, 0).repeat(6, 1).astype(np.float32)
    shifted = np.roll(photo, 1, axis=1)
    noise = [photo + RNG(1).normal(0, s, photo.shape).astype(np.float32) for s in (0.02, 0.1, 0.4)]
    values = [distance(image, photo) for image in (photo, *noise)]
    assert values[0] == 0 and values == sorted(values) and values[-1] > 5 * values[1]
    assert 0 < distance(shifted, photo) < 4
