"""What a step is said to hold beside what it takes from a pool of its own."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from shapeshift.training.heads.networks import HeadLayout
from tools.app.step_memory import step_memory

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def scale():
    """The program tools/training/training_scale.py."""
    path = ROOT / "tools" / "training" / "training_scale.py"
    spec = importlib.util.spec_from_file_location("training_scale", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("form", ["cpu", "gpu"])
def test_the_program_writes_rows_and_memory_is_what_is_said(scale, form, tmp_path):
    out = tmp_path / "scale.csv"
    scale.main(
        ["--anchors", "300", "2000", "--splats", "3", "--size", "60x40", "--steps", "2",
         "--form", form, "--out", str(out)]
    )  # fmt: skip
    command, machine, columns, *rows = out.read_text().splitlines()
    assert command.startswith("# python tools/training/") and machine.startswith("# ")
    assert len(rows) == 2
    for row in rows:
        cells = dict(zip(columns.split(","), row.split(","), strict=True))
        assert cells["form"] == form
        assert 0 < int(cells["listed"]) <= int(cells["slots"])
        # Views differ in their lists, and the pool keeps what an earlier one needed.
        assert float(cells["said_mb"]) == pytest.approx(float(cells["pool_mb"]), rel=0.25)
        assert all(float(v) >= 0 for name, v in cells.items() if name.endswith("_ms"))


def test_bytes_follow_the_layout():
    five, ten = (step_memory(HeadLayout(splats=k)) for k in (5, 10))
    assert five.slot == ten.slot == 56  # twelve gradients, an index and a mask of blocks
    assert 0 < ten.anchor - five.anchor < five.anchor
    wide = step_memory(HeadLayout(splats=5, hidden=64))
    assert wide.anchor - five.anchor == 4 * 5 * 32
    total = five.total(1000, 5000, 120, photos=3)
    by_hand = (five.rest, 1000 * five.anchor, 5000 * 56, 120 * (five.pixel + 3 * five.photo_pixel))
    assert total == np.sum(by_hand)
