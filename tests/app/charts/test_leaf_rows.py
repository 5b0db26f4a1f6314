"""Budgets of splats in a chart: rows of a scene in levels of detail, and of no other."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app import cli
from shapeshift.app.charts.chart_picture import family
from shapeshift.app.charts.chart_scene import budgets_of, digest
from shapeshift.app.charts.comparison import MOST_DB
from shapeshift.scene.scene import Scene
from tests.support.splat_scenes import random_layers, shell
from tests.support.streamed_scenes import open_levels, scene_of, write_levels

SPLATS = 3000
MILLION = 1_000_000


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_levels(shell(SPLATS), tmp_path_factory.mktemp("levels") / "shell")


def charted(folder, out, *extra):
    words = ["chart", str(folder), "--out", str(out), "--size", "64x48", "--quick", "--frames", "3",
             "--drawing", "tiles", "--context", "none", *extra]  # fmt: skip
    assert cli.main(words) == 0
    rows = list(csv.DictReader((out / "rows.csv").read_text().splitlines()[3:]))
    return {row["name"]: row for row in rows if row["name"].startswith("budget")}


def test_more_splats_are_more_alike_and_all_of_them_are_equal(folder, tmp_path):
    """Each budget draws no more than it says; all is the same picture to the bit."""
    rows = charted(folder, tmp_path / "out")
    assert list(rows) == ["budget all", "budget 1/2", "budget 1/4", "budget 1/8"]
    for row, part in zip(rows.values(), (1, 2, 4, 8), strict=True):
        assert row["changes"] == f"budget={SPLATS // part}"
        assert 0 < int(row["drawn"]) <= SPLATS // part
    for name in ("psnr_db", "psnr_mean_db", "sweep_psnr_db"):
        every, *others = [float(row[name]) for row in rows.values()]
        assert every == MOST_DB and 60 > others[0] > others[1] > others[2] > 10
    before = (tmp_path / "out" / "rows.csv").read_bytes()
    charted(folder, tmp_path / "out")  # complete: no row is measured, none is of another scene
    assert (tmp_path / "out" / "rows.csv").read_bytes() == before


def test_one_level_of_a_scene_has_no_budgets(folder, tmp_path):
    assert charted(folder, tmp_path / "out", "--max-splats", "1500") == {}


def test_budgets_are_below_all_splats_and_above_those_that_stay(folder):
    """Objects without levels count in full; two objects of one file count twice."""
    levels, fixed = open_levels(folder, MILLION), random_layers(1000)
    assert budgets_of(scene_of(fixed), "tiles") == budgets_of(Scene(()), "tiles") == ()
    found = {row.name: row.changes["budget"] for row in budgets_of(scene_of(levels), "tiles")}
    assert found == {"budget all": 3000, "budget 1/2": 1500, "budget 1/4": 750, "budget 1/8": 375}
    found = {r.name: r.changes["budget"] for r in budgets_of(scene_of(levels, fixed), "tiles")}
    assert found == {"budget all": 4000, "budget 1/2": 2000}  # 1/4 is 1000: nothing is left
    found = {r.name: r.changes["budget"] for r in budgets_of(scene_of(levels, levels), "tiles")}
    assert found["budget all"] == 6000


@pytest.mark.parametrize(
    ("count", "names"),
    [(250_000, []), (250_001, ["0.25M"]), (2_000_000, ["1M", "0.5M", "0.25M"]),
     (8_000_001, ["8M", "4M", "2M", "1M", "0.5M", "0.25M"])],
)  # fmt: skip
def test_millions_are_those_below_the_count(folder, count, names):
    levels = open_levels(folder, MILLION)
    counts = np.zeros_like(levels.leaves.levels.counts)
    counts[0, 0] = count
    levels.leaves.levels = replace(levels.leaves.levels, counts=counts)
    rows = [row.name for row in budgets_of(scene_of(levels), "quads")]
    assert rows[4:] == [f"budget {name}" for name in names]
    assert len(budgets_of(scene_of(levels), "quads", quick=True)) == 4


def test_budgets_are_a_family_and_quads_keep_the_exact_target(folder):
    (first, *_) = budgets_of(scene_of(open_levels(folder, MILLION)), "quads")
    assert first.changes["target"] == "rgba32f"
    assert family("target=rgba32f budget=3000") == family("budget=375") == "budget"
    assert family("target=rgba16f") == "pixels"


def test_a_digest_of_leaves_is_of_their_contents(folder):
    assert digest(open_levels(folder, 500)) == digest(open_levels(folder, 500))
    assert digest(open_levels(folder, 500)) != digest(open_levels(folder, 501))
