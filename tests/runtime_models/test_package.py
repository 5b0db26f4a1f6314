"""Packages: round trips to the bit, the documented example, a sentence for each way to break."""

import io
import os
import re
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest

from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.model import HEADS, BadFile
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import (
    describe_model,
    package_files,
    write_package,
)
from shapeshift.runtime_models.read_scene import describe, read_model
from shapeshift.runtime_models.stop_weights import Pace
from tests.support.models import make_random_model

ROOT = Path(__file__).resolve().parents[2]


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
    if name == "scene":
        (tmp_path / "scene/notes.txt").write_text("not a part of the package")
        assert read_model(tmp_path / "scene/scene.json").splat_count == 500  # as one drops it
    facts = describe(back, tmp_path / name)
    assert facts["format"] == "shapeshift 1"
    assert facts["heads"]["color"]["layers"] == [35, 32, 8, 15]
    assert facts["bytes"] == written
    assert (facts["anchors"], facts["splats"], facts["sh_degree"]) == (100, 500, None)
    assert facts["stops"][1] == {"name": "Thermal", "x": 1.0, "kind": "thermal"}


def test_what_lies_between_the_stops_is_kept_and_older_readers_pass_over_it(tmp_path):
    plain = make_random_model()
    assert not {"pace", "between_stops"} & describe_model(plain).keys()
    pace = (Pace("Thermal", "RGB", (0.0, 0.125, 1.0)),)
    write_package(replace(plain, pace=pace, between_stops="encoding"), tmp_path / "a.shift")
    again = read_package(tmp_path / "a.shift")
    assert again.pace == pace and again.between_stops == "encoding"
    assert again.psi(0.5).tolist() == [plain.encoding.encode(0.5).tolist()]
    paced = replace(again, between_stops="blend")
    assert paced.blend.weights(0.75).tolist() == [0.0625, 0.9375]  # a quarter of the way back


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


PRECIOUS = {
    "photos/holiday.jpg": "photos",  # a folder of something else
    "letter.shift": "letter.shift",  # a file that is no zip
    "folder.shift/holiday.jpg": "folder.shift",  # a folder where a file is to be written
    "note.txt": "note.txt",  # a file where a folder is to be written
    "other/scene.json": "other",  # the manifest of another program
    "scene/holiday.jpg": "scene",  # beside a package, in its folder
}


@pytest.mark.parametrize("where", PRECIOUS)
def test_writing_replaces_nothing_but_a_package(tmp_path, where):
    model = make_random_model(3)
    write_package(model, tmp_path / "scene")
    (tmp_path / where).parent.mkdir(exist_ok=True)
    (tmp_path / where).write_text("precious")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(BadFile, match="choose another name"):
        write_package(model, tmp_path / PRECIOUS[where])
    assert (tmp_path / where).read_text() == "precious"
    assert sorted(tmp_path.rglob("*")) == before


def test_a_foreign_zip_is_not_replaced(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.shift", "w") as archive:
        archive.writestr("holiday.jpg", b"precious")
    with pytest.raises(BadFile, match="is not a package"):
        write_package(make_random_model(3), tmp_path / "a.shift")


@pytest.mark.parametrize("name", ["scene", "scene.shift"])
def test_writing_again_replaces_and_leaves_nothing_behind(tmp_path, name):
    write_package(make_random_model(3), tmp_path / name)
    write_package(make_random_model(4), tmp_path / name)
    assert len(read_model(tmp_path / name).anchors) == 4
    assert [p.name for p in tmp_path.iterdir()] == [name]
    rights = (tmp_path / name).stat().st_mode & 0o777
    assert rights == (0o644 if name == "scene.shift" else 0o755)


@pytest.mark.parametrize("name", ["scene", "scene.shift"])
def test_a_failing_write_leaves_the_old_package(tmp_path, name, monkeypatch):
    write_package(make_random_model(3), tmp_path / name)
    real = os.replace

    def full_disk(source, target):
        if Path(target) == tmp_path / name and Path(source).suffix == ".part":
            raise OSError("no space left on device")
        real(source, target)

    monkeypatch.setattr(os, "replace", full_disk)
    monkeypatch.setattr("shapeshift.runtime_models.files.whole_file.swap", lambda one, other: False)
    with pytest.raises(OSError, match="no space"):
        write_package(make_random_model(4), tmp_path / name)
    assert len(read_model(tmp_path / name).anchors) == 3
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_what_could_not_be_read_back_is_not_written(tmp_path):
    model = make_random_model(3)
    model.networks["color"].weights[0][0, 0] = np.nan
    with pytest.raises(BadFile, match="NaN or Inf"):
        write_package(model, tmp_path / "a.shift")
    assert not any(tmp_path.iterdir())


def test_features_too_large_for_half_floats_stay_float32(tmp_path):
    model = make_random_model(3)
    model.features[0, 0] = 1e6
    write_package(model, tmp_path / "a.shift", "float16")
    np.testing.assert_array_equal(read_model(tmp_path / "a.shift").features, model.features)


def test_notes_of_any_kind_are_written_as_json_has_them(tmp_path):
    notes = {
        "loss": np.float32(0.5), "grid": np.arange(3), "psnr": float("nan"), "from": Path("a/b"),
        "background": None, "done": True, "nested": [{"pair": (1, 2.5)}],
    }  # fmt: skip
    write_package(replace(make_random_model(3), provenance=notes), tmp_path / "a.shift")
    assert read_model(tmp_path / "a.shift").provenance == {
        "loss": 0.5, "grid": [0, 1, 2], "psnr": None, "from": str(Path("a/b")),
        "background": None, "done": True, "nested": [{"pair": [1, 2.5]}],
    }  # fmt: skip


def test_the_documented_example_makes_a_package(tmp_path):
    text = (ROOT / "docs/package.md").read_text()
    example = re.search(r"```python\n(.*?)```", text, re.S)[1]
    subprocess.run([sys.executable, "-c", example], cwd=tmp_path, check=True)
    model = read_model(tmp_path)
    splats = evaluate(model, 0.5, np.ones(3))
    assert splats.means.shape == (4, 3) and (splats.scales > 0).all()
    assert model.stops[1].unit == "°C"


def test_onnx_models_pass_the_checker():
    for name, data in package_files(make_random_model(), "float16").items():
        if name.endswith(".onnx"):
            onnx.checker.check_model(onnx.load(io.BytesIO(data)))
