"""Progress: a bar where stderr is a terminal, nothing at all where it is a file or a pipe."""

import os
import subprocess
import sys

import pytest

from tests.conftest import ROOT

WORK = """
from app.opening import progress_after
from app.progress import progress_bar, tracked
assert list(tracked(range(3), "counting")) == [0, 1, 2]
with progress_after(0.0) as told:
    told("reading a.ply", 0.5)
with progress_bar(transient=False) as bar:
    bar.advance(bar.add_task("training", total=1.0))
import sys
print("the last line", file=sys.stderr)
"""


def plain(**more) -> dict:
    """The environment without what makes rich take everything for a terminal, or nothing."""
    taken = ("FORCE_COLOR", "NO_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE", "TERM", "COLUMNS")
    return {k: v for k, v in os.environ.items() if k not in taken} | more


@pytest.mark.parametrize("term", ["xterm", "dumb"])
def test_into_a_pipe_goes_no_bar_and_no_empty_line(term):
    ended = subprocess.run(
        [sys.executable, "-c", WORK], capture_output=True, cwd=ROOT, env=plain(TERM=term)
    )
    assert (ended.returncode, ended.stdout) == (0, b"")
    assert ended.stderr == f"the last line{os.linesep}".encode()


@pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are of POSIX")
def test_in_a_terminal_bars_are_drawn():
    pty = pytest.importorskip("pty")
    ours, theirs = pty.openpty()
    with subprocess.Popen(
        [sys.executable, "-c", WORK], stdout=theirs, stderr=theirs, cwd=ROOT,
        env=plain(TERM="xterm", COLUMNS="100"),
    ) as process:  # fmt: skip
        os.close(theirs)
        said = b""
        while part := read_some(ours):
            said += part
    os.close(ours)
    assert process.returncode == 0
    for word in (b"counting", b"reading a.ply", b"training", b"100%", b"the last line"):
        assert word in said, said.decode()


def read_some(terminal: int) -> bytes:
    """What comes next; nothing at the end, which Linux tells by an error."""
    try:
        return os.read(terminal, 1 << 16)
    except OSError:
        return b""
