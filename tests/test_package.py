"""Packages: round trips to the bit, the documented example, a sentence for each way to break."""

import io
import json
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import onnx
import pytest

from runtime_models.evaluate import evaluate
from runtime_models.model import HEADS, BadFile
from runtime_models.read_package import read_package
from runtime_models.read_scene import describe, read_model
from runtime_models.write_package import package_files, write_package
from tests.models import make_random_model

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def folder(tmp_path):
    write_package(make_random_model(), tmp_path / "scene", "float32")
    return tmp_path / "scene"


def edit(folder, change):
    """Rewrite the manifest after `change` has mutated it."""
    path = folder / "scene.json"
    manifest = json.loads(path.read_text())
    change(manifest)
    path.write_text(json.dumps(manifest))


def save_arrays(folder, **arrays):
    old = dict(np.load(folder / "anchors.npz"))
    np.savez(folder / "anchors.npz", **(old | arrays))


@pytest.mark.parametrize("name", ["scene", "scene.shift"])
def test_round_trip_is_exact(tmp_path, name):
    model = make_random_model(hidden=(32, 8))
    written = write_package(model, tmp_path / name, "float32")
    back = read_model(tmp_path / name)
    np.testing.assert_array_equal(back.anchors, model.anchors)
    np.testing.assert_array_equal(back.features, model.features)
    assert (back.stops, back.encoding) == (model.stops, model.encoding)
    assert (back.splats_per_anchor, back.provenance) == (5, model.provenance)
    for head in HEADS:
        a, b = back.networks[head], model.networks[head]
        assert (a.head, a.inputs, a.clip) == (b.head, b.inputs, b.clip)
        assert np.float32(a.gain) == np.float32(b.gain)
        for p, q in zip(a.weights + a.biases, b.weights + b.biases, strict=True):
            np.testing.assert_array_equal(p, q)
    facts = describe(back, tmp_path / name)
    assert facts["bytes"] == written
    assert (facts["anchors"], facts["splats"], facts["sh_degree"]) == (100, 500, None)
    assert facts["stops"][1] == {"name": "Thermal", "x": 1.0, "kind": "thermal"}


def test_the_same_model_gives_the_same_bytes(tmp_path):
    for name in ("a.shift", "b.shift"):
        write_package(make_random_model(), tmp_path / name)
    assert (tmp_path / "a.shift").read_bytes() == (tmp_path / "b.shift").read_bytes()


def test_float16_features_change_the_splats_little(tmp_path):
    model = make_random_model()
    write_package(model, tmp_path / "half.shift", "float16")
    a, b = (
        evaluate(model, 0.2, np.ones(3)),
        evaluate(read_package(tmp_path / "half.shift"), 0.2, np.ones(3)),
    )
    np.testing.assert_allclose(a.means, b.means, atol=1e-3)
    np.testing.assert_allclose(a.color, b.color, atol=2e-3)


def test_writing_replaces_a_package_but_nothing_else(tmp_path):
    model = make_random_model()
    for name in ("scene", "scene.shift"):
        write_package(model, tmp_path / name)
        write_package(model, tmp_path / name)
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos/holiday.jpg").write_bytes(b"precious")
    (tmp_path / "letter.shift").write_text("precious")
    for name in ("photos", "letter.shift"):
        with pytest.raises(BadFile, match=r"no package|not a package"):
            write_package(model, tmp_path / name)
    assert (tmp_path / "photos/holiday.jpg").read_bytes() == b"precious"
    assert (tmp_path / "letter.shift").read_text() == "precious"
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "letter.shift", "photos", "scene", "scene.shift"]  # fmt: skip


def test_the_documented_example_makes_a_package(tmp_path):
    text = (ROOT / "docs/package.md").read_text()
    example = re.search(r"```python\n(.*?)```", text, re.S)[1]
    subprocess.run([sys.executable, "-c", example], cwd=tmp_path, check=True)
    model = read_model(tmp_path)
    splats = evaluate(model, 0.5, np.ones(3))
    assert splats.means.shape == (4, 3) and (splats.scales > 0).all()
    assert model.stops[1].unit == "°C"


def break_version(folder):
    edit(folder, lambda m: m.update(format="shapeshift 9"))


def break_nan(folder):
    bad = np.load(folder / "anchors.npz")["positions"].copy()
    bad[7, 1] = np.nan
    save_arrays(folder, positions=bad)


def break_npz(folder):
    data = (folder / "anchors.npz").read_bytes()
    (folder / "anchors.npz").write_bytes(data[: len(data) // 2])


def break_pickle(folder):
    save_arrays(folder, positions=np.array([{"a": 1}], object))


def break_onnx(folder):
    (folder / "color.onnx").write_bytes(b"not a graph at all")


def swap_onnx(folder):
    (folder / "scale.onnx").write_bytes((folder / "opacity.onnx").read_bytes())


def nan_weights(folder):
    model = make_random_model()
    model.networks["offset"].weights[0][0, 0] = np.nan
    (folder / "offset.onnx").write_bytes(package_files(model, "float32")["offset.onnx"])


def change(**entries):
    return lambda folder: edit(folder, lambda m: m.update(entries))


STOP = {"name": "a", "x": 0.0, "kind": "rgb"}
BROKEN = {
    "missing ONNX": (lambda f: (f / "color.onnx").unlink(), r"lacks color\.onnx"),
    "missing anchors": (lambda f: (f / "anchors.npz").unlink(), r"lacks anchors\.npz"),
    "unknown version": (break_version, r"format 'shapeshift 9', this program reads 'shapeshift 1'"),
    "not JSON": (lambda f: (f / "scene.json").write_text("{"), "is not JSON"),
    "JSON of another kind": (lambda f: (f / "scene.json").write_text("[1]"), "has format None"),
    "NaN anchors": (break_nan, r"positions has NaN or Inf in 1 of 100 rows, first in row 7"),
    "cut off npz": (break_npz, "cut off"),
    "pickled arrays": (break_pickle, "cut off or no npz"),
    "no features": (lambda f: np.savez(f / "anchors.npz", positions=np.ones((1, 3), "f4")),
                    "lacks the array 'features'"),
    "features of other length": (lambda f: save_arrays(f, features=np.ones((3, 16), "f4")),
                                 "100 positions but 3 features"),
    "no anchors": (lambda f: save_arrays(f, positions=np.ones((0, 3), "f4")), r"shape \(0, 3\)"),
    "wrong feature width": (lambda f: save_arrays(f, features=np.ones((100, 3), "f4")),
                            r"features has shape \(100, 3\), expected \(A, 16\)"),
    "integer anchors": (lambda f: save_arrays(f, positions=np.ones((100, 3), "i4")), "is int32"),
    "no ONNX at all": (break_onnx, r"color\.onnx is not a readable ONNX file"),
    "another head's file": (swap_onnx, r"scale\.onnx maps 32 to 5 values, .* 32 .* to 15 \(k = 5"),
    "wrong k": (change(splats_per_anchor=4), r"offset\.onnx maps 32 to 15 values"),
    "k of zero": (change(splats_per_anchor=0), "'splats_per_anchor' is 0"),
    "NaN weights": (nan_weights, r"offset\.onnx: layer 0 has weights that are NaN or Inf"),
    "path out of the package": (change(heads={"offset": {"file": "../x", "inputs": ["feature"]}}),
                                "file is '../x'"),
    "no heads": (change(heads={}), "lacks 'offset'"),
    "no stops": (change(stops=[]), "at least one stop"),
    "stop outside": (change(stops=[STOP | {"x": 1.5}]), "x is 1.5, expected 0 to 1"),
    "stop of NaN": (change(stops=[STOP | {"x": float("nan")}]), "x' is nan"),
    "falling stops": (change(stops=[STOP | {"x": 1.0}, STOP]), "must rise"),
    "unknown kind": (change(stops=[STOP | {"kind": "sonar"}]), "kind is 'sonar'"),
    "bad range": (change(stops=[STOP | {"value_range": [1]}]), "value_range is"),
    "sigma of zero": (change(encoding={"d": 16, "sigma": 0, "spacing": 0.1}), "above 0"),
    "another up axis": (change(up="+Z"), "up axis '.Z'"),
}  # fmt: skip


@pytest.mark.parametrize("how", BROKEN)
def test_broken_packages_are_one_sentence(folder, how):
    break_it, words = BROKEN[how]
    break_it(folder)
    with pytest.raises(BadFile, match=words) as failure:
        read_package(folder)
    assert "\n" not in str(failure.value)


@pytest.mark.parametrize("keep", [0, 10, 500, -30])
def test_cut_off_zips_are_one_sentence(tmp_path, keep):
    write_package(make_random_model(), tmp_path / "a.shift")
    data = (tmp_path / "a.shift").read_bytes()
    (tmp_path / "a.shift").write_bytes(data[:keep])
    with pytest.raises(BadFile):
        read_model(tmp_path / "a.shift")


def test_flipped_bits_in_a_zip_are_one_sentence_or_a_model(tmp_path):
    write_package(make_random_model(), tmp_path / "a.shift")
    data = bytearray((tmp_path / "a.shift").read_bytes())
    rng, refused = np.random.default_rng(0), 0
    for _ in range(150):
        broken = bytearray(data)
        for at in rng.integers(0, len(data), 3):
            broken[at] ^= 1 << rng.integers(0, 8)
        (tmp_path / "a.shift").write_bytes(broken)
        try:
            read_model(tmp_path / "a.shift")
        except BadFile:
            refused += 1
    assert refused > 100  # the rest hit bytes that nothing depends on


def test_a_zip_that_unpacks_beyond_the_limit_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("runtime_models.read_package.LARGEST_FILE", 1000)
    path = tmp_path / "bomb.shift"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("scene.json", b" " * 1_000_000)
    with pytest.raises(BadFile, match=r"scene\.json unpacks to over"):
        read_package(path)


def test_onnx_models_pass_the_checker():
    for name, data in package_files(make_random_model(), "float16").items():
        if name.endswith(".onnx"):
            onnx.checker.check_model(onnx.load(io.BytesIO(data)))
