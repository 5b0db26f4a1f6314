"""The budget: what it may choose, and a stored chart that is never trusted blindly."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapeshift.app import cli
from shapeshift.app.charts import budget_chart
from shapeshift.app.charts.budget import FrameBudget, choose, least_scale, read_budget
from shapeshift.app.charts.budget_chart import (
    BudgetRow,
    ChartSubject,
    budget_rows,
    read_rows,
    steady,
    store_rows,
)
from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from tests.support.models import make_random_model, random_package
from tests.support.program import assert_refused, launch

EXACT = BudgetRow("exact", RenderSettings(), 20.0, 200.0)


def row(name, ms, db, **changes):
    return BudgetRow(name, RenderSettings(**changes), ms, db)


ROWS = [
    EXACT,
    row("small", 12.0, 60.0, min_pixels=1.0),
    row("half", 8.0, 38.0, render_scale=0.5),
    row("quarter", 4.0, 25.0, render_scale=0.25),
]


@pytest.mark.parametrize(
    ("target", "floor", "name", "reached"),
    [
        (20.0, 35, "exact", True),  # exactly the target is within it
        (19.9, 35, "small", True),
        (11.0, 35, "half", True),
        (11.0, 38, "half", True),  # exactly the floor is above it
        (11.0, 38.1, "small", False),
        (5.0, 35, "half", False),
        (5.0, 20, "quarter", True),
        (5.0, 300, "exact", False),
    ],
)
def test_choices(target, floor, name, reached):
    choice = choose(ROWS, target, floor)
    assert (choice.name, choice.reached) == (name, reached)
    assert choice.settings == next(r.settings for r in ROWS if r.name == name)
    assert choice.sentence.count("\n") == 0 and choice.sentence.endswith(".")
    assert name in choice.sentence and f"{choice.ms:.1f} ms" in choice.sentence
    assert choice.sentence.startswith("Nothing at") != reached


MEASURED = st.tuples(st.floats(0.1, 50), st.floats(0, 200) | st.just(float("nan")))


@given(st.lists(MEASURED, max_size=8), st.floats(0.1, 60), st.floats(0, 220))
def test_never_below_the_floor_and_never_slower_than_needed(measured, target, floor):
    rows = [EXACT, *(row(f"row {i}", ms, db) for i, (ms, db) in enumerate(measured))]
    choice = choose(rows, target, floor)
    kept = [r for r in rows if r.db >= floor]
    assert choice.db >= floor or (choice.name == "exact" and not kept)
    assert choice.reached == any(r.ms <= target for r in kept or [EXACT])
    if not choice.reached and kept:
        assert choice.ms == min(r.ms for r in kept)
    if choice.reached and choice.name != "exact":
        assert choice.db == max(r.db for r in kept if r.ms <= target)


def test_no_exact_row_is_a_fault():
    with pytest.raises(ValueError, match="one named 'exact'"):
        choose(ROWS[1:], 10, 30)


def test_how_far_dynamic_resolution_may_go():
    assert least_scale(ROWS, 35) == 0.5
    assert least_scale(ROWS, 20) == 0.25
    assert least_scale(ROWS, 50) == 1.0
    mixed = row("both", 2.0, 60.0, render_scale=0.1, min_pixels=2.0)
    assert least_scale([*ROWS, mixed], 35) == 0.5


def test_options():
    assert read_budget(None, None) is None
    assert read_budget(11, None) == FrameBudget(11, 35)
    assert read_budget(11, 40) == FrameBudget(11, 40)
    for target, floor, told in (
        (0, None, "--target-ms is 0"),
        (float("inf"), 1, "--target-ms"),
        (9, float("nan"), "--floor-db is nan"),
        (None, 30, "give both"),
    ):
        with pytest.raises(UsageError, match=told):
            read_budget(target, floor)


def test_stored_rows_come_back(tmp_path):
    path = tmp_path / "a" / "b.json"
    rows = [*ROWS, row("far", 3.0, 50.0, max_distance=2.5, background=(1, 0.5, 0))]
    store_rows(path, [*rows, row("broken", 3.0, float("nan"))])
    assert read_rows(path) == rows
    assert [p.name for p in path.parent.iterdir()] == ["b.json"]


def broken_files():
    plain = {"name": "exact", "ms": 2, "db": 3, "settings": {"background": [0, 0, 0]}}
    good = {"format": budget_chart.FORMAT, "rows": [plain]}
    yield good, True
    for field, value in (("ms", 0), ("ms", "x"), ("db", None), ("settings", {}), ("settings", 3),
                         ("settings", {"background": [0, 0, 0], "no_such": 1}),
                         ("settings", {"background": [0, 0, 0], "key_bits": 7}),
                         ("name", "other")):  # fmt: skip
        yield good | {"rows": [plain | {field: value}]}, False
    yield from ((other, False) for other in ([], {}, 3, None, good | {"format": 0}, {"rows": []}))


@pytest.mark.parametrize(("contents", "good"), list(broken_files()))
def test_a_broken_file_is_as_none(tmp_path, contents, good):
    path = tmp_path / "a.json"
    path.write_text(json.dumps(contents))
    assert (read_rows(path) is not None) == good
    path.write_bytes(json.dumps(contents).encode()[:-1] + b"\xff")
    assert read_rows(path) is None


def test_no_file_is_none(tmp_path):
    assert read_rows(tmp_path / "none.json") is None
    assert read_rows(tmp_path) is None
    (tmp_path / "deep").write_text("[" * 100_000)
    assert read_rows(tmp_path / "deep") is None


def test_a_folder_that_cannot_be_written_is_said(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    store_rows(tmp_path / "file" / "a.json", ROWS)
    assert "not kept for the next time" in capsys.readouterr().err


def test_orders_that_are_kept_are_not_for_pictures_far_apart():
    kept = row("sort every 4", 5.0, 50.0, resort_frames=4)
    assert steady([*ROWS, kept]) == ROWS


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_measured_once_for_each_thing_that_matters(cache, monkeypatch):
    """Same contents, same rows; another size, x, eyes, background or model measures anew."""
    calls = []
    monkeypatch.setattr(budget_chart, "measure", lambda *what: calls.append(what) or list(ROWS))
    model = make_random_model(20)
    with Renderer(None) as renderer:
        first = ChartSubject(Document.of(model), 0.0, (40, 30))
        assert budget_rows(renderer, None, first) == ROWS
        again = ChartSubject(Document.of(make_random_model(20)), 0.0, (40, 30))
        assert budget_rows(renderer, None, again) == ROWS
        assert len(calls) == 1
        others = [replace(first, x=0.5), replace(first, size=(30, 40)), replace(first, eyes=2),
                  replace(first, subject=Document.of(make_random_model(21)))]  # fmt: skip
        for number, other in enumerate(others, 2):
            budget_rows(renderer, None, other)
            assert len(calls) == number
        renderer.settings = replace(renderer.settings, background=(1.0, 1.0, 1.0))
        budget_rows(renderer, None, first)
        assert len(calls) == 6
    stored = sorted((cache / "shapeshift" / "charts").iterdir())
    assert len(stored) == 6
    stored[0].write_text("{")  # broken: measured again and mended
    renderer.settings = replace(renderer.settings, background=(0.0, 0.0, 0.0))


def test_render_within_a_budget(tmp_path, cache):
    """The first run measures and says what it chose; the second finds the chart and agrees."""
    scene = random_package(tmp_path, 40)
    words = ("render", scene, "--context", "none", "--size", "40x30", "--overwrite",
             "--out", tmp_path / "out", "--target-ms", 1e6)  # fmt: skip
    told = [launch(*words) for _ in range(2)]
    for done in told:
        assert done.returncode == 0, done.stderr
        assert re.search(r"exact: [0-9.]+ ms a frame, nothing is left out\.", done.stderr)
    sentence = [re.search(r"exact: .*", done.stderr)[0] for done in told]
    assert sentence[0] == sentence[1]
    chart = next((cache / "shapeshift" / "charts").iterdir())
    chart.write_text("no JSON")
    done = launch(*words[:-1], 1e-6)  # nothing is so fast; measured again without a traceback
    assert done.returncode == 0 and "Nothing at 35 dB or better reaches 0.0 ms" in done.stderr
    assert read_rows(chart) is not None
    pixels = [np.frombuffer(p.read_bytes(), np.uint8) for p in (tmp_path / "out").iterdir()]
    assert len(pixels) == 1


def test_bench_says_what_it_chose(tmp_path, cache):
    scene = random_package(tmp_path, 40)
    words = ("bench", scene, "--context", "none", "--size", "40x30", "--quality-size", "40x30",
             "--frames", 2, "--sweep", 2, "--json")  # fmt: skip
    done = launch(*words, "--target-ms", 1e-6, "--floor-db", 1)
    assert done.returncode == 0, done.stderr
    assert "Nothing at 1 dB or better" in done.stderr
    done = launch(*words, "--settings", "sort every 2")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["settings"]["resort_frames"] == 2 and result["sorts"] == 0.5


def test_refused_on_the_command_line(tmp_path):
    scene = tmp_path / "none.shift"
    both = ("--target-ms", 5, "--max-pixels", 3)
    assert_refused(launch("render", scene, "--out", tmp_path, *both), "leave one of the two out")
    assert_refused(launch("bench", scene, "--target-ms", 5, "--settings", "far"), "--settings")
    assert_refused(launch("bench", scene, "--floor-db", 30), "give both")
    assert cli.main(["bench", str(scene), "--target-ms", "-1"]) == cli.BAD_INPUT


def test_unknown_settings_and_targets_are_refused(tmp_path):
    scene = random_package(tmp_path, 5)
    bench = ("bench", scene, "--context", "none")
    assert_refused(launch(*bench, "--settings", "fast"), "there is no setting 'fast'")
    assert_refused(launch(*bench, "--settings", "rgba8"), "changes nothing in tiles")
    assert_refused(launch(*bench, "--target", "rgba32f"), "tiles are drawn here")
