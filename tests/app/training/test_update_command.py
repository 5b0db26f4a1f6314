"""launch.py update and ss.update: what they say, refuse, write, and take up again."""

import numpy as np
import pytest

import shapeshift as ss
from shapeshift.app import cli
from shapeshift.training.synthetic.balls import make_balls

BOX = "box:0.15,0.18,0.55:0.32,0.3,0.32"
SHORT = ("--iterations", "6")


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    folder = tmp_path_factory.mktemp("capture")
    make_balls(folder, size=48, views=6, test_views=2)
    return folder


@pytest.fixture(scope="module")
def scene(capture, tmp_path_factory):
    out = tmp_path_factory.mktemp("scene") / "a.shift"
    ss.train(capture, out, iterations=30, max_anchors=300, pace=False)
    return out


def test_the_command_writes_what_the_function_gives_and_says_what_it_did(
    scene, capture, tmp_path, capsys
):
    out = tmp_path / "b.shift"
    words = ["update", str(scene), str(capture), "--where", BOX, "--out", str(out), *SHORT]
    assert cli.main(words) == 0
    said = capsys.readouterr().err
    assert "anchors in the region" in said and "outside stay" in said
    assert "held-out photos where they see the region: RGB" in said
    made = ss.update(scene, capture, where=BOX, iterations=6)
    again = ss.load(out).model
    assert np.array_equal(made.model.anchors, again.anchors)
    assert np.array_equal(made.model.features, again.features)
    assert np.array_equal(made.model.frames.wxyz, again.frames.wxyz)
    assert again.provenance["updates"][0]["iterations"] == 6
    before = ss.load(scene).model.provenance["eyes"]  # both captures' photos are from there
    assert sorted(again.provenance["eyes"]) == sorted(before) and len(before) > 6
    assert cli.main(words) == 2 and "--overwrite replaces it" in capsys.readouterr().err
    assert cli.main([*words[:-1], "8", "--resume"]) == 0
    assert "8 steps" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ((), "nothing says what may change"),
        (("--where", "box:0,0,0:1,-1,1"), "three metres above 0"),
        (("--where", "plane:0,1,0,0"), "is more than a box"),
        (("--where", "box:0,90,0:0.1,0.1,0.1"), "no training photo of 'RGB'"),
        (("--change", "nowhere"), "no places.json"),
        (("--where", BOX, "--points", "hall.laz"), "hall.laz"),
    ],
)
def test_bad_input_is_one_sentence_and_nothing_is_written(
    scene, capture, tmp_path, capsys, more, said
):
    out = tmp_path / "b.shift"
    assert cli.main(["update", str(scene), str(capture), "--out", str(out), *more]) == 2
    text = capsys.readouterr().err
    assert said in text and "Traceback" not in text and not out.exists()


def test_splats_without_networks_are_refused(scene, capture, tmp_path, capsys):
    ply = tmp_path / "a.ply"
    ss.export(ss.load(scene), ply)
    words = ["update", str(ply), str(capture), "--where", BOX, "--out", str(tmp_path / "b.shift")]
    assert cli.main(words) == 2 and "package of `train` is wanted" in capsys.readouterr().err
