"""Killed anywhere, the same command goes on: a sample of tools/program/kills.py; what that sees."""

import sys

import pytest

from tools.program.kills import COLUMNS, JOBS, Bench, Job, make_inputs

FAULTS = COLUMNS[COLUMNS.index("refused") :]
BEGIN = """
import os, sys, tempfile, time
out = sys.argv[1]
part = out + ".part"
"""
# Each takes about .4 s, in which it is killed three times; the last line is what an end looks like.
WHOLE = BEGIN + "open(part, 'w').write('a'); time.sleep(0.4); os.replace(part, out)"
CLEANS = """
import tempfile, time, sys, os
handle, path = tempfile.mkstemp(); time.sleep(0.4); os.remove(path); open(sys.argv[1], 'w')
"""
COUNTS = BEGIN + "open(out, 'a').write('a'); time.sleep(0.4); open(out, 'a').write('b')"
REFUSES = (
    BEGIN
    + "assert not os.path.exists(part); open(part, 'w'); time.sleep(0.4); "
    + ("os.replace(part, out)")
)


@pytest.mark.parametrize(
    ("code", "seen"),
    [(WHOLE, None), (CLEANS, "left_over"), (COUNTS, "other_bytes"), (REFUSES, "refused")],
)
def test_each_fault_is_seen_and_nothing_else(tmp_path, code, seen):
    bench = Bench("toy", tmp_path, Job("OUT/a"), (sys.executable, "-S", "-c", code))
    row = bench.row(3, 0)
    assert row["kills"] == 3
    assert row["went_on"] + row["resumed"] + row["whole"] + row["refused"] == 3
    found = {fault for fault in FAULTS if row[fault]}
    assert found <= ({seen} if seen != "refused" else set(FAULTS)) and (
        seen is None or seen in found
    )
    assert bool(bench.faults) == bool(found)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lod", "film", "train"])
def test_a_killed_command_goes_on_to_the_same_bytes(tmp_path, name):
    make_inputs(tmp_path / "inputs", [name])
    bench = Bench(name, tmp_path, JOBS[name])
    row = bench.row(2, 0)
    assert [row[fault] for fault in FAULTS] == [0, 0, 0], bench.faults
