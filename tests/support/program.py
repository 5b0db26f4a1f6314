"""The program started as a person starts it, and what a refusal must look like."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def launch(*arguments, **keywords):
    return subprocess.run(
        [sys.executable, "-m", "shapeshift", *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=120,
        **keywords,
    )


def assert_refused(done, *words):
    """Exit code 2, nothing on stdout, one plain sentence with these words on stderr."""
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    assert "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    for word in words:
        assert word in done.stderr
