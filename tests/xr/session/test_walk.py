"""A short walk of tools/vr/walk.py: it takes and carries things, and its row says all there is."""

import csv
import subprocess
import sys

import pytest

from tests.support.xr.xr_stand import ROOT


@pytest.mark.slow
def test_a_walk_takes_what_it_reaches_for_and_writes_a_row(runtime, tmp_path):
    out = tmp_path / "walk.csv"
    words = ["--seconds", "3", "--quality", "best", "--out", str(out)]
    command = [sys.executable, "-P", ROOT / "tools" / "vr" / "walk.py", *words]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    head, *lines = out.read_text().splitlines()
    assert head.startswith("# python3 tools/vr/walk.py --seconds 3")
    (row,) = csv.DictReader(lines)
    assert (row["reached"], row["taken"]) == ("2", "2")
    assert int(row["frames"]) > 100 and float(row["period_ms"]) == 50.0
    for name in ("own", "wait", "shown"):
        p50, p95, p99, worst = (float(row[f"{name}_{p}"]) for p in ("p50", "p95", "p99", "worst"))
        assert 0 < p50 <= p95 <= p99 <= worst
    assert 0 <= float(row["in_time"]) <= 1 and float(row["rss_end_mb"]) > 50
