"""Scene.film: the same frames as the command's, from a scene in memory too."""

import numpy as np
import pytest
from PIL import Image

import shapeshift as ss
from shapeshift.app import cli
from tests.support.three_stops import three_stop_model, three_stop_package

SHORT = {"seconds": 1, "fps": 4, "size": (40, 30), "context": "none"}


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return three_stop_package(tmp_path_factory.mktemp("library") / "three.shift")


def frames(folder) -> list[bytes]:
    return [file.read_bytes() for file in sorted(folder.glob("*.png"))]


def test_a_film_is_the_command_s(path, tmp_path, capsys):
    told = []
    made = ss.load(path).film(
        tmp_path / "one", "RGB@0 Opened@1s", cameras="orbit", **SHORT,
        progress=lambda *step: told.append(step),
    )  # fmt: skip
    assert made == tmp_path / "one" and told[-1] == ("drawing", 1.0) and len(told) == 4
    assert capsys.readouterr() == ("", "")  # a library says nothing by itself
    words = ["film", path, "--style-path", "RGB@0 Opened@1s", "--cameras", "orbit", "--seconds", 1,
             "--fps", 4, "--size", "40x30", "--context", "none",
             "--out", tmp_path / "two"]  # fmt: skip
    assert cli.main(list(map(str, words))) == 0
    assert frames(tmp_path / "one") == frames(tmp_path / "two") and len(frames(made)) == 4


def test_a_scene_in_memory_has_one_too(tmp_path):
    """Its own arrays, edited between two films, are seen: no frame of the first is kept."""
    scene = ss.Scene.from_model(three_stop_model())
    out = scene.film(tmp_path / "deep" / "a.webp", "RGB@0 Opened@1s", **SHORT)
    with Image.open(out) as image:
        assert image.n_frames == 4 and image.size == (40, 30)
    one = frames(scene.film(tmp_path / "frames", **SHORT))
    with pytest.raises(ss.UsageError, match="--overwrite"):
        scene.at("Opened").film(tmp_path / "frames", **SHORT)
    two = frames(scene.at("Opened").film(tmp_path / "frames", **SHORT, overwrite=True))
    assert len(two) == 4 and one != two


def test_views_are_flown_past(path, tmp_path):
    scene = ss.load(path)
    views = scene.views("orbit", 12, (40, 30))[:6]
    frames_of = scene.film(tmp_path / "f", cameras=views, streams=("depth",), **SHORT)
    assert len(list((frames_of / "depth").glob("*.png"))) == 4
    assert np.asarray(Image.open(frames_of / "00000.png")).std() > 3


@pytest.mark.parametrize(
    ("how", "said"),
    [({"smoth": 1}, "no option 'smoth'"), ({"cameras": [3]}, "cameras are"),
     ({"streams": ("depth",), "out": "a.webp"}, "streams are pictures"),
     ({"size": (3,)}, "size is"), ({"fps": 0}, "fps is 0"),
     ({"style_path": "RGB@0 No@1s"}, "'No'")],
)  # fmt: skip
def test_what_cannot_be_meant(path, tmp_path, how, said):
    out = tmp_path / how.pop("out", "out")
    with pytest.raises(ss.UsageError, match=said):
        ss.load(path).film(out, **(SHORT | how))
    assert not list(tmp_path.iterdir())
