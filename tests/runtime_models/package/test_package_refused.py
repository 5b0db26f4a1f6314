"""Packages that cannot be used: for each way to break one, one sentence with what was found."""

import io
import json
import zipfile

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.package.package_files import ANCHORS, LARGEST, MANIFEST
from shapeshift.runtime_models.package.read_package import read_anchors
from shapeshift.runtime_models.package.write_package import package_files, write_package
from shapeshift.runtime_models.read_scene import read_model
from tests.support.models import make_random_model

FILES = package_files(make_random_model(), "float32")


@pytest.fixture
def folder(tmp_path):
    """A sound package, to be broken."""
    (tmp_path / "scene").mkdir()
    for name, data in FILES.items():
        (tmp_path / "scene" / name).write_bytes(data)
    return tmp_path / "scene"


def refused(path) -> str:
    with pytest.raises(BadFile) as failure:
        read_model(path)
    message = str(failure.value)
    assert "\n" not in message and len(message) < 400, message
    return message


def edit(**entries):
    """Replace entries of the manifest; None takes one out."""

    def change(folder):
        manifest = json.loads((folder / MANIFEST).read_text()) | entries
        manifest = {key: value for key, value in manifest.items() if value is not None}
        (folder / MANIFEST).write_text(json.dumps(manifest))

    return change


def head(name, **entries):
    def change(folder):
        heads = json.loads((folder / MANIFEST).read_text())["heads"]
        heads[name] = {k: v for k, v in (heads[name] | entries).items() if v is not None}
        edit(heads=heads)(folder)

    return change


def arrays(**entries):
    def change(folder):
        old = dict(np.load(folder / ANCHORS))
        np.savez(folder / ANCHORS, **(old | entries))

    return change


def write(name, data):
    return lambda folder: (folder / name).write_bytes(data)


def ones(rows, columns, kind="f4"):
    return np.ones((rows, columns), kind)


def one_nan():
    positions = ones(100, 3)
    positions[7, 1] = np.nan
    return positions


def nan_weights(folder):
    model = make_random_model()
    model.networks["offset"].weights[0][0, 0] = np.nan
    (folder / "offset.onnx").write_bytes(package_files(model, "float32")["offset.onnx"])


def lying_header(folder):
    """positions.npy says that it has 10^11 rows."""
    with zipfile.ZipFile(io.BytesIO(FILES[ANCHORS])) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    lie = members["positions.npy"].replace(b"(100, 3), } ", b"(99999999999, 3), } ", 1)
    members["positions.npy"] = lie.replace(b" " * 20, b" " * 12, 1)
    with zipfile.ZipFile(folder / ANCHORS, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)


def no_npy(folder):
    with zipfile.ZipFile(folder / ANCHORS, "w") as archive:
        archive.writestr("positions.npy", b"not an array")
        archive.writestr("features.npy", b"not an array")


ROW = {"name": "a", "x": 0.0, "kind": "rgb"}
PACE = {"from": "RGB", "to": "Thermal", "blend": [0, 0.25, 1]}
LOOK = {"eye": [0, 0, 1], "target": [0, 0, 0]}


def stops(*rows):
    return edit(stops=[ROW | row for row in rows])


def pace(**entries):
    return edit(pace=[PACE | entries])


LONG = {"file": "x" * 90, "inputs": ["feature", "direction", "control"], "activation": "tanh"}
NESTED = {name: LONG | {"heads": [LONG] * 9} for name in ("color", "offset", "opacity", "scale")}
BROKEN = {
    # files
    "missing ONNX": (lambda f: (f / "color.onnx").unlink(), "lacks color.onnx; a package is"),
    "missing anchors": (lambda f: (f / ANCHORS).unlink(), "lacks anchors.npz"),
    "no ONNX at all": (write("color.onnx", b"no graph"), "color.onnx is not a readable ONNX"),
    "empty ONNX": (write("color.onnx", b""), "color.onnx has 0 inputs and 0 outputs"),
    "path out of the package": (head("offset", file="../offset.onnx"), 'is "../offset.onnx"; the'),
    "path of Windows": (head("offset", file="..\\offset.onnx"), "name of a .onnx in the package"),
    "file of another kind": (head("offset", file="scene.json"), "name of a .onnx in the package"),
    # manifest
    "unknown version": (edit(format="shapeshift 9"),
                        "format \"shapeshift 9\", this program reads 'shapeshift 1', "),
    "no version": (edit(format=None), "has format null"),
    "not JSON": (write(MANIFEST, b"{"), "scene/scene.json is not JSON"),
    "not text": (write(MANIFEST, b"\xff\xfe\xfa"), "is not JSON"),
    "endless nesting": (write(MANIFEST, b"[" * 100_000), "is not JSON"),
    "JSON of another kind": (write(MANIFEST, b"[1]"), "scene/scene.json is [1]; one object"),
    "another up axis": (edit(up="-Z"), "up axis \"-Z\", expected '+Y'; turn the scene"),
    "no up axis": (edit(up=None), "'up' is missing; docs/package.md lists"),
    "unknown between": (edit(between_stops="steps"), "'between_stops' is \"steps\"; 'blend' or"),
    "pace of another kind": (edit(pace={}), "'pace' is {}; a list of objects"),
    "pace row of another kind": (edit(pace=[1]), "'pace' is [1]; a list of objects"),
    "pace without a curve": (pace(blend=None), "pace 0: 'blend' is null; a list of 2 to 257"),
    "pace of a word": (pace(blend=[0, "a"]), "'blend' is [0, \"a\"]; a list of 2 to 257"),
    "pace of one number": (pace(blend=[0]), "'blend' is [0]; a list of 2 to 257"),
    "pace too long": (pace(blend=[i / 257 for i in range(258)]), "is a list of 258; a list of 2"),
    "pace that stands": (pace(blend=[0, 0.5, 0.5, 1]), "does not rise from 0 to 1"),
    "pace that falls": (pace(blend=[0, 0.6, 0.5, 1]), "does not rise from 0 to 1"),
    "pace of half a way": (pace(blend=[0, 0.5]), "does not rise from 0 to 1"),
    "pace from nowhere": (pace(to="Bone"), "is from \"RGB\" to \"Bone\", expected two stops"),
    "pace to itself": (pace(to="RGB"), "is from \"RGB\" to \"RGB\", expected two stops"),
    "pace twice": (edit(pace=[PACE, PACE | {"from": "Thermal", "to": "RGB"}]),
                   'pace 1 is from "Thermal" to "RGB", expected two stops of the scene, each pair'),
    "no k": (edit(splats_per_anchor=None), "'splats_per_anchor' is missing"),
    "k of zero": (edit(splats_per_anchor=0), "'splats_per_anchor' is 0; a whole number"),
    "k of true": (edit(splats_per_anchor=True), "'splats_per_anchor' is true"),
    "k of a half": (edit(splats_per_anchor=0.5), "'splats_per_anchor' is 0.5"),
    "no width": (edit(feature_width=None), "'feature_width' is missing"),
    "huge width": (edit(feature_width=10**400), "beyond measure; a whole number from 1 to 4,096"),
    "no encoding": (edit(encoding=None), "'encoding' is missing"),
    "encoding of another kind": (edit(encoding=[16]), "'encoding' is [16]; an object"),
    "no d": (edit(encoding={"sigma": 1, "spacing": 1}), "'encoding': 'd' is missing"),
    "no spacing": (edit(encoding={"d": 16, "sigma": 1}), "'encoding': 'spacing' is missing"),
    "sigma of zero": (edit(encoding={"d": 16, "sigma": 0, "spacing": 0.1}), "must be above 0"),
    "sigma of text": (edit(encoding={"d": 16, "sigma": "1", "spacing": 1}), "'sigma' is \"1\""),
    "huge spacing": (edit(encoding={"d": 16, "sigma": 1, "spacing": 10**400}), "a finite number"),
    "another d": (edit(encoding={"d": 15, "sigma": 1, "spacing": 1}),
                  "offset.onnx maps 32 to 15 values, the manifest asks for 31 (feature + control)"),
    "notes of another kind": (edit(provenance=["me"]), "'provenance' is [\"me\"]; one obj"),
    "view of another kind": (edit(provenance={"view": 3}), "'view' is 3; an object"),
    "view from nowhere": (edit(provenance={"view": LOOK | {"eye": [0, 1]}}), "a list of 3 finite"),
    "view of itself": (edit(provenance={"view": LOOK | {"eye": [0, 0, 0]}}), "are one point"),
    "view of no width": (edit(provenance={"view": LOOK | {"fov_y": 0}}), "'fov_y' is 0; an angle"),
    "eyes of another kind": (edit(provenance={"eyes": 3}), "'eyes' is 3; a list of at most 64"),
    "eyes in braces": (edit(provenance={"eyes": {"a": 1}}), "a list of at most 64 places"),
    "an eye of a plane": (edit(provenance={"eyes": [[0, 1]]}), "places of three finite numbers"),
    "an eye of a word": (edit(provenance={"eyes": [[0, 1, "2"]]}), "three finite numbers"),
    "an eye of NaN": (edit(provenance={"eyes": [[0, 1, float("nan")]]}), "three finite numbers"),
    "an eye too far": (edit(provenance={"eyes": [[0, 1, 2e30]]}), "finite numbers up to 1e+30"),
    "looks of another kind": (edit(provenance={"looks": 3}), "'looks' is 3; a list with, beside"),
    "a look without a lens": (edit(provenance={"looks": [[1, 0, 0, 0]]}), "tangents left < right"),
    "a look turned in": (edit(provenance={"looks": [[1, 0, 0, 0, 1, -1, -1, 1]]}), "left <"),
    "a look of no turn": (edit(provenance={"looks": [[0, 0, 0, 0, -1, 1, -1, 1]]}), "unit quat"),
    "a look of NaN": (edit(provenance={"looks": [[1, 0, 0, 0, -1, 1, -1, float("nan")]]}), "unit"),
    "a look too wide": (edit(provenance={"looks": [[1, 0, 0, 0, -1, 10**400, -1, 1]]}), "unit"),
    "too many eyes": (edit(provenance={"eyes": [[0, 1, 2]] * 65}), "a list of at most 64 places"),
    # heads
    "no heads": (edit(heads={}), "'heads': 'offset' is missing"),
    "no file": (head("scale", file=None), "'scale': 'file' is missing"),
    "no inputs": (head("scale", inputs=None), "'scale': 'inputs' is missing"),
    "no activation": (head("scale", activation=None), "'scale': 'activation' is missing"),
    "another activation": (head("scale", activation="tanh"),
                           "ends in the activation 'exp', the manifest says 'tanh'"),
    "unknown activation": (head("scale", activation="gelu"), "'activation' is \"gelu\""),
    "unknown input": (head("scale", inputs=["time"]), "'inputs' is [\"time\"]"),
    "input of another kind": (head("scale", inputs=[["feature"]]), "'inputs' is a list of 1"),
    "inputs of a whole manifest": (head("scale", inputs=NESTED), "'inputs' is an object"),
    "input twice": (head("scale", inputs=["control", "control"]), "each once"),
    "geometry that sees the eye": (head("opacity", inputs=["feature", "control", "direction"]),
                                   "some of feature, control, each once"),
    "colour that sees no eye": (head("color", inputs=["feature", "control"]),
                                "color.onnx maps 35 to 15 values, the manifest asks for 32"),
    "another head's file": (head("scale", file="opacity.onnx"),
                            "opacity.onnx maps 32 to 5 values, the manifest asks for 32 (feature "
                            "+ control) to 15 (k = 5)"),
    "wrong k": (edit(splats_per_anchor=4), "offset.onnx maps 32 to 15 values"),
    "NaN weights": (nan_weights, "offset.onnx: layer 0 has weights that are NaN or Inf"),
    # stops
    "no stops": (edit(stops=[]), "at least one stop"),
    "stops of another kind": (edit(stops={"a": 0}), "a list of objects in braces"),
    "stop of another kind": (edit(stops=[0.5]), "'stops' is [0.5]; a list of objects"),
    "stop without a name": (edit(stops=[{"x": 0.0, "kind": "rgb"}]), "stop 0: 'name' is missing"),
    "stop without x": (edit(stops=[{"name": "a", "kind": "rgb"}]), "stop 0: 'x' is missing"),
    "stop without a kind": (edit(stops=[{"name": "a", "x": 0}]), "stop 0: 'kind' is missing"),
    "stop outside": (stops({"x": 1.5}), "'x' is 1.5; 0 to 1"),
    "stop of NaN": (stops({"x": float("nan")}), "'x' is NaN; 0 to 1"),
    "stop of true": (stops({"x": True}), "'x' is true"),
    "falling stops": (stops({"x": 1.0}, {"name": "b"}), "must rise, they are [1.0, 0.0]"),
    "stops in one place": (stops({}, {"name": "b"}), "must rise"),
    "two of one name": (stops({}, {"x": 1}), "two stops have one name in [\"a\", \"a\"]"),
    "unknown kind": (stops({"kind": "sonar"}), "'kind' is \"sonar\"; 'rgb' or"),
    "bad range": (stops({"value_range": [1]}), "'value_range' is [1]; a list of 2"),
    "turned range": (stops({"value_range": [9, 1], "unit": "m"}), "is [9, 1]; [low, high]"),
    "palette of another kind": (stops({"palette": 3}), "'palette' is 3; a text"),
    # anchors
    "NaN anchors": (arrays(positions=one_nan()),
                    "positions has NaN or Inf in 1 of 100 rows, first in row 7"),
    "infinite features": (arrays(features=ones(100, 16) * np.inf), "has NaN or Inf in 100"),
    "cut off npz": (write(ANCHORS, FILES[ANCHORS][:-200]), "npz is no zip, or it is cut off"),
    "half an npz": (write(ANCHORS, FILES[ANCHORS][: len(FILES[ANCHORS]) // 2]), "cut off"),
    "damaged npz": (write(ANCHORS, FILES[ANCHORS][:200] + b"\0" * 99 + FILES[ANCHORS][299:]),
                    "cannot be unpacked; copy or export it again"),
    "pickled arrays": (arrays(positions=np.array([{"a": 1}], object)), "holds object; plain"),
    "lying size": (lying_header, "states the shape (99999999999, 3), but 1,200"),
    "no arrays": (no_npy, "anchors.npz"),
    "one array": (lambda f: np.savez(f / ANCHORS, positions=ones(1, 3)), "the array 'features'"),
    "features of other length": (arrays(features=ones(3, 16)), "100 positions but 3 features"),
    "no anchors": (arrays(positions=ones(0, 3), features=ones(0, 16)), "holds no anchors"),
    "flat anchors": (arrays(positions=np.ones(300, "f4")), "positions has shape (300,)"),
    "other feature width": (arrays(features=ones(100, 3)),
                            "features has shape (100, 3), expected (A, 16)"),
    "integer anchors": (arrays(positions=ones(100, 3, "i4")), "positions is int32"),
    "half anchors": (arrays(positions=ones(100, 3, "f2")), "positions is float16"),
    "text": (arrays(features=ones(100, 16).astype("U3")), "features holds <U3; plain numbers"),
}  # fmt: skip


@pytest.mark.parametrize("how", BROKEN)
def test_broken_packages_are_one_sentence(folder, how):
    break_it, words = BROKEN[how]
    break_it(folder)
    said = refused(folder)
    assert words in said
    assert len(said.replace(str(folder), "")) < 400  # letters that fit a window and a line of a log


@pytest.mark.parametrize("name", [MANIFEST, ANCHORS, "color.onnx"])
def test_files_over_the_limit_are_not_read(folder, monkeypatch, name):
    monkeypatch.setitem(LARGEST, name, 100)
    assert f"{name} has " in refused(folder) and "at most 100 are read" in refused(folder)


def make_zip(path, files, top=""):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(top + name, data)
    return path


def test_damaged_array_headers_are_one_sentence(folder):
    """The zip is sound, the 128 bytes in front of the numbers are not."""
    with zipfile.ZipFile(io.BytesIO(FILES[ANCHORS])) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    rng = np.random.default_rng(0)
    for _ in range(200):
        header = bytearray(members["positions.npy"])
        for at in rng.integers(0, 128, 2):
            header[at] = rng.integers(0, 256)
        make_zip(folder / ANCHORS, members | {"positions.npy": bytes(header)})
        try:
            read_anchors((folder / ANCHORS).read_bytes(), 16, "anchors.npz")
        except BadFile as failure:
            assert "\n" not in str(failure)


def test_a_bomb_is_refused_by_its_stated_size(tmp_path):
    """17 MB of blanks in 16 kB, and an npz of 5 GB of zeros that says so."""
    path = make_zip(tmp_path / "a.shift", FILES | {MANIFEST: b" " * (17 << 20)})
    assert path.stat().st_size < 100_000
    assert "scene.json has 17,825,792 bytes, at most 16,777,216 are read" in refused(path)


def test_a_size_stated_too_small_is_noticed(tmp_path):
    """The directory of the zip says 10 bytes for a manifest of more."""
    path = make_zip(tmp_path / "a.shift", FILES)
    data = path.read_bytes()
    size = len(FILES[MANIFEST]).to_bytes(4, "little")
    assert data.count(size) == 2  # in front of the file and in the directory
    path.write_bytes(data.replace(size, (10).to_bytes(4, "little")))
    assert "'scene.json' cannot be unpacked" in refused(path)


def test_a_folder_zipped_with_its_name_opens(tmp_path):
    path = make_zip(tmp_path / "a.shift", FILES, "scene/")
    assert read_model(path).splat_count == 500
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("other/scene.json", b"{}")  # which of the two is meant?
    assert "lacks scene.json" in refused(path)


def test_names_out_of_the_zip_are_never_followed(tmp_path):
    files = {f"../{name}": data for name, data in FILES.items()}
    assert "lacks" in refused(make_zip(tmp_path / "a.shift", {"x": b""} | files, "/"))
    assert [p.name for p in tmp_path.iterdir()] == ["a.shift"]


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_a_file_twice_is_refused(tmp_path):
    path = make_zip(tmp_path / "a.shift", FILES)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(MANIFEST, FILES[MANIFEST])
    assert "holds scene.json 2 times" in refused(path)


@pytest.mark.parametrize("keep", [0, 4, 10, 500, -1, -30, -400])
def test_cut_off_zips_are_one_sentence(tmp_path, keep):
    data = make_zip(tmp_path / "a.shift", FILES).read_bytes()
    (tmp_path / "a.shift").write_bytes(data[:keep])
    refused(tmp_path / "a.shift")


@pytest.mark.parametrize("where", ["anywhere", "in the directory"])
def test_damaged_zips_are_one_sentence_or_a_sound_model(tmp_path, where):
    write_package(make_random_model(), tmp_path / "a.shift")
    data = (tmp_path / "a.shift").read_bytes()
    first = data.index(b"PK\x01\x02") if where == "in the directory" else 0
    rng, count = np.random.default_rng(0), 0
    for _ in range(150):
        broken = bytearray(data)
        for at in rng.integers(first, len(data), 3):
            broken[at] = rng.integers(0, 256)
        (tmp_path / "a.shift").write_bytes(broken)
        try:
            read_model(tmp_path / "a.shift")
        except BadFile as failure:
            count += 1
            assert "\n" not in str(failure)
    assert count > 60  # the rest hit bytes that nothing depends on: dates, rights, comments
