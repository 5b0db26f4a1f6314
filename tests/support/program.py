"""The program started as a person starts it, what a refusal must look like, lines of progress."""

import subprocess
import sys
import time
from pathlib import Path

from shapeshift.app import progress

ROOT = Path(__file__).resolve().parents[2]
PATIENCE_S = 60.0


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


class HeardLines:
    """The lines that say what is under way: one every 10 ms, not a minute.

    The thread that says them comes late where others have the cores: `wait` is for it.
    """

    def __init__(self, monkeypatch) -> None:
        self.lines: list[str] = []
        monkeypatch.setattr(progress, "LINE_EVERY_S", 0.01)
        monkeypatch.setattr(progress, "say", self.lines.append)

    def wait(self, line: str) -> None:
        end = time.monotonic() + PATIENCE_S
        while line not in self.lines:
            assert time.monotonic() < end, (line, self.lines)
            time.sleep(0.002)
