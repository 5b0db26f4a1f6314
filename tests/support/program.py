"""The program started as a person starts it, what a refusal must look like, lines of progress."""

import contextlib
import io
import subprocess
import sys
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from unittest.mock import patch

from shapeshift.app import progress
from shapeshift.app.cli import main

ROOT = Path(__file__).resolve().parents[2]
PATIENCE_S = 60.0


def launch(*arguments, **keywords) -> subprocess.CompletedProcess:
    """The program with these arguments: exit code and what it said.

    In this process, as a start is a second or two of a core; with keywords of subprocess.run, in
    one of its own.
    """
    words = [str(argument) for argument in arguments]
    if keywords:
        return subprocess.run(
            [sys.executable, "-m", "shapeshift", *words], capture_output=True, text=True, cwd=ROOT,
            timeout=120, **keywords,
        )  # fmt: skip
    said, warned = (io.TextIOWrapper(io.BytesIO(), "utf-8") for _ in range(2))
    with (
        contextlib.chdir(ROOT), patch.object(sys, "argv", ["shapeshift", *words]),
        redirect_stdout(said), redirect_stderr(warned),
    ):  # fmt: skip
        try:
            code = main(words)
        except SystemExit as ended:
            code = ended.code if isinstance(ended.code, int) else 2 if ended.code else 0
    texts = []
    for stream in (said, warned):
        stream.flush()
        texts.append(stream.buffer.getvalue().decode())
    return subprocess.CompletedProcess(words, code, *texts)


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
