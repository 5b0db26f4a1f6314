"""A large scene is trained for some steps: 50,000 anchors, 500,000 splats, a 1000x750 photo."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_fifty_thousand_anchors(tmp_path):
    out = tmp_path / "scale.csv"
    program = [sys.executable, str(ROOT / "tools" / "training" / "training_scale.py")]
    asked = ["--anchors", "50000", "--size", "1000x750", "--steps", "2", "--out", str(out)]
    subprocess.run([*program, *asked], check=True, timeout=300, capture_output=True)
    *_, columns, row = out.read_text().splitlines()
    cells = dict(zip(columns.split(","), row.split(","), strict=True))
    assert int(cells["splats"]) == 500_000 and int(cells["listed"]) > 500_000
    assert float(cells["pool_mb"]) < 1.25 * float(cells["said_mb"]) < 800
