"""launch.py compare: what is compared with what, the numbers, the pictures, the refusals."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app.commands.compare import Options, choose_views, run
from shapeshift.app.commands.compared import (
    PictureSide,
    SceneSide,
    amplification,
    difference_picture,
    match_pictures,
    open_side,
    pictures_in,
    sheet,
    split_stop,
)
from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.app.opening import ReadingOptions
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.scene.metrics import psnr, ssim
from tests.support.splats.layer_folders import put, splats

SMALL = "64x48"


@pytest.fixture
def pair(tmp_path) -> Path:
    put(tmp_path / "pair/rgb.ply", 60), put(tmp_path / "pair/thermal.ply", 40, seed=1)
    return tmp_path / "pair"


def result_of(capsys, *arguments: str, **options) -> dict:
    assert run(Options(*arguments, json=True, size=SMALL, **options)) == 0
    return json.loads(capsys.readouterr().out)


def test_a_scene_equals_itself_and_json_holds_no_infinity(pair, capsys):
    result = result_of(capsys, str(pair), f"{pair}@RGB")
    assert len(result["views"]) == 8
    assert all(row["psnr_db"] == "equal" and row["ssim"] == 1.0 for row in result["views"])
    assert result["mean"]["psnr_db"] == "equal" and result["mean"]["equal_views"] == 8


def test_stops_of_a_scene_differ_as_their_pictures_do(pair, tmp_path, capsys):
    result = result_of(capsys, f"{pair}@rgb", f"{pair}@1", out=tmp_path / "out")
    assert result["a"] == "pair @ rgb" and result["b"] == "pair @ 1"
    swapped = result_of(capsys, f"{pair}@Thermal", f"{pair}@0")
    assert result["mean"]["ssim"] < 0.99
    decibels = [row["psnr_db"] for row in result["views"]]
    assert result["mean"]["psnr_db"] == pytest.approx(np.mean(decibels))
    assert swapped["mean"]["ssim"] != 1.0
    files = sorted((tmp_path / "out").iterdir())
    assert len(files) == 16
    with Image.open(tmp_path / "out" / "0003_sheet.png") as image:
        assert image.size == (3 * 64, 48)


def test_folders_of_pictures_are_matched_by_name_then_in_order(tmp_path, capsys):
    rng = np.random.default_rng(0)
    pictures = rng.integers(0, 256, (3, 20, 30, 3), dtype=np.uint8)
    for folder, names in (("a", "abc"), ("b", "bcd"), ("c", "xyz")):
        (tmp_path / folder).mkdir()
        for picture, name in zip(pictures, names, strict=True):
            Image.fromarray(picture).save(tmp_path / folder / f"{name}.png")
    by_name = result_of(capsys, str(tmp_path / "a"), str(tmp_path / "b"))
    assert [row["view"] for row in by_name["views"]] == ["b", "c"]
    one, two = pictures[1] / np.float32(255), pictures[0] / np.float32(255)
    assert by_name["views"][0]["psnr_db"] == pytest.approx(psnr(one, two))
    assert by_name["views"][0]["ssim"] == pytest.approx(ssim(one, two))
    in_order = result_of(capsys, str(tmp_path / "a"), str(tmp_path / "c"))
    assert in_order["mean"] == {
        "psnr_db": "equal", "ssim": pytest.approx(1.0), "largest": 0.0, "equal_views": 3,
    }  # fmt: skip


def test_pictures_that_do_not_fit_are_refused(tmp_path):
    for folder, size in (("a", (8, 6)), ("b", (6, 8)), ("c", (8, 6))):
        (tmp_path / folder).mkdir()
        Image.new("RGB", size).save(tmp_path / folder / "x.png")
    with pytest.raises(BadFile, match=r"8x6 pixels and .* 6x8"):
        run(Options(str(tmp_path / "a"), str(tmp_path / "b")))
    Image.new("RGB", (8, 6)).save(tmp_path / "c/y.png")
    (tmp_path / "c/x.png").rename(tmp_path / "c/z.png")
    sides = [PictureSide(f, pictures_in(tmp_path / f)) for f in "ac"]
    with pytest.raises(BadFile, match="1 pictures and c 2"):
        match_pictures(*sides)


def test_the_same_place_in_the_world_is_compared_whatever_the_zero(tmp_path, capsys):
    """B is written far from A's zero and re-centred at reading: the pictures must still agree."""
    near = splats(50)
    write_ply(near, tmp_path / "a.ply")
    a = open_side(str(tmp_path / "a.ply"), ReadingOptions())
    (model,) = a.subject.models
    shifted = replace(
        model, means=model.means - np.array([3, 0, -2], np.float32), origin=(3.0, 0.0, -2.0)
    )
    from shapeshift.app.commands.compare import drawn_views

    options = Options("a", "b", size=SMALL)
    for pair in drawn_views(
        options, choose_views(options, a), a, SceneSide("b", Document.of(shifted, 0.0))
    ):
        assert psnr(pair.a, pair.b) > 60
    views = choose_views(options, a)
    assert len(views) == 8 and views[0].size == (64, 48)


@pytest.mark.parametrize(
    ("text", "path", "at"),
    [("a.shift@Thermal", "a.shift", "Thermal"), ("a@b@0.5", "a@b", "0.5"), ("a.ply", "a.ply", ""),
     ("@x", "@x", ""), ("a@", "a@", "")],
)  # fmt: skip
def test_what_follows_the_last_at_sign_is_the_stop(text, path, at):
    assert split_stop(text) == (Path(path), at)


def test_a_path_that_holds_an_at_sign_wins(tmp_path):
    path = put(tmp_path / "me@home.ply", 3)
    assert split_stop(str(path)) == (path, "")
    assert open_side(str(path), ReadingOptions()).subject.x == 0.0


@pytest.mark.parametrize(
    ("at", "word"), [("nope", "RGB, Thermal"), ("1.5", "0 to 1"), ("nan", "0 to 1")]
)
def test_stops_that_are_none_are_refused(pair, at, word):
    with pytest.raises(UsageError, match=word):
        open_side(f"{pair}@{at}", ReadingOptions())


def test_pictures_against_a_scene_need_cameras(pair, tmp_path):
    Image.new("RGB", (8, 6)).save(tmp_path / "x.png")
    with pytest.raises(UsageError, match="--cameras"):
        run(Options(str(pair), str(tmp_path / "x.png")))
    with pytest.raises(UsageError, match="scene first"):
        run(Options(str(tmp_path / "x.png"), str(pair)))


def test_nothing_is_written_over(pair, tmp_path):
    out = tmp_path / "out"
    arguments = {"out": out, "size": SMALL}
    assert run(Options(f"{pair}@0", f"{pair}@1", **arguments)) == 0
    with pytest.raises(UsageError, match="--overwrite"):
        run(Options(f"{pair}@0", f"{pair}@1", **arguments))
    assert run(Options(f"{pair}@0", f"{pair}@1", overwrite=True, **arguments)) == 0


def test_differences_are_grey_where_equal_and_amplified_as_written():
    a, b = np.full((4, 5, 3), 0.5, np.float32), np.full((4, 5, 3), 0.5, np.float32)
    assert (difference_picture(a, b, 200) == 0.5).all() and amplification([b - a]) == 200
    b += np.float32(0.01)
    assert amplification([b - a]) == 50
    np.testing.assert_allclose(difference_picture(a, b, 50), 0.5 + 50 * 0.01 / 2, atol=1e-6)
    np.testing.assert_allclose(difference_picture(b, a, 50), 0.5 - 50 * 0.01 / 2, atol=1e-6)
    assert sheet(a, b, ("one", "two"), 50).shape == (4, 15, 3)


def test_a_scene_is_no_folder_of_pictures(pair, tmp_path):
    Image.new("RGB", (8, 6)).save(pair / "thumb.png")
    assert pictures_in(pair) == ()
    assert read_model(pair).splat_count == 100


def test_names_in_any_letters_are_drawn_or_marked():
    from shapeshift.renderer.debug.letters import drawable

    assert drawable("M\u00f6hre a\u2192b \u03a9", 20) == "M\u00f6hre a\u2192b \u03a9"
    assert drawable("\u30c4 \u6f22", 20) == "? ?"
    a = np.zeros((40, 300, 3), np.float32)
    one, other = (sheet(a, a, (name, "b"), 1) for name in ("\u00f6\u00f6", "\u00fc\u00fc"))
    assert (one != other).any()  # as boxes they would be the same
