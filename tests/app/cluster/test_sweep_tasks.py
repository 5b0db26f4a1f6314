"""Programs of tools/training that write rows of docs/bench: their runs as tasks."""

import contextlib
import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from shapeshift.training.synthetic.balls import make_balls

ROOT = Path(__file__).resolve().parents[3]
TIMES = ("seconds", "start_s", "cpu_s", "step_ms")


@pytest.fixture(scope="module")
def balls(tmp_path_factory) -> Path:
    return make_balls(tmp_path_factory.mktemp("captures") / "mine", 32, 6, 2).folder


def sweep(program: str, *words: str) -> subprocess.Popen[str]:
    command = [sys.executable, str(ROOT / "tools" / program), *words]
    environment = os.environ | {"POCL_MAX_PTHREAD_COUNT": "1"}
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment)


def rows(out: Path) -> list[dict]:
    lines = [line for line in out.read_text().splitlines() if not line.startswith("#")]
    return [{k: v for k, v in row.items() if k not in TIMES} for row in csv.DictReader(lines)]


GROWTH = ("--iterations", "40", "--max-anchors", "300", "--ways", "default", "no growth")


def test_a_program_has_its_rows_of_each_run_and_says_what_was_typed(balls, tmp_path):
    out = tmp_path / "growth.csv"
    program = sweep("training/growth.py", str(balls), *GROWTH, "--out", str(out))
    assert program.wait(120) == 0, program.communicate()[1]
    words = "'no growth'"
    assert out.read_text().splitlines()[0] == (
        f"# python3 tools/training/growth.py mine --iterations 40 --max-anchors 300 --ways default "
        f"{words} --out {out}"
    )
    found = rows(out)
    assert list(dict.fromkeys(row["way"] for row in found)) == ["default", "no growth"]
    assert {row["capture"] for row in found} == {"mine"} and {row["seed"] for row in found} == {"0"}
    assert os.listdir(tmp_path) == ["growth.csv"]  # nothing of the runs is left


def test_a_run_that_fails_is_said_and_what_is_done_is_kept(balls, tmp_path):
    (tmp_path / "no").mkdir()
    out = tmp_path / "rows.csv"
    words = (str(balls), "RGB", str(tmp_path / "no"), "RGB", "--photos", "3", "--ways", "default")
    program = sweep("training/sparse.py", *words, "--iterations", "3", "--out", str(out))
    said = program.communicate(timeout=120)[1]
    assert program.returncode == 1 and "the same command goes on" in said
    sentence = f"no RGB 3 0 default: {tmp_path / 'no'}: neither photos nor poses in this folder"
    assert sentence in said and "Traceback" not in said
    assert not out.exists() and len(list((tmp_path / "rows.csv.runs").glob("mine*.done.json"))) == 1


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signals")
def test_two_workers_write_the_rows_of_none_also_when_one_is_killed(balls, tmp_path):
    pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
    alone, many = tmp_path / "alone.csv", tmp_path / "many.csv"
    words = (str(balls), "RGB", "--photos", "3", "0", "--ways", "default", "half",
             "--iterations", "300", "--max-anchors", "300")  # fmt: skip
    assert sweep("training/sparse.py", *words, "--out", str(alone)).wait(300) == 0
    program = sweep("training/sparse.py", *words, "--out", str(many), "--cluster", "local:2")
    runs = tmp_path / "many.csv.runs"
    while program.poll() is None and not (found := workers_of(runs)):
        time.sleep(0.05)
    time.sleep(1)  # in the middle of a run
    os.kill(found[0], signal.SIGKILL)
    said = program.communicate(timeout=300)[1]
    assert program.returncode == 0, said
    assert rows(many) == rows(alone) and len(rows(many)) == 4
    assert many.read_text().splitlines()[1] == alone.read_text().splitlines()[1]
    assert sorted(os.listdir(tmp_path)) == ["alone.csv", "many.csv"]


def workers_of(runs: Path) -> list[int]:
    """Who has started the runs whose rows go into a folder."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it has ended
            words = (folder / "cmdline").read_bytes().decode().split("\0")
            if "--only" in words and words[words.index("--out") + 1].startswith(str(runs)):
                found.append(int((folder / "stat").read_text().rpartition(")")[2].split()[1]))
    return found
