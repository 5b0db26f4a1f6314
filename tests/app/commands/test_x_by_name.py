"""x by a stop's name, in every command that has one: the same words, the same refusal."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.app.document import Document, control_of_text
from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from tests.support.models import make_random_model
from tests.support.splats.gltf_files import plain_splats

STOPS = (Stop("RGB", 0.0), Stop("Thermal", 0.4, "thermal"), Stop("Opened", 1.0))
TINY = ("--size", "24x16")
REFUSAL = "'Thermic' is no x of this scene; expected a number from 0 to 1, a stop (RGB, Thermal)"


@pytest.fixture(scope="module")
def package(tmp_path_factory) -> Path:
    """Stops RGB at 0 and Thermal at 1."""
    path = tmp_path_factory.mktemp("package") / "random.shift"
    write_package(make_random_model(60), path)
    return path


@pytest.fixture(scope="module")
def objects(tmp_path_factory) -> Path:
    """A scene file: layers cold and hot with a state "warm", beside a cloud with a stop alone."""
    folder = tmp_path_factory.mktemp("objects")
    (folder / "layers").mkdir()
    for i, name in enumerate(("cold", "hot")):
        write_ply(plain_splats(60, 1, seed=5 + i), folder / "layers" / f"{name}.ply")
    write_ply(plain_splats(60), folder / "cloud.ply")
    layered = {"name": "cube", "model": "layers", "mode": "exclusive"}
    items = [layered | {"states": [{"name": "warm", "x": 0.5}]},
             {"name": "cloud", "model": "cloud.ply"}]  # fmt: skip
    path = folder / "two.scene.json"
    path.write_text(json.dumps({"objects": items}))
    return path


def run(*words) -> int:
    return cli.main([str(word) for word in words])


@pytest.mark.parametrize(
    ("text", "x"),
    [("Thermal", 0.4), ("thermal", 0.4), (" OPENED ", 1.0), ("0.5", 0.5), ("0", 0.0), ("1", 1.0),
     ("1e-3", 0.001), ("RGB..Thermal:0.5", 0.2), ("-0.0", 0.0)],
)  # fmt: skip
def test_texts(text, x):
    assert control_of_text(text, STOPS) == pytest.approx(x, abs=1e-12)


def test_any_two_stops_make_a_blend():
    assert control_of_text("RGB..Opened:0.25", STOPS).parts == (("RGB", 0.75), ("Opened", 0.25))
    assert control_of_text("rgb:1, OPENED:3", STOPS).parts == (("RGB", 0.25), ("Opened", 0.75))


def test_stops_that_differ_in_case_alone_are_told_apart():
    stops = (Stop("heat", 0.1), Stop("Heat", 0.6), Stop("photo", 1.0))
    assert control_of_text("heat", stops) == 0.1 and control_of_text("Heat", stops) == 0.6
    assert control_of_text("PHOTO", stops) == 1.0
    with pytest.raises(UsageError, match=r"--x: 'HEAT' may be .*eat or .*eat; spell it as it is"):
        control_of_text("HEAT", stops)
    ring = (Stop("normal", 0.0), Stop("ice", 0.5), Stop("normal", 1.0))
    assert control_of_text("normal", ring) == 0.0 and control_of_text("NORMAL", ring) == 0.0


def test_a_stop_that_is_named_as_a_number_is_meant_by_it():
    years = (Stop("2024", 0.0), Stop("1", 0.5), Stop("2026", 1.0))
    assert [control_of_text(text, years) for text in ("2024", "1", "2026", "0.25")] == [
        0,
        0.5,
        1,
        0.25,
    ]


@pytest.mark.parametrize("text", ["", "nan", "inf", "-0.1", "1.0001", "2", "Bone", "sweep:3"])
def test_what_is_none_names_the_stops(text):
    with pytest.raises(UsageError, match=r"--x: '.*a stop \(RGB, Thermal, Opened\) or a way such"):
        control_of_text(text, STOPS)
    with pytest.raises(UsageError, match=r"a stop \(it has none\)\."):
        control_of_text(text, ())


def test_a_slip_is_put_right_in_the_refusal():
    with pytest.raises(UsageError, match=r"did you mean Opened\?$"):
        control_of_text("opnd", STOPS)


def test_render_takes_lists_of_all_kinds(package, tmp_path):
    words = ("--x", "thermal", "0.25", "sweep:3", "RGB")
    assert run("render", package, "--out", tmp_path, *words, *TINY) == 0
    xs = ("1.000", "0.250", "0.000", "0.500", "1.000", "0.000")
    names = [f"{i:04d}_x{x}.png" for i, x in enumerate(xs)]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    thermal, _, first, _, last, rgb = (np.asarray(Image.open(tmp_path / n)) for n in names)
    assert (thermal == last).all() and (rgb == first).all() and (rgb != thermal).any()


def test_objects_that_have_the_stop_go_there_and_the_others_stay(objects, tmp_path):
    assert run("render", objects, "--out", tmp_path, "--x", "hot", "Warm", "0.5", *TINY) == 0
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["0000_hot.png", "0001_Warm.png", "0002_x0.500.png"]
    hot, warm, half = (np.asarray(Image.open(tmp_path / n)) for n in names)
    assert (hot != warm).any() and (warm == half).all()  # a cloud looks the same at every x


def test_every_command_puts_the_same_x(package, objects, tmp_path, monkeypatch):
    """Names and the numbers that they stand for give the same results."""
    seen = []
    of = Document.placed
    monkeypatch.setattr(Document, "placed", lambda *a: seen.append(of(*a).x) or of(*a))
    frames = ("--frames", "2", "--sweep", "2", "--quality-size", "8x8", "--drawing", "tiles")
    assert run("bench", package, "--x", "Thermal", *frames, *TINY) == 0
    quick = ("--quick", "--frames", "2", "--drawing", "tiles", "--context", "none")
    assert run("chart", package, "--x", "thermal", "--out", tmp_path / "c", *quick, *TINY) == 0
    assert run("compare", f"{package}@Thermal", f"{package}@RGB", *TINY) == 0
    assert seen == [1.0, 1.0, 1.0, 0.0]
    for text in ("Thermal", "1"):
        assert run("export", package, "--x", text, "--out", tmp_path / f"{text}.ply") == 0
    assert (tmp_path / "Thermal.ply").read_bytes() == (tmp_path / "1.ply").read_bytes()
    assert run("simulate", objects, "--x", "warm", "--seconds", "0.1", "--out", tmp_path) == 0
    first = json.loads((tmp_path / "run.jsonl").read_text().splitlines()[1])
    assert first["x"] == {"cube": 0.5, "cloud": 0.0}


@pytest.mark.parametrize(
    "words",
    [("render", "--out", "OUT", "--x"), ("bench", "--x"), ("chart", "--out", "OUT", "--x"),
     ("export", "--out", "OUT.ply", "--x"), ("compare", "@"), ("view", "--x"), ("vr", "--x")],
    ids=lambda words: words[0],
)  # fmt: skip
def test_every_command_refuses_in_the_same_words(package, tmp_path, capsys, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    command, *options = (word.replace("OUT", str(tmp_path / "out")) for word in words)
    if command == "compare":
        done = run(command, f"{package}@Thermic", package)
    elif command == "vr":
        from shapeshift.app.headset.scene_shelf import open_xr
        from shapeshift.app.opening import ReadingOptions

        with pytest.raises(UsageError, match=r"'Thermic' is no x of this scene"):
            open_xr(package, ReadingOptions(), "Thermic")
        return
    else:
        done = run(command, package, *options, "Thermic")
    told = capsys.readouterr().err
    assert done == 2 and REFUSAL in told and "did you mean Thermal?" in told, told
    assert not list(tmp_path.iterdir())


def test_the_viewer_and_the_headset_start_there(package, objects):
    from shapeshift.app.editor.state.files.open_scene import opened_scene
    from shapeshift.app.editor.state.files.opened import read_files
    from shapeshift.app.headset.scene_shelf import open_xr
    from shapeshift.app.opening import ReadingOptions
    from shapeshift.runtime_models.read_scene import read_model
    from shapeshift.scene.cameras.camera_list import CameraReading

    def shown(*paths: Path, x: str) -> dict[str, float]:
        found = read_files(paths, lambda path, told: read_model(path), CameraReading(), None)
        scene, edited = opened_scene(found, x)
        xs = {obj.name: obj.x for obj in scene.objects}
        assert {item.name: item.x for item in edited.file.all_items} == xs
        assert not edited.history.undoes
        return xs

    cloud = objects.parent / "cloud.ply"
    assert shown(package, cloud, x="Thermal") == {"random": 1.0, "cloud": 0.0}
    assert shown(objects, x="warm") == {"cube": 0.5, "cloud": 0.0}
    assert shown(objects, x="0.25") == {"cube": 0.25, "cloud": 0.25}
    for path, x in ((package, {"random": 1.0}), (objects, {"cube": 1.0, "cloud": 0.0})):
        text = "Thermal" if path == package else "hot"
        _, editor = open_xr(path, ReadingOptions(), text)
        assert {obj.name: obj.x for obj in editor.world.drawn().objects} == x
        assert {obj.name: obj.x for obj in editor.scene.objects} == x
