"""--budget as a person gives it: what is drawn, what is refused in one sentence."""

import json

import numpy as np
import pytest
from PIL import Image

import shapeshift as ss
from shapeshift.app import cli
from shapeshift.app.commands import render
from shapeshift.app.errors import UsageError
from shapeshift.app.opening import read_splat_budget
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from tests.support.splat_scenes import shell
from tests.support.splats.ply_files import some_splats
from tests.support.streamed_scenes import view_at, write_levels


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_levels(shell(3000), tmp_path_factory.mktemp("levels") / "shell")


def test_a_library_draws_by_a_budget_as_whole_or_nearly(folder):
    view = view_at((0, 0.5, 4), size=(96, 64))
    whole = np.asarray(ss.load(folder).render(camera=view, drawing="tiles"))
    for budget, least in ((3000, 90.0), ("3k", 90.0), ("auto", 90.0), (1500, 25.0)):
        shown = np.asarray(ss.load(folder, budget=budget).render(camera=view, drawing="tiles"))
        assert -10 * np.log10(max(((shown - whole) ** 2).mean(), 1e-12)) > least
    with pytest.raises(UsageError, match="leave --max-splats out"):
        ss.load(folder, budget=1500, max_splats=3)


def test_a_scene_file_draws_its_copies_by_one_budget(folder, tmp_path, capsys):
    items = [
        {"name": name, "model": str(folder), "pose": {"position": [x, 0, 0]}}
        for name, x in (("left", -2.0), ("right", 2.0))
    ]
    file = tmp_path / "two.scene.json"
    file.write_text(json.dumps({"format": "shapeshift-scene 1", "objects": items}))
    words = ["render", str(file), "--out", str(tmp_path / "out"), "--size", "96x64"]
    assert cli.main([*words, "--budget", "1.5k", "--drawing", "tiles"]) == 0
    (picture,) = (tmp_path / "out").glob("*.png")
    pixels = np.asarray(Image.open(picture))
    assert pixels[:, :48].max() > 50 and pixels[:, 48:].max() > 50
    assert "no levels" not in capsys.readouterr().err


def test_a_scene_without_levels_is_drawn_whole_and_says_so(tmp_path, capsys):
    write_ply(some_splats(50, 1), tmp_path / "a.ply")
    words = ["render", str(tmp_path / "a.ply"), "--out", str(tmp_path / "out"), "--size", "32x32"]
    assert cli.main([*words, "--budget", "2M", "--drawing", "tiles"]) == 0
    assert "a.ply has no levels of detail, so --budget changes nothing" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["0", "1", "999", "-5", "2G", "1e6", "nan", "", "2 M", "1001M"])
def test_a_budget_that_is_none_is_refused(folder, tmp_path, capsys, text):
    with pytest.raises(UsageError, match=r"expected auto, or 1,000 to 1,000,000,000 splats"):
        read_splat_budget(text)
    if text in ("0", "1e6"):
        words = ["render", str(folder), "--out", str(tmp_path / "out"), "--budget", text]
        assert cli.main(words) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1 and f"--budget is '{text}'" in said


@pytest.mark.parametrize(
    ("text", "count"),
    [("1k", 1000), ("1000", 1000), ("1.5M", 1_500_000), ("2m", 2_000_000), (" auto ", 0),
     ("AUTO", 0), ("1000M", 1_000_000_000)],
)  # fmt: skip
def test_budgets_are_read(text, count):
    assert read_splat_budget(text) == count


@pytest.mark.parametrize("size", ["63", "1048577", "-1"])
def test_a_cache_that_is_none_is_refused(folder, tmp_path, capsys, size):
    words = ["render", str(folder), "--out", str(tmp_path), "--budget", "2k", "--cache-mb", size]
    assert cli.main(words) == 2
    assert f"--cache-mb is {size}, expected 64 to" in capsys.readouterr().err


def test_a_broken_file_ends_in_one_sentence(tmp_path, capsys):
    folder = write_levels(shell(1000), tmp_path / "cut")
    file = folder / "0_0" / "means_u.webp"
    file.write_bytes(file.read_bytes()[:40])
    words = ["render", str(folder), "--out", str(tmp_path / "out"), "--budget", "2k"]
    assert cli.main([*words, "--drawing", "tiles"]) == 2
    said = capsys.readouterr().err
    assert "cut: 0_0/meta.json cannot be read" in said and "Traceback" not in said


def test_bench_takes_a_budget_and_compares_with_all_splats(folder, capsys):
    """A budget for all loses nothing; a smaller one is what the rows say, and costs decibels."""
    rows = []
    for budget in ("3k", "1k"):
        words = ["bench", str(folder), "--budget", budget, "--frames", "2", "--sweep", "2"]
        words += ["--size", "96x64", "--quality-size", "64x48", "--drawing", "tiles"]
        assert cli.main([*words, "--context", "none", "--json"]) == 0
        told = capsys.readouterr()
        rows.append(json.loads(told.out))
        assert "PSNR to all splats" in " ".join(told.err.split())
    full, part = rows
    assert [row["budget"] for row in rows] == [3000, 1000]
    assert full["psnr_db"] > 90 > 45 > part["psnr_db"] > 15
    assert part["drawn"] <= part["in_pages"] <= 1000 < full["in_pages"] <= full["splats"] == 3000


def test_a_draft_is_the_coarsest_levels_and_reads_no_other_file(tmp_path, capsys):
    """Files of finer levels may be missing: nothing is read of them."""
    folder = write_levels(shell(3000), tmp_path / "levels")
    words = ["render", str(folder), "--size", "96x64", "--drawing", "tiles", "--out"]
    assert cli.main([*words, str(tmp_path / "whole"), "--budget", "3k"]) == 0
    (folder / "0_0" / "means_l.webp").unlink()
    assert cli.main([*words, str(tmp_path / "draft"), "--budget", "3k", "--draft"]) == 0
    whole, draft = (
        np.asarray(Image.open(next((tmp_path / name).glob("*.png")))) / 255.0
        for name in ("whole", "draft")
    )
    assert 12 < -10 * np.log10(((whole - draft) ** 2).mean()) < 40
    with pytest.raises(UsageError, match="add --budget"):
        render.run(render.Options(scene=folder, out=tmp_path / "no", draft=True))
