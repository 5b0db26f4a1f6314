"""Every case of `launch.py stability` on the bundled demo at the default size; 50 GL contexts."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DEMO = ROOT / "assets" / "workshop.shift"


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        ("--drawing", "tiles", "--context", "none"),
        ("--drawing", "quads", "--cases", "life", "far-origin", "inside", "limits", "random-eyes"),
    ],
    ids=["tiles", "quads"],
)
def test_the_demo_holds(options, tmp_path):
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "shapeshift",
            "stability",
            DEMO,
            "--out",
            tmp_path,
            *options,
        ],
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=900,
    )
    assert done.returncode == 0, done.stderr
    lines = (tmp_path / "stability.csv").read_text().splitlines()
    assert "FAILS" not in {row[4] for row in csv.reader(lines[3:])}
