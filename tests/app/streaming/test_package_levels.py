"""lod of a package: a folder that opens as the package does, refusals, nothing lost."""

import json
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app import cli
from shapeshift.app.streaming import package_levels
from shapeshift.app.streaming.level_errors import LevelErrors, LevelMeter, change_of, psnr_of
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.read_scene import read_model
from tests.support.models import random_package
from tests.support.splats.ply_files import some_splats


@pytest.fixture
def clumps(tmp_path):
    """30 clumps, each of an anchor that shows and three that do not: 30 anchors look the same."""
    model = read_package(random_package(tmp_path, 30))
    rng = np.random.default_rng(4)
    anchors = np.repeat(model.anchors, 4, axis=0)
    anchors += rng.normal(0, 1e-4, anchors.shape).astype(np.float32)
    features = rng.normal(size=(120, 16)).astype(np.float32)
    features[:, 0] = np.where(np.arange(120) % 4, -10, 0)
    opacity = model.networks["opacity"]
    first, last = (weights.copy() for weights in opacity.weights)
    first[0], last[:, 0] = 0, -1  # a hidden unit of 10 where the first feature is -10
    first[0, 0] = -1
    biases = (opacity.biases[0] * (np.arange(32) > 0), opacity.biases[1])
    absent = replace(opacity, weights=(first, last), biases=biases)
    networks = model.networks | {"opacity": absent}
    model = replace(model, anchors=anchors, features=features, networks=networks)
    write_package(model, tmp_path / "clumps.shift")
    return tmp_path / "clumps.shift"


@pytest.mark.parametrize("form", ["file", pytest.param("folder", marks=pytest.mark.slow)])
def test_a_package_gets_levels(clumps, tmp_path, capsys, form):
    source = clumps
    if form == "folder":
        source = tmp_path / "folder"
        write_package(read_package(clumps), source)
    out = tmp_path / "it.lod"
    words = ["lod", str(source), "--out", str(out), "--distill"]
    four_times = "2"  # as long as it takes
    assert cli.main([*words, four_times]) == 0
    said = capsys.readouterr().err
    assert "dB at stops" in said and "s of processor time" in said
    model = read_model(out)
    (level,) = model.coarser  # a second one would have fewer anchors than are worth a table
    assert len(level.anchors) == 30 and level.error_db["stops"] >= 40
    np.testing.assert_array_equal(model.features, read_package(source).features)
    if form == "file":
        assert (out / "scene.shift").read_bytes() == clumps.read_bytes()
    assert cli.main([*words, "0"]) == 2 and "--overwrite replaces it" in capsys.readouterr().err
    assert cli.main([*words, "0", "--overwrite"]) == 0 and read_model(out).coarser
    for command in (["info", str(out)], ["lint", str(out), "--json"]):
        assert cli.main(command) == 0
    assert "pixels" in capsys.readouterr().out
    assert cli.main(["export", str(out), "--out", str(tmp_path / "back.shift"), "--no-pace"]) == 0
    assert not read_model(tmp_path / "back.shift").coarser  # the package itself
    assert "Coarser levels stay behind" in capsys.readouterr().err
    assert cli.main(["export", str(out), "--out", str(tmp_path / "b.lod")]) == 2
    assert "launch.py lod`" in capsys.readouterr().err
    again = ["lod", str(out), "--out", str(tmp_path / "b.lod")]
    assert cli.main(again) == 2 and "has levels already" in capsys.readouterr().err


def test_a_scene_file_names_it(clumps, tmp_path):
    assert cli.main(["lod", str(clumps), "--out", str(tmp_path / "a.lod"), "--distill", "0"]) == 0
    objects = [
        {"name": f"o{n}", "model": "a.lod", "pose": {"position": [0, 0, -20.0 * n]}}
        for n in range(2)
    ]
    scene = tmp_path / "two.scene.json"
    scene.write_text(json.dumps({"format": "shapeshift-scene 1", "objects": objects}))
    assert cli.main(["lint", str(scene)]) == 0
    words = ["render", str(scene), "--out", str(tmp_path / "p"), "--size", "64x48"]
    assert cli.main(words) == 0 and list((tmp_path / "p").glob("*.png"))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--distill", "-1"], "--distill is -1.0, expected processor seconds"),
        (["--distill", "nan"], "--distill is nan"),
        (["--x", "0.5"], "--x is of streamed SOG"),
    ],
)
def test_options_that_do_not_fit(clumps, tmp_path, capsys, words, said):
    assert cli.main(["lod", str(clumps), "--out", str(tmp_path / "a.lod"), *words]) == 2
    assert said in capsys.readouterr().err and not (tmp_path / "a.lod").exists()


def test_what_is_no_folder_of_levels_stays(clumps, tmp_path, capsys):
    out = tmp_path / "mine.lod"
    out.mkdir()
    (out / "diary.txt").write_text("dear")
    assert cli.main(["lod", str(clumps), "--out", str(out), "--overwrite"]) == 2
    assert "is no folder of levels" in capsys.readouterr().err
    assert (out / "diary.txt").read_text() == "dear"


def test_splats_and_rough_packages_are_refused(tmp_path, capsys):
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply

    write_ply(some_splats(40, 1), tmp_path / "a.ply")
    assert cli.main(["lod", str(tmp_path / "a.ply"), "--out", str(tmp_path / "a.lod")]) == 2
    assert "is no package of anchors" in capsys.readouterr().err
    few = random_package(tmp_path, 20)
    assert cli.main(["lod", str(few), "--out", str(tmp_path / "a.lod"), "--distill", "0"]) == 2
    assert "no coarser level is good enough" in capsys.readouterr().err


def test_a_level_that_is_good_at_no_size_is_left_out_and_said(
    clumps, tmp_path, capsys, monkeypatch
):
    made_level = package_levels.make_level

    def spoiled(meter, number, *rest):
        made = made_level(meter, number, *rest)
        bad = LevelErrors(34.0, {"stops": 41.24, "between": 35.0}, 7.24)
        return replace(made, errors=bad) if number else made

    monkeypatch.setattr(package_levels, "make_level", spoiled)
    monkeypatch.setattr(package_levels, "LEAST_ANCHORS", 5)  # so that a second level is tried
    out = tmp_path / "a.lod"
    assert cli.main(["lod", str(clumps), "--out", str(out), "--distill", "0"]) == 0
    assert len(read_model(out).coarser) == 1
    said = " ".join(capsys.readouterr().err.split())
    lacks = "35.0 dB between them (36 wanted) and a switch changes its pixels by 7.2/255"
    assert f"are good enough at no size, and left out: at 34 pixels {lacks} (at most 6)" in said


def test_errors_are_those_of_formulas():
    rng = np.random.default_rng(0)
    one = [(rng.random((6, 8, 3)), np.ones((6, 8))) for _ in range(2)]
    other = [(picture + 0.0, alpha) for picture, alpha in one]
    assert psnr_of(one, other) == 200 and change_of(one, other) == 0
    other[0] = (np.clip(one[0][0] - 0.1, 0, 1), one[0][1])
    square = np.mean([(a - b) ** 2 for (a, _), (b, _) in zip(one, other, strict=True)])
    assert psnr_of(one, other) == pytest.approx(-10 * np.log10(square))
    # of pixels that nothing covers no difference counts, and 2 % are covered
    half = np.ones((6, 8)) * 0.0199
    half[:3] = 0.02
    masked = [(one[0][0], half)], [(other[0][0], half * 0)]
    wanted = 255 * np.abs(one[0][0] - other[0][0])[:3].mean()
    assert change_of(*masked) == pytest.approx(wanted)
    assert LevelErrors(50, {"stops": 40.0, "between": 36.0}, 6.0).good
    assert not LevelErrors(50, {"stops": 39.999, "between": 60.0}, 1.0).good
    assert not LevelErrors(50, {"stops": 60.0, "between": np.nan}, 1.0).good
    assert not LevelErrors(50, {"stops": 60.0}, 6.001).good
    assert LevelErrors(50, {"stops": 40.0, "between": 36.0}, 6.0).lacks == []
    assert LevelErrors(50, {"stops": 60.0}, np.nan).lacks == [
        "a switch changes its pixels by nan/255 (at most 6)"
    ]


def test_views_show_the_bounds_as_large_as_asked_for(clumps):
    from shapeshift.renderer.levels import object_pixels
    from shapeshift.scene.scene import SceneObject

    model = read_package(clumps)
    obj = SceneObject("it", model)
    with LevelMeter(model) as meter:
        for pixels in (12.0, 100.0, 250.0):
            found = object_pixels(obj, (meter.centre, meter.radius), meter.views(pixels))
            assert found == pytest.approx(pixels, rel=1e-6)
