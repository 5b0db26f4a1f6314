"""headless: the sheet, its pictures and the result; what others wrote there stays."""

import json
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.app.commands import headless, touch_film
from shapeshift.app.document import Document
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.framing import default_view, frame_points, model_points
from tests.support.models import make_random_model, random_package
from tests.support.touch_scene import TOUCH

QUICK = ["--size", "48x32", "--frames", "2", "--sweep", "2"]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return random_package(tmp_path_factory.mktemp("scene"), 40)


def run(*arguments):
    return cli.main(["headless", *map(str, arguments)])


def pixels(path):
    return np.asarray(Image.open(path), int)


def test_pictures_sheet_and_result(scene, tmp_path, capsys):
    out = tmp_path / "a" / "b"
    assert run("--scene", scene, "--out", out, *QUICK) == 0
    told = capsys.readouterr()
    assert f"are in {out}" in told.err and "p95" in told.err and "PSNR" in told.err
    assert json.loads(told.out)["out"] == str(out)
    names = [[f"view{v}_x{x}.png" for x in ("0.000", "0.500", "1.000")] for v in range(3)]
    everything = {n for row in names for n in row} | {"sheet.png", "bench.json"}
    assert {p.name for p in out.iterdir()} == everything
    rows = [np.concatenate([pixels(out / n) for n in row], axis=1) for row in names]
    np.testing.assert_array_equal(pixels(out / "sheet.png"), np.concatenate(rows))
    result = json.loads((out / "bench.json").read_text())
    assert result["psnr_db"] > 50 and result["scene"] == "random.shift"
    assert result["command"].startswith("python3 launch.py")


def test_an_earlier_run_is_replaced_and_nothing_else(scene, tmp_path, capsys):
    assert run("--scene", scene, "--out", tmp_path, *QUICK) == 0
    (tmp_path / "notes.txt").write_text("mine")
    before = (tmp_path / "sheet.png").stat().st_mtime_ns
    assert run("--scene", scene, "--out", tmp_path, *QUICK) == 0
    assert (tmp_path / "sheet.png").stat().st_mtime_ns > before
    assert (tmp_path / "notes.txt").read_text() == "mine"
    for name, words in (("sheet.png", "not made by"), ("bench.json", "no bench result")):
        whole = (tmp_path / name).read_bytes()
        (tmp_path / name).write_text("mine")
        capsys.readouterr()
        assert run("--scene", scene, "--out", tmp_path, *QUICK) == 2
        told = capsys.readouterr().err.strip().splitlines()[-1]
        assert name in told and words in told
        assert (tmp_path / name).read_text() == "mine"
        (tmp_path / name).write_bytes(whole)


def test_the_main_job_plays_a_scene_of_things(scene, tmp_path, capsys, monkeypatch):
    """Its hands carry, shoot and throw; the picture shows four moments, the table what it costs."""
    monkeypatch.setattr(headless, "DEMO", scene)
    monkeypatch.setattr(touch_film, "STEPS", 6)
    monkeypatch.setattr(touch_film, "MOMENTS_S", (0.0, 1.6, 3.85, 6.0))
    monkeypatch.setattr(touch_film, "SCENE", TOUCH)
    monkeypatch.setattr(touch_film, "SCRIPT", TOUCH.with_name("touch.jsonl"))
    assert run("--scene", scene, "--out", tmp_path, *QUICK) == 0
    told = capsys.readouterr()
    assert "in motion" in told.err and "its physics" in told.err and "touch.png" in told.err
    touch = json.loads(told.out)["touch"]
    assert touch == json.loads((tmp_path / "bench.json").read_text())["touch"]
    assert (touch["objects"], touch["splats"], touch["reactions"]) == (5, 32_000, 6)
    assert 0 < touch["physics_ms"]["p50"] < touch["frame_ms"]["p50"]
    moments = np.split(pixels(tmp_path / "touch.png"), 4, axis=1)
    assert moments[0].shape == (32, 48, 3)
    for before, after in pairwise(moments):
        assert (np.abs(before - after).max(axis=2) > 25).sum() > 10
    (tmp_path / "touch.png").write_bytes(b"mine")
    assert run("--scene", scene, "--out", tmp_path, *QUICK) == 2
    assert "touch.png was not made by this program" in capsys.readouterr().err


def test_without_bodies_the_rest_of_the_job_goes_on(scene, tmp_path, capsys, monkeypatch):
    def refuse(*_):
        raise BadFile("object 'ring': 'collider': coacd is not here.")

    monkeypatch.setattr(headless, "DEMO", scene)
    monkeypatch.setattr(touch_film, "film", refuse)
    assert run("--scene", scene, "--out", tmp_path, *QUICK) == 0
    told = capsys.readouterr()
    assert "The demo in motion is left out: object 'ring'" in told.err
    assert json.loads(told.out)["touch"] is None and not (tmp_path / "touch.png").exists()


@pytest.mark.slow
def test_a_scene_file_as_it_says(tmp_path, capsys):
    assert run("--scene", touch_film.SCENE, "--out", tmp_path, *QUICK) == 0
    names = {"view0.png", "view1.png", "view2.png", "sheet.png", "bench.json"}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert json.loads((tmp_path / "bench.json").read_text())["objects"] == 3


def test_viewpoints_look_at_the_same_place_from_as_far(scene):
    model = make_random_model(200)
    first, left, right = headless.viewpoints(Document.of(model), (60, 40))
    wanted = default_view(model, (60, 40))
    np.testing.assert_array_equal(first.world_from_eye.matrix(), wanted.world_from_eye.matrix())
    assert {(v.tangents, v.near, v.far, v.size) for v in (first, left, right)} == {
        (wanted.tangents, wanted.near, wanted.far, wanted.size)
    }
    centre, _ = frame_points(*model_points(model))
    seen = [view.eye_from_world() @ (*centre, 1) for view in (first, left, right)]
    np.testing.assert_allclose(seen[1:], [seen[0]] * 2, atol=1e-9)
    eyes = np.array([v.world_from_eye.position for v in (first, left, right)])
    np.testing.assert_allclose(eyes[:, 1], eyes[0, 1])  # the same height
    a, b = (eyes[1] - centre)[[0, 2]], (eyes[2] - centre)[[0, 2]]
    angle = np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))
    assert angle == pytest.approx(2 * headless.TURN)
    for view in (left, right):  # upright: the eye's right stays level
        assert view.world_from_eye.matrix()[1, 0] == pytest.approx(0, abs=1e-12)


def test_a_missing_demo_says_how_to_make_it(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(headless, "DEMO", tmp_path / "workshop.shift")
    assert run("--scene", tmp_path / "workshop.shift", "--out", tmp_path / "out") == 2
    told = capsys.readouterr().err
    assert "workshop.shift is missing" in told and "launch.py demo" in told
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        (["--frames", "1"], "--frames is 1"),
        (["--sweep", "1"], "--sweep is 1"),
        (["--size", "0x1"], "--size is 0x1"),
        (["--scene", "none.ply"], "none.ply does not exist"),
    ],
)
def test_bad_options_are_one_sentence(scene, tmp_path, capsys, extra, words):
    assert run("--scene", scene, "--out", tmp_path / "out", *extra) == 2
    told = capsys.readouterr()
    assert words in told.err and told.out == "" and told.err.count("\n") == 1
    assert not (tmp_path / "out").exists()
