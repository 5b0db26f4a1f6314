"""launch.py style as a person starts it, on small scenes: what it writes, what it says, refuses."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from tests.support.new_stops import framed_model
from tests.support.splat_scenes import random_layers

EYE = np.array([0.3, 0.5, 2.0])


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("styles") / "scene.shift"
    write_package(framed_model(200), path)
    return path


def style(scene: Path, *words: object) -> int:
    return cli.main(["style", str(scene), "--no-pace", *map(str, words)])


def place(model, name: str) -> float:
    return next(stop.x for stop in model.stops if stop.name == name)


def assert_unmoved(before, after) -> None:
    for stop in before.stops:
        one, other = evaluate(before, stop.x, EYE), evaluate(after, place(after, stop.name), EYE)
        for field in ("means", "scales", "opacity", "color"):
            a, b = getattr(one, field), getattr(other, field)
            np.testing.assert_allclose(b, a, atol=2e-5 * max(1, np.abs(a).max()), err_msg=field)


def test_a_shape_goes_in_and_out_again(scene, tmp_path, capsys):
    out, sheet = tmp_path / "fur.shift", tmp_path / "sheet.png"
    assert style(scene, "--shape", "fur", "--after", "rgb", "--out", out, "--sheet", sheet) == 0
    said = capsys.readouterr().err
    decibels = [int(n) for n in re.findall(r"(\d+) dB", said)]
    assert len(decibels) == 3 and min(decibels) >= 90
    assert "Fur: new, from RGB" in said and "MOVED" not in said
    before, after = read_package(scene), read_package(out)
    assert [stop.name for stop in after.stops] == ["RGB", "Fur", "Thermal", "Opened"]
    assert_unmoved(before, after)
    assert after.provenance["styles"] == ["Fur"]
    with Image.open(sheet) as picture:
        assert picture.size == (4 * 384, 2 * 288)
    back = tmp_path / "back.shift"
    assert style(out, "--remove", "fur", "--out", back) == 0
    assert_unmoved(before, read_package(back))
    assert back.stat().st_size <= scene.stat().st_size + 16  # other numbers pack otherwise
    assert "styles" not in read_package(back).provenance


def test_the_same_seed_gives_the_same_bytes(scene, tmp_path):
    for name in ("one", "two"):
        assert style(scene, "--shape", "melt", "--out", tmp_path / f"{name}.shift") == 0
    assert (tmp_path / "one.shift").read_bytes() == (tmp_path / "two.shift").read_bytes()


@pytest.mark.parametrize("words", [
    ("--region", "label:pump"), ("--region", "sphere:0,0,0:0.5", "--keep", "label:1"),
    ("--keep", "half:0,0,0:1,0,0"), ("--region", "box:0.3,0,0:0.2,1,1", "label:pump"),
])  # fmt: skip
def test_a_region_alone_changes(scene, tmp_path, words):
    from shapeshift.app.training.style_options import anchors_inside

    assert style(scene, "--shape", "points", "--out", tmp_path / "a.shift", *words) == 0
    before, after = read_package(scene), read_package(tmp_path / "a.shift")
    asked: dict[str, tuple] = {"--region": (), "--keep": ()}
    for word in words:
        if word in asked:
            option = word
        else:
            asked[option] += (word,)
    inside = anchors_inside(before, asked["--region"], asked["--keep"])
    assert 0 < inside.sum() < 200
    one, other = evaluate(before, 0.0, EYE), evaluate(after, 1.0, EYE)
    rows = np.repeat(inside, 3)
    np.testing.assert_allclose(other.means[~rows], one.means[~rows], atol=1e-5)
    np.testing.assert_allclose(other.color[~rows], one.color[~rows], atol=1e-4)
    assert np.abs(other.scales - one.scales)[rows].mean() > 1e-4
    assert_unmoved(before, after)


def test_a_painted_region_is_read_from_a_scene_file(scene, tmp_path):
    from shapeshift.app.training.style_options import anchors_inside

    weights = [1] * 30 + [0] * 170
    row = f'{{"kind": "painted", "x": 0.5, "weight": {weights}}}'
    file = tmp_path / "painted.scene.json"
    file.write_text(
        f'{{"objects": [{{"name": "a", "model": "scene.shift", "selectors": [{row}]}}]}}'
    )
    inside = anchors_inside(read_package(scene), (f"painted:{file}",), ())
    np.testing.assert_array_equal(inside, np.array(weights, bool))


def test_pictures_of_any_program_colour_a_stop(scene, tmp_path, device, capsys):
    """Red pictures make a red stop; views and pictures meet by name, and by order."""
    from shapeshift.scene.cameras.camera_list import CameraList
    from shapeshift.scene.cameras.write_cameras import write_cameras
    from shapeshift.training.styles.train_stop import dome_views

    model = read_package(scene)
    names = ("left", "right", "above")
    views = tuple(dome_views(model, 3, (48, 36)))
    cameras = tmp_path / "cameras.json"
    write_cameras(CameraList(views, names, "ours"), cameras, "ours")
    folder = tmp_path / "painted"
    folder.mkdir()
    for name in names:
        Image.new("RGB", (48, 36), (250, 10, 10)).save(folder / f"{name}.png")
    out = tmp_path / "red.shift"
    words = ("--pictures", folder, "--cameras", cameras, "--name", "Red", "--steps", 30)
    assert style(scene, *words, "--out", out) == 0
    after = read_package(out)
    assert_unmoved(model, after)
    red, before = (evaluate(m, x, EYE).color for m, x in ((after, 1.0), (model, 0.0)))
    assert (red[:, 0] - red[:, 1]).mean() > (before[:, 0] - before[:, 1]).mean() + 0.2
    (folder / "above.png").unlink()
    assert style(scene, *words, "--out", tmp_path / "b.shift") == 2
    assert "holds 2 pictures for 3 cameras; there is none for 'above'" in capsys.readouterr().err


REFUSED = {
    "nothing asked": ((), "a new stop needs one of --shape, --network, --pictures"),
    "an unknown stop": (("--shape", "fur", "--from", "X"), "--from is 'X'; the stops are RGB"),
    "after an unknown stop": (("--shape", "fur", "--after", "X"), "--after is 'X'"),
    "a name that is taken": (("--shape", "fur", "--name", "rgb"), "a stop 'rgb' already"),
    "too strong": (("--shape", "fur", "--strength", "1.1"), "--strength is 1.1"),
    "no number": (("--shape", "fur", "--strength", "nan"), "--strength is nan"),
    "no steps": (("--shape", "fur", "--steps", "0"), "--steps is 0"),
    "an empty region": (
        ("--shape", "fur", "--region", "sphere:9,9,9:0.1"), "holds no anchor of the scene"),
    "nothing left": (("--shape", "fur", "--keep", "sphere:0,0,0:9"), "leave no anchor"),
    "an unknown region": (("--shape", "fur", "--region", "cone:1"), "begins with 'cone'"),
    "an unknown object": (("--shape", "fur", "--region", "label:mug"), "nothing of the scene is"),
    "no such network": (("--network", "none.onnx"), "is no file"),
    "weights alone": (("--shape", "fur", "--weights", "3"), "add --network"),
    "pictures alone": (("--pictures", "."), "--pictures needs --cameras"),
    "both": (("--network", "a", "--pictures", "b"), "both paint the stop"),
    "a picture alone": (("--shape", "fur", "--image", "a.png"), "--image needs --vgg"),
    "in and out": (("--shape", "fur", "--remove", "RGB"), "--remove takes a stop out"),
    "out of an unknown": (("--remove", "X"), "no stop 'X'; it has RGB, Thermal, Opened"),
    "many views": (("--shape", "fur", "--views", "501"), "--views is 501"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_is_refused_in_a_sentence(scene, tmp_path, capsys, name):
    words, wanted = REFUSED[name]
    assert style(scene, *words, "--out", tmp_path / "out.shift") == 2
    said = capsys.readouterr().err
    assert wanted in said and said.count("\n") == 1 and "Traceback" not in said
    assert not list(tmp_path.iterdir())


def test_the_scene_itself_and_other_files_are_not_replaced(scene, tmp_path, capsys):
    assert style(scene, "--shape", "fur", "--out", scene, "--overwrite") == 2
    assert "is the scene that is read" in capsys.readouterr().err
    there = tmp_path / "there.shift"
    there.write_bytes(b"mine")
    assert style(scene, "--shape", "fur", "--out", there) == 2
    assert style(scene, "--shape", "fur", "--out", there, "--overwrite") == 2
    assert there.read_bytes() == b"mine"


def test_plain_splats_are_told_to_be_trained(tmp_path, capsys):
    cloud = random_layers(20)
    columns = (cloud.means, cloud.scales, cloud.wxyz, cloud.opacity, cloud.sh)
    write_ply(PlainSplats(*columns), tmp_path / "a.ply")
    assert style(tmp_path / "a.ply", "--shape", "fur", "--out", tmp_path / "out.shift") == 2
    assert "plain splats without networks" in capsys.readouterr().err


def test_ctrl_c_leaves_nothing(scene, tmp_path, monkeypatch, capsys):
    import shapeshift.training.styles.add_style as work

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(work, "with_rule", interrupted)
    assert style(scene, "--shape", "fur", "--out", tmp_path / "out.shift") == 130
    assert "nothing was written" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_bytes_of_features_stay_bytes(tmp_path):
    model = replace(framed_model(200), frames=None)
    write_package(model, tmp_path / "a.shift", "uint8")
    assert style(tmp_path / "a.shift", "--shape", "points", "--out", tmp_path / "b.shift") == 0
    assert_unmoved(read_package(tmp_path / "a.shift"), read_package(tmp_path / "b.shift"))
