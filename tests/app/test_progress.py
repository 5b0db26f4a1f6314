"""Progress: a bar where stderr is a terminal; where it is a file or a pipe a line a minute."""

import contextlib
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from shapeshift.app import cli, progress
from tests.support.models import random_package
from tests.support.program import HeardLines

ROOT = Path(__file__).resolve().parents[2]

WORK = """
from shapeshift.app.opening import progress_after
from shapeshift.app.progress import progress_bar, tracked
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


def test_a_line_a_minute_says_what_is_under_way(monkeypatch):
    said = HeardLines(monkeypatch)
    wanted = [
        "demo: at work (0 min)", "demo: reading [bold]photos (0 min)", "demo: carving (0 min)",
        "demo: photographing [x], 2 of 4 (0 min)", "demo: [/] 12 steps, 40 %, loss 0.1 (0 min)",
    ]  # fmt: skip
    with progress.lines("demo"):
        said.wait(wanted[0])  # nothing says what is done
        with progress.working("reading [bold]photos") as report:
            said.wait(wanted[1])
            report("carving")
            said.wait(wanted[2])
        for number in progress.tracked(range(4), "photographing [x]"):
            if number == 2:
                said.wait(wanted[3])
        with progress.progress_bar() as bar:
            bar.add_task("[/] 12 steps", total=1.0, completed=0.4, loss="loss 0.1", psnr="")
            said.wait(wanted[4])
    over = list(said.lines)
    time.sleep(0.1)  # it is over: no more of them
    assert said.lines == over
    told = dict.fromkeys(over)
    between = r"demo: (at work|photographing \[x\], [013] of 4) \(0 min\)"
    assert [line for line in told if line in wanted] == wanted
    assert all(re.fullmatch(between, line) for line in told.keys() - set(wanted)), told


def test_nobody_has_to_read_the_lines(monkeypatch):
    """A closed stderr ends the lines, not the work."""
    monkeypatch.setattr(progress, "LINE_EVERY_S", 0.01)
    read_end, write_end = os.pipe()
    os.close(read_end)
    with os.fdopen(write_end, "w") as nobody, monkeypatch.context() as patch:
        patch.setattr(sys, "stderr", nobody)
        with progress.lines("demo"):
            time.sleep(0.1)
        with contextlib.suppress(BrokenPipeError):
            nobody.close()


@pytest.fixture(scope="module")
def package(tmp_path_factory) -> Path:
    return random_package(tmp_path_factory.mktemp("package"), 40)


SMALL = ("--size", "48x36", "--drawing", "tiles", "--context", "none")
LONG = {
    "render": ("render", "PACKAGE", "--x", "sweep:6", "--out", "OUT", *SMALL),
    "bench": ("bench", "PACKAGE", "--frames", "4", "--sweep", "4", *SMALL),
    "chart": ("chart", "PACKAGE", "--quick", "--frames", "2", "--out", "OUT", *SMALL),
    "compare": ("compare", "PACKAGE@RGB", "PACKAGE@Thermal", *SMALL),
    "stability": ("stability", "PACKAGE", "--cases", "disparity", "--out", "OUT", *SMALL),
    "export": ("export", "PACKAGE", "--out", "OUT/a.ply"),
    "simulate": ("simulate", "examples/touch.scene.json", "--seconds", "2", "--out", "OUT"),
    "demo": ("demo", "--size", "24x18", "--views", "4", "--test-views", "1", "--iterations", "3",
             "--processes", "1", "--out", "OUT"),
}  # fmt: skip


@pytest.mark.parametrize(
    "command", [pytest.param(c, marks=pytest.mark.slow) if c == "demo" else c for c in LONG]
)
def test_every_long_command_tells(package, tmp_path, monkeypatch, capsys, command):
    monkeypatch.setattr(progress, "LINE_EVERY_S", 0.01)
    monkeypatch.chdir(ROOT)
    places = {"PACKAGE": str(package), "OUT": str(tmp_path / "out")}
    words = [re.sub("PACKAGE|OUT", lambda found: places[found[0]], word) for word in LONG[command]]
    if command == "demo":  # its training tells as any other does
        monkeypatch.setattr("shapeshift.app.training.train.run", lambda options: 0)
    assert cli.main(words) == 0
    told = re.findall(rf"^{command}: (.+) \(0 min\)$", capsys.readouterr().err, re.M)
    assert set(told) - {"at work"}, told


def test_what_lasts_as_long_as_somebody_looks_tells_no_lines():
    assert set(cli.OPEN_ENDED) == {"view", "vr", "serve", "cluster"}
