"""launch.py style by a picture or by words, on small scenes and made networks."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.app.training.style_options import anchors_inside
from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.training.style_features.named_styles import MADE_STYLES, NAMED_STYLES, find_style
from shapeshift.training.styles.style_rules import RULES
from tests.support.new_stops import framed_model
from tests.support.training.clip_files import write_clip
from tests.support.training.onnx_files import tiny_vgg

EYE = np.array([0.3, 0.5, 2.0])
FEW = ("--views", 4, "--size", 48, "--steps", 40)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A scene, a small VGG, a made CLIP and a blue picture."""
    folder = tmp_path_factory.mktemp("looks")
    write_package(framed_model(200), folder / "scene.shift")
    tiny_vgg(folder / "vgg.onnx")
    write_clip(folder / "clip")
    picture = np.random.default_rng(0).integers(0, 60, (40, 30, 3), np.uint8)
    picture[..., 2] += 190
    Image.fromarray(picture).save(folder / "blue.png")
    return folder


@pytest.fixture
def style(folder, tmp_path, monkeypatch):
    """Runs the command in the folder and gives its exit code; it writes out.shift."""
    monkeypatch.chdir(folder)

    def run(*words: object) -> int:
        out = "--out", str(tmp_path / "out.shift")
        return cli.main(["style", "scene.shift", "--no-pace", *out, *map(str, words)])

    return run


def colors(folder, tmp_path):
    """(N, 3) of the first stop before, of the new one after, and of the first one after."""
    before, after = read_package(folder / "scene.shift"), read_package(tmp_path / "out.shift")
    new = evaluate(after, after.stops[-1].x, EYE)
    return [s.color for s in (evaluate(before, 0.0, EYE), new, evaluate(after, 0.0, EYE))]


def test_a_picture_gives_its_colors_and_nothing_else_moves(folder, tmp_path, style, device, capsys):
    assert style("--image", "blue.png", "--vgg", "vgg.onnx", *FEW) == 0
    said = capsys.readouterr().err
    assert "Blue: new, from RGB" in said and "MOVED" not in said
    before, new, same = colors(folder, tmp_path)
    np.testing.assert_allclose(same, before, atol=2e-5)
    assert (new[:, 2] - new[:, 0]).mean() > (before[:, 2] - before[:, 0]).mean() + 0.2


def test_a_picture_of_our_own_and_the_same_bytes_again(folder, tmp_path, style, device):
    words = ("--image", "glass", "--vgg", "vgg.onnx", "--seed", 3, *FEW)
    assert style(*words) == 0
    first = (tmp_path / "out.shift").read_bytes()
    assert style(*words, "--overwrite") == 0
    assert (tmp_path / "out.shift").read_bytes() == first


def test_a_preview_has_the_pictures_colors_without_training(folder, tmp_path, style, device):
    words = ("--image", "blue.png", "--vgg", "vgg.onnx", "--quality", "preview")
    assert style(*words, "--region", "half:0,0,0:1,0,0") == 0
    before, new, same = colors(folder, tmp_path)
    np.testing.assert_allclose(same, before, atol=2e-5)
    model = read_package(folder / "scene.shift")
    inside = np.repeat(anchors_inside(model, ("half:0,0,0:1,0,0",), ()), model.splats_per_anchor)
    shown = inside & (evaluate(model, 0.0, EYE).opacity > 0.1)
    assert (new[shown, 2] - new[shown, 0]).mean() > 0.4  # the picture: 0.63
    np.testing.assert_allclose(new[~inside], before[~inside], atol=1e-4)


def test_a_preview_in_python_is_that_of_the_command(folder, tmp_path, style, device):
    import shapeshift as ss

    words = ("--image", "blue.png", "--vgg", "vgg.onnx", "--quality", "preview", "--name", "Sea")
    assert style(*words) == 0
    made = ss.load("scene.shift").add_style(
        "Sea", image="blue.png", vgg="vgg.onnx", quality="preview", pace=False
    )
    made.save(tmp_path / "python.shift")
    one, other = (read_package(tmp_path / n) for n in ("out.shift", "python.shift"))
    np.testing.assert_allclose(
        evaluate(one, 1.0, EYE).color, evaluate(other, 1.0, EYE).color, atol=2e-3
    )  # 2e-3: `save` keeps features as halves


def test_words_turn_a_region_red_and_nothing_else(folder, tmp_path, style, device, capsys):
    """Equations 10 to 13 on a made CLIP that knows colours."""
    region = ("--region", "half:0,0,0:1,0,0")
    assert style("--text", "red", "--clip-model", "clip", *region, *FEW) == 0
    assert "Red: new, from RGB" in capsys.readouterr().err
    before, new, _ = colors(folder, tmp_path)
    model = read_package(folder / "scene.shift")
    inside = np.repeat(anchors_inside(model, region[1:], ()), model.splats_per_anchor)
    assert 0.2 < inside.mean() < 0.8
    np.testing.assert_allclose(new[~inside], before[~inside], atol=1e-4)
    redder = (new - before)[inside]
    shown = evaluate(model, 0.0, EYE).opacity[inside] > 0.3
    assert (redder[shown, 0] - redder[shown, 1]).mean() > 0.1
    assert (redder[shown, 0] - redder[shown, 2]).mean() > 0.1


def test_what_a_picture_means_to_clip(folder, tmp_path, style, device):
    assert style("--image", "blue.png", "--clip-model", "clip", "--shape", "points", *FEW) == 0
    before, new, _ = colors(folder, tmp_path)
    assert (new[:, 2] - new[:, 0]).mean() > (before[:, 2] - before[:, 0]).mean() + 0.1


def test_words_alone_choose_a_shape(folder, tmp_path, style, capsys):
    assert style("--text", "hairy grass") == 0
    assert "'hairy grass' is the shape fur of this program." in capsys.readouterr().err
    assert read_package(tmp_path / "out.shift").stops[-1].name == "Fur"


def test_words_alone_choose_a_picture_of_ours(folder, tmp_path, style, device, capsys):
    assert style("--text", "a stained window", "--vgg", "vgg.onnx", *FEW) == 0
    assert "is the picture glass of this program." in capsys.readouterr().err
    assert read_package(tmp_path / "out.shift").stops[-1].name == "Glass"


def test_every_name_and_tag_finds_its_style_or_an_older_one_of_the_same_tag():
    names = [style.name for style in NAMED_STYLES]
    assert {n for n, s in zip(names, NAMED_STYLES, strict=True) if s.kind == "shape"} == set(RULES)
    assert {s.name for s in NAMED_STYLES if s.kind == "picture"} == set(MADE_STYLES)
    tags = [tag for style in NAMED_STYLES for tag in style.tags]
    assert len(tags) == len(set(tags)) and not set(tags) & set(names)
    for style in NAMED_STYLES:
        for word in (style.name, *style.tags, style.name.upper(), f"made of {style.tags[0]}!"):
            assert find_style(word).name == style.name, word
    assert find_style("brikcs").name == "blocks"  # a slip of the fingers
    assert find_style("fur and soap").name == "fur"  # a name counts more than a tag


REFUSED = {
    "a picture alone": (("--image", "blue.png"), "--image needs --vgg, an ONNX file of VGG16"),
    "vgg alone": (("--shape", "fur", "--vgg", "vgg.onnx"), "--vgg needs --image"),
    "clip alone": (("--shape", "fur", "--clip-model", "clip"), "needs --text or --image"),
    "both": (("--text", "red", "--image", "blue.png", "--vgg", "v"), "--text and --image both"),
    "two ways": (
        ("--image", "blue.png", "--vgg", "vgg.onnx", "--clip-model", "clip"), "are two ways"),
    "beside a network": (("--network", "a", "--text", "red"), "--network paints the stop already"),
    "an encoder alone": (("--shape", "fur", "--encoder", "a"), "--encoder makes the code of"),
    "unknown words": (("--text", "quantum"), "no style of this program is called 'quantum'; ther"),
    "a shape twice": (("--text", "hairy", "--shape", "melt"), "'hairy' is the shape fur, and --sh"),
    "a shape and vgg": (("--text", "hairy", "--vgg", "vgg.onnx"), "shape fur; leave out --vgg"),
    "a picture without vgg": (("--text", "mosaic"), "is the picture glass; give --vgg"),
    "no such picture": (("--image", "no.png", "--vgg", "vgg.onnx"), "no.png is no file"),
    "a small picture": (("--image", "15.png", "--vgg", "vgg.onnx"), "15x40 pixels; 16 to 4096"),
    "a large picture": (("--image", "4097.png", "--vgg", "vgg.onnx"), "4097x16 pixels; 16 to 4096"),
    "no picture": (("--image", "vgg.onnx", "--vgg", "vgg.onnx"), "vgg.onnx"),
    "no such vgg": (("--image", "glass", "--vgg", "no.onnx"), "no.onnx is no file"),
    "no vgg": (("--image", "glass", "--vgg", "clip/vision_model.onnx"), "relu3_1 of VGG16"),
    "no such clip": (("--text", "red", "--clip-model", "no"), "no is no folder; --clip-model"),
    "no clip": (("--text", "red", "--clip-model", "."), "has no vision_model.onnx; an exported"),
    "a long text": (("--text", "x" * 201, "--clip-model", "clip"), "1 to 200 are wanted"),
    "no style to clip": (("--text", "qq", "--clip-model", "clip"), "is the same as 'A Photo'"),
    "no patches": (("--text", "red", "--clip-model", "clip", "--patches", "0"), "--patches is 0"),
    "small views": (("--image", "glass", "--vgg", "vgg.onnx", "--size", "31"), "--size 31"),
    "preview alone": (("--shape", "fur", "--quality", "preview"), "--quality preview is of"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_is_refused_in_a_sentence(folder, tmp_path, style, capsys, name):
    for size in ((15, 40), (4097, 16)):
        Image.new("RGB", size).save(folder / f"{size[0]}.png")
    words, wanted = REFUSED[name]
    assert style(*words) == 2
    said = capsys.readouterr().err
    assert wanted in said and said.count("\n") == 1 and "Traceback" not in said
    assert not list(tmp_path.iterdir())
