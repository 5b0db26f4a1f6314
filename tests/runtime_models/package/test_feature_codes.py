"""Features of a package as floats and as bytes: what comes back, and what is refused."""

import io

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.package.feature_codes import (
    FEATURES,
    decode_features,
    encode_features,
)
from shapeshift.runtime_models.package.read_package import read_anchors, read_files, read_package
from shapeshift.runtime_models.package.write_package import package_files, write_package
from tests.support.models import make_random_model


@pytest.mark.parametrize("count", [0, 1, 2, 257])
def test_bytes_are_off_by_half_a_step_at_most(count):
    rng = np.random.default_rng(count)
    features = (rng.normal(size=(count, 6)) * [1, 1e-3, 1e4, 1, 0, 1e-30]).astype(np.float32)
    features[:, 3] = 7.25
    arrays = encode_features(features, "uint8")
    back = decode_features(arrays["features"], arrays["feature_range"], "here")
    assert back.shape == features.shape and back.dtype == np.float32
    if count:
        half = (features.max(0).astype(np.float64) - features.min(0)) / 255 / 2
        assert (np.abs(back.astype(np.float64) - features) <= 1.001 * half + 1e-37).all()
        assert (back[:, 3] == 7.25).all()
        np.testing.assert_array_equal(back.max(0), features.max(0))


@pytest.mark.parametrize("kind", FEATURES)
def test_a_package_gives_back_the_features_it_was_given(tmp_path, kind):
    model = make_random_model(500, k=2)
    size = write_package(model, tmp_path / "a.shift", kind)
    back = read_package(tmp_path / "a.shift")
    most = {"float32": 0, "float16": 2e-3, "uint8": 0.02}[kind]
    assert np.abs(back.features - model.features).max() <= most
    again = write_package(back, tmp_path / "b.shift", kind)
    if kind == "uint8":  # what came back lies on the steps already
        assert abs(again - size) < 64
        np.testing.assert_allclose(
            read_package(tmp_path / "b.shift").features, back.features, atol=1e-6
        )
    assert (tmp_path / "a.shift").stat().st_size == size


def test_bytes_are_half_of_float16():
    model = make_random_model(4000, k=2)
    sizes = [len(package_files(model, kind)["anchors.npz"]) for kind in FEATURES]
    assert sizes[2] < 0.75 * sizes[1] < 0.6 * sizes[0]


def stored(**arrays) -> bytes:
    out = io.BytesIO()
    np.savez(out, positions=np.zeros((2, 3), np.float32), **arrays)
    return out.getvalue()


CODES = np.zeros((2, 4), np.uint8)


@pytest.mark.parametrize(
    "ends",
    [
        None, np.zeros((2, 3), np.float32), np.zeros((2, 4)), np.zeros(8, np.float32),
        np.array([[1] * 4, [0] * 4], np.float32), np.full((2, 4), np.nan, np.float32),
        np.array([[0] * 4, [np.inf] * 4], np.float32), np.zeros((2, 4), np.int32),
        np.array([["a"] * 4] * 2),
    ],
)  # fmt: skip
def test_bytes_without_a_sound_range_are_refused(ends):
    arrays = {} if ends is None else {"feature_range": ends}
    with pytest.raises(BadFile, match="feature_range"):
        read_anchors(stored(features=CODES, **arrays), 4, "here")


def test_the_range_of_floats_is_not_read():
    data = stored(features=np.ones((2, 4), np.float32), feature_range=np.zeros(1))
    assert (read_anchors(data, 4, "here")[1] == 1).all()


def test_another_storage_is_refused():
    with pytest.raises(ValueError, match="cannot be stored as 'int4'"):
        encode_features(np.zeros((1, 1), np.float32), "int4")


def test_large_values_leave_float16():
    model = make_random_model(3, k=1, features=4)
    model.features[0, 0] = 1e5
    files = package_files(model, "float16")
    assert read_files(files.__getitem__, "here").features[0, 0] == 1e5
