"""Anchors with their own axes and sizes: what they mean, on disk and back, and what is refused."""

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from shapeshift.runtime_models.evaluate import Evaluator, evaluate
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.package.drop_unused import drop_unused
from shapeshift.runtime_models.package.feature_codes import FEATURES
from shapeshift.runtime_models.package.package_files import ANCHORS, MANIFEST
from shapeshift.runtime_models.package.read_package import read_files, read_package
from shapeshift.runtime_models.package.write_package import package_files, write_package
from shapeshift.runtime_models.read_scene import describe
from shapeshift.runtime_models.rotation import product
from tests.support.models import changed_arrays, make_random_model, with_frames, without_control

EYE = np.array([0.3, -0.2, 2.0])


def turned(wxyz: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.asarray(wxyz, np.float64)[:, [1, 2, 3, 0]])


@pytest.mark.parametrize("k", [1, 3])
@pytest.mark.parametrize("x", [0.0, 0.4])
def test_splats_are_those_of_the_networks_turned_by_scipy(k, x):
    bare = make_random_model(37, k=k)
    model = with_frames(bare)
    found, plain = evaluate(model, x, EYE), evaluate(bare, x, EYE)
    axes = turned(np.repeat(model.frames.wxyz, k, axis=0))
    sizes = np.repeat(model.frames.scales, k, axis=0)
    anchors = np.repeat(bare.anchors, k, axis=0)
    offset = axes.apply(sizes * (plain.means - anchors))
    np.testing.assert_allclose(found.means, anchors + offset, atol=2e-6)
    np.testing.assert_allclose(found.scales, sizes * plain.scales, rtol=1e-5)
    whole = (axes * turned(plain.wxyz)).as_matrix()
    np.testing.assert_allclose(turned(found.wxyz).as_matrix(), whole, atol=2e-6)
    np.testing.assert_array_equal(found.opacity, plain.opacity)
    np.testing.assert_array_equal(found.color, plain.color)


def test_the_product_of_quaternions_is_that_of_scipy():
    a, b = np.random.default_rng(1).normal(size=(2, 50, 4))
    found = turned(product(a, b)).as_matrix()
    np.testing.assert_allclose(found, (turned(a) * turned(b)).as_matrix(), atol=1e-12)


def test_kept_and_whole_evaluators_agree_at_every_x_twice():
    model = with_frames(without_control(make_random_model(20), "offset", "rotation"))
    kept = Evaluator(model, keep=True)
    for x in (0.1, 0.9, 0.1):  # what does not see x must not be turned a second time
        for one, other in zip(kept.geometry(x), Evaluator(model, fold=False).geometry(x)):  # noqa: B905
            np.testing.assert_allclose(one, other, atol=1e-6)


@pytest.mark.parametrize("kind", FEATURES)
def test_a_package_gives_back_the_frames(tmp_path, kind):
    model = with_frames(make_random_model(300))
    write_package(model, tmp_path / "a.shift", kind)
    back = read_package(tmp_path / "a.shift").frames
    # a byte: half of a 255th of ln(25) of a factor, and of 2 of an entry of a quaternion
    most = {"float32": 2e-6, "float16": 1e-3, "uint8": 8e-3}[kind]
    assert np.abs(back.scales / model.frames.scales - 1).max() <= most
    assert np.abs(back.wxyz - model.frames.wxyz).max() <= 2 * most
    np.testing.assert_allclose(np.linalg.norm(back.wxyz, axis=1), 1, atol=1e-6)
    assert json.loads(package_files(model, kind)[MANIFEST])["format"] == "shapeshift 2"
    assert describe(model, tmp_path / "a.shift")["format"] == "shapeshift 2"  # what info says


def test_a_package_without_frames_is_as_it_was():
    model = make_random_model(10)
    files = package_files(model, "float16")
    assert json.loads(files[MANIFEST])["format"] == "shapeshift 1"
    with np.load(io.BytesIO(files[ANCHORS])) as arrays:
        assert set(arrays) == {"positions", "features"}
    assert read_files(files.__getitem__, "here").frames is None


@pytest.mark.parametrize(
    ("arrays", "sentence"),
    [
        ({"frame_log_scales": None}, "lacks the array 'frame_log_scales'"),
        ({"frame_rotations": None}, "lacks the array 'frame_rotations'"),
        ({"frame_log_scales": np.zeros((10, 1), np.float32)}, r"expected \(A, 3\)"),
        ({"frame_rotations": np.ones((9, 4), np.float32)}, "10 positions but 9 frame_rotations"),
        ({"frame_rotations": np.full((10, 4), np.nan, np.float32)}, "NaN or Inf in 10 of 10"),
        ({"frame_log_scales": np.full((10, 3), 20.5, np.float32)}, "reach 20.5, expected natural"),
        ({"frame_log_scales": np.zeros((10, 3))}, "is float64"),
        ({"frame_rotations": np.zeros((10, 4), np.uint8)}, "need frame_rotation_range"),
    ],
)
def test_frames_that_cannot_be_are_refused(arrays, sentence):
    files = package_files(with_frames(make_random_model(10)), "float32")
    with pytest.raises(BadFile, match=sentence):
        read_files(changed_arrays(files, **arrays).__getitem__, "here")


def test_a_quaternion_of_no_length_turns_nothing():
    files = package_files(with_frames(make_random_model(10)), "float32")
    files = changed_arrays(files, frame_rotations=np.zeros((10, 4), np.float32))
    np.testing.assert_array_equal(
        read_files(files.__getitem__, "here").frames.wxyz, np.tile([1, 0, 0, 0], (10, 1))
    )


def test_what_nothing_shows_goes_with_its_frame():
    model = with_frames(make_random_model(40, k=2))
    alive = np.random.default_rng(2).random((40, 2)) < 0.4
    smaller, removed = drop_unused(model, alive)
    kept = alive.any(axis=1)
    assert removed.anchors == (~kept).sum() > 0
    np.testing.assert_array_equal(smaller.frames.scales, model.frames.scales[kept])
    np.testing.assert_array_equal(smaller.frames.wxyz, model.frames.wxyz[kept])


def test_frames_of_another_number_of_anchors_are_refused():
    model = with_frames(make_random_model(5))
    with pytest.raises(ValueError, match="shape"):
        replace(model, anchors=model.anchors[:4], features=model.features[:4])
