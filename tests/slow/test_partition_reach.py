"""What label maps make of the demo and of a pile of real splats, by the programs of the rows."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SPLATS = ROOT.parent / "shared" / "data" / "splats_marcelpadilla"
pytestmark = pytest.mark.slow


def rows_of(out: Path, program: str, *arguments) -> list[dict[str, str]]:
    """The rows that a program of tools/decomposition writes."""
    command = [sys.executable, f"tools/decomposition/{program}.py", *map(str, arguments)]
    subprocess.run([*command, "--out", str(out)], cwd=ROOT, check=True, timeout=1200)
    lines = [line for line in out.read_text().splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


def test_the_demo_from_48_and_from_4_views_closed_and_opened(tmp_path):
    rows = rows_of(tmp_path / "rows.csv", "workshop")
    miou = {(r["evidence"], r["test_x"], r["rule"]): float(r["miou"]) for r in rows}
    rule = "anchors at .4"
    assert miou["48 at RGB", "0", rule] >= 0.91
    assert miou["4 at RGB", "0", rule] >= 0.89
    assert miou["48 at RGB", "1", rule] >= 0.91  # labels found closed hold opened
    # Masks that are true are not worse than the nearest solid of every anchor.
    assert miou["48 at RGB", "0", rule] > miou["none", "0", "by place"]


def test_a_pile_of_real_splats(tmp_path):
    if not SPLATS.is_dir():
        pytest.skip("the splats of splats_marcelpadilla are not here")
    rows = rows_of(tmp_path / "rows.csv", "pile", SPLATS)
    found = {(r["views"], r["rule"]): r for r in rows}
    whole = found["40", "unseen by neighbours"]
    assert float(whole["miou"]) >= 0.99 and float(whole["accuracy"]) >= 0.97
    left = found["40", "unseen to the background"]
    assert float(whole["accuracy"]) > float(left["accuracy"]) + 0.03
