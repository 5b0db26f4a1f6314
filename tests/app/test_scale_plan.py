"""docs/scale.md: its figures are the program's, and the program's follow the rows."""

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def program():
    path = ROOT / "tools" / "app" / "scale_plan.py"
    spec = importlib.util.spec_from_file_location("scale_plan", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules["scale_plan"] = module  # its dataclasses look there
    spec.loader.exec_module(module)
    return module


def test_the_page_has_the_programs_figures(program):
    """Where this fails rows have changed: run the program and put its output into the page."""
    told = "\n".join(program.lines(program.CASES, program.measure()))
    assert told in (ROOT / "docs" / "scale.md").read_text()


def test_a_step_costs_what_its_row_says(program):
    """The two shares, put together again for the row's own capture, but for the unlisted rest."""
    (cost,) = (
        row for row in program.read_rows("step_cost.csv")
        if (row["code"], row["run"]) == ("after", "all")
    )  # fmt: skip
    measured = program.measure()
    step_ms = int(cost["anchors"]) * measured.anchor_ms
    step_ms += program.PLUSH_PIXELS * measured.pixel_ms
    assert 0.9 * float(cost["cpu_ms"]) < step_ms <= float(cost["cpu_ms"])


def test_ten_times_the_capture_is_ten_times_the_work_and_no_more_memory(program):
    measured = program.measure()
    small = program.plan(program.Case("a", 100_000, 100_000_000), measured)
    large = program.plan(program.Case("b", 1_000_000, 1_000_000_000), measured)
    for name in ("core_h", "photos_tb", "store_gb", "packages_gb", "streamed_gb", "lod_h"):
        # blocks are whole: 333.3 are 334
        assert getattr(large, name) == pytest.approx(10 * getattr(small, name), rel=0.01), name
    for name in ("worker_gb", "first_mb", "walk_mbit", "chain_h"):
        assert getattr(large, name) == pytest.approx(getattr(small, name), rel=0.01), name
    assert large.pairs == pytest.approx(100 * small.pairs, rel=1e-4)


@pytest.mark.parametrize(("splats", "blocks"), [
    (1, 1), (299_999, 1), (300_000, 1), (300_001, 2), (600_000, 2), (600_001, 3),
])  # fmt: skip
def test_blocks_are_full_before_there_is_another(program, splats, blocks):
    """60,000 anchors of five splats each."""
    needed = program.plan(program.Case("a", 1, splats), program.measure())
    assert needed.blocks == blocks and needed.photos_a_block >= 1 and needed.workers >= 1
    assert needed.pairs == 0


def test_one_block_sees_each_photo_once(program):
    needed = program.plan(program.Case("a", 97, 1000), program.measure())
    assert needed.photos_a_block == 97


def test_what_breaks_is_what_exceeds_its_limit(program):
    """Each limit, moved to just above and just below what the campus needs."""
    campus, measured = program.CASES[0], program.measure()
    assumed = program.Assumed()
    for steps, breaks in ((campus.photos, False), (campus.photos - 1, True)):
        given = replace(assumed, coarse_steps=steps)
        rows = program.limits(campus, program.plan(campus, measured, given), measured, given)
        (times,) = (times for times, what in rows if "coarse run" in what)
        assert (times > 1) == breaks
    rows = program.limits(campus, program.plan(campus, measured), measured)
    assert [times for times, _ in rows] == sorted((times for times, _ in rows), reverse=True)
