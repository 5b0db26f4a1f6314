"""Light by direction that a package cannot have, and the sentences about it."""

import json
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.package.package_files import MANIFEST
from shapeshift.runtime_models.package.read_package import read_files
from shapeshift.runtime_models.package.write_package import package_files
from tests.support.models import changed_arrays, make_random_model, with_light


@pytest.mark.parametrize(
    ("arrays", "sentence"),
    [
        ({"light": None}, "lacks the array 'light'"),
        ({"light": np.zeros((10, 8), np.float32)}, r"expected \(A, 24\)"),
        ({"light": np.zeros((10, 25), np.float32)}, r"expected \(A, 24\)"),
        ({"light": np.ones((9, 24), np.float32)}, "10 positions but 9 light"),
        ({"light": np.full((10, 24), np.nan, np.float32)}, "NaN or Inf in 10 of 10"),
        ({"light": np.full((10, 24), np.inf, np.float16)}, "NaN or Inf in 10 of 10"),
        ({"light": np.full((10, 24), -1.1e4, np.float32)}, "light reach 1.1e.04, expected what is"),
        ({"light": np.zeros((10, 24))}, "is float64"),
        ({"light": np.zeros((10, 24), np.uint8)}, "need light_range"),
        ({"frame_rotations": np.ones((10, 4), np.float32)}, "lacks the array 'frame_log_scales'"),
    ],
)
def test_light_that_cannot_be_is_refused(arrays, sentence):
    files = package_files(with_light(make_random_model(10)), "float32")
    with pytest.raises(BadFile, match=sentence):
        read_files(changed_arrays(files, **arrays).__getitem__, "here")


@pytest.mark.parametrize("width", [24, 25])
def test_light_of_three_channels_is_none_of_one(width):
    files = package_files(with_light(make_random_model(10), channels=1), "float32")
    files = changed_arrays(files, light=np.zeros((10, width), np.float32))
    with pytest.raises(BadFile, match=r"expected \(A, 8\)"):
        read_files(files.__getitem__, "here")


def test_the_largest_light_is_read():
    files = package_files(with_light(make_random_model(10)), "float32")
    files = changed_arrays(files, light=np.full((10, 24), 1e4, np.float32))
    assert (read_files(files.__getitem__, "here").light == 1e4).all()


@pytest.mark.parametrize(
    ("version", "inputs", "sentence"),
    [
        (
            "shapeshift 3",
            ["feature", "direction", "control"],
            "a list with 'direction' and 'light'",
        ),
        ("shapeshift 3", ["feature", "light", "control"], "a list with 'direction' and 'light'"),
        ("shapeshift 4", ["feature", "direction", "control"], "in 'shapeshift 4'"),
        ("shapeshift 4", ["feature", "light", "control"], "a list with 'direction' and 'light'"),
        ("shapeshift 3", None, r"light has shape \(10, 24\), expected \(A, 8\)"),
        ("shapeshift 5", None, "reads 'shapeshift 1', 'shapeshift 2', 'shapeshift 3' and 'shap"),
        ("shapeshift 2", None, "a list of some of feature, direction, control, each once"),
        ("shapeshift 1", None, "a list of some of feature, direction, control, each once"),
    ],
)
def test_a_manifest_that_does_not_fit_its_light_is_refused(version, inputs, sentence):
    files = package_files(with_light(make_random_model(10)), "float32")
    manifest = json.loads(files[MANIFEST])
    manifest["format"] = version
    if inputs is not None:
        manifest["heads"]["color"]["inputs"] = inputs
    with pytest.raises(BadFile, match=sentence):
        read_files((files | {MANIFEST: json.dumps(manifest).encode()}).__getitem__, "here")


def test_another_head_may_not_take_it():
    files = package_files(with_light(make_random_model(10)), "float32")
    manifest = json.loads(files[MANIFEST])
    manifest["heads"]["opacity"]["inputs"] = ["feature", "light", "control"]
    with pytest.raises(BadFile, match="a list of some of feature, control, each once"):
        read_files((files | {MANIFEST: json.dumps(manifest).encode()}).__getitem__, "here")


def test_a_model_cannot_lose_its_light_or_the_input_alone():
    model = with_light(make_random_model(5))
    with pytest.raises(ValueError, match="anchors have no light, but the colour network takes"):
        replace(model, light=None)
    with pytest.raises(ValueError, match="anchors have light, but the colour network takes"):
        replace(model, networks=make_random_model(5).networks)
    with pytest.raises(ValueError, match="shape"):
        replace(model, light=model.light[:4])
    for width in (7, 9, 16, 23, 25):
        with pytest.raises(ValueError, match=f"{width} numbers of light each, expected 8 or 24"):
            replace(model, light=np.zeros((5, width), np.float32))
