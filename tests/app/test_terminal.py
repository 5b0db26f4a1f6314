"""Whatever names a file holds, nothing of them steers the terminal of whoever looks at it."""

import io
import json
import os
import re
import subprocess
import sys
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from shapeshift.app import cli
from shapeshift.app.terminal import (
    CleanStream,
    clean_streams,
    open_console,
    print_json,
    print_text,
    say,
)
from shapeshift.runtime_models.files.plain_text import LONGEST_LINE, UNSAFE
from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.scene.cameras.write_cameras import write_cameras
from tests.support.models import make_random_model

ROOT = Path(__file__).resolve().parents[2]
CLI = [sys.executable, "-P", str(ROOT / "shapeshift" / "__main__.py")]
NAMES = {
    "escape": "\x1b[2J\x1b]0;owned\x07\x1b]52;c;b3duZWQ=\x07red",
    "eight bits": "\x9b2J\x9d0;owned\x9c",
    "new line": "RGB\nshapeshift: all is well",
    "over it": "RGB\rnothing",
    "direction": "\u202egnp.exe\u2066",
    "half a pair": "a\ud800b",
    "markup": "[/red][link=file:///etc/passwd]x[/link]",
    "long": "n" * 100_000,
    "link": "\x1b]8;;http://example.invalid\x1b\\x\x1b]8;;\x1b\\",
}


def model_of(name: str):
    stops = (Stop(name, 0.0), Stop("Thermal", 1.0, "thermal", "ironbow", (1.0, 2.0), name[:999]))
    return replace(make_random_model(4), stops=stops, provenance={name[:999]: name})


@pytest.fixture
def package(tmp_path, name) -> Path:
    write_package(model_of(NAMES[name]), tmp_path / "a.shift")
    return tmp_path / "a.shift"


@dataclass
class Ended:
    code: int
    out: str
    err: str


@pytest.fixture
def run(capsys, monkeypatch):
    """The command line in this process; to `lint`, every slider jumps, which it says."""
    monkeypatch.setattr("shapeshift.renderer.pace.largest_step", lambda model: 9.0)

    def run(*words) -> Ended:
        try:
            code = cli.main([str(word) for word in words])
        except SystemExit as stopped:
            code = stopped.code
        return Ended(code, *capsys.readouterr())

    return run


def assert_harmless(*texts: str) -> None:
    for text in texts:
        assert not UNSAFE.search(text.replace("\n", ""))
        for line in text.splitlines():
            assert len(line) <= LONGEST_LINE
            assert not line.startswith("shapeshift: all is well")


@pytest.mark.parametrize("name", NAMES)
def test_names_of_stops(package, name, tmp_path, run):
    for words in (("info", package), ("lint", package),
                  ("export", package, "--out", tmp_path / "a.ply")):  # fmt: skip
        done = run(*words)
        assert done.code == 0, done.err
        assert_harmless(done.out, done.err)
    told = run("info", package, "--json")
    assert json.loads(told.out)["stops"][0]["name"] == NAMES[name]
    assert not UNSAFE.search(told.out.replace("\n", ""))


@pytest.mark.parametrize("name", ["escape", "new line", "direction", "markup", "half a pair"])
def test_names_of_files(tmp_path, name, run):
    """Any bytes but / may be a file's name on Linux."""
    folder = tmp_path / NAMES[name].replace("/", "_").encode("utf-8", "replace").decode()
    folder.mkdir()
    path = folder / f"{folder.name}.shift"
    write_package(make_random_model(3), path)
    for words in (("info", path), ("lint", path), ("info", path.with_suffix(".ply")),
                  (path.with_suffix(".ply"),), ("info", path, path), ("info", f"--{path.name}"),
                  ("export", path, "--out", folder / "a.ply")):  # fmt: skip
        done = run(*words)
        assert done.code in (0, 2), done.err
        assert_harmless(done.out, done.err)
        assert "Traceback" not in done.err and "fault of the program" not in done.err


@pytest.mark.skipif(os.name == "nt", reason="names of any bytes")
def test_names_that_are_no_text(tmp_path):
    path = os.fsencode(tmp_path) + b"/\xff\xfe.shift"
    write_package(make_random_model(3), Path(os.fsdecode(path)))
    done = subprocess.run([*CLI, "lint", path], capture_output=True, check=True)
    assert_harmless(done.stdout.decode(), done.stderr.decode())


@pytest.mark.parametrize("name", ["escape", "direction", "markup", "long"])
def test_names_of_cameras(tmp_path, name, run):
    from tests.support.scene.camera_files import cameras

    few = cameras(count=2)
    write_cameras(replace(few, names=(NAMES[name], "b")), tmp_path / "a.json", "ours")
    done = run("cameras", tmp_path / "a.json")
    assert done.code == 0, done.err
    assert_harmless(done.out, done.err)


@pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are of POSIX")
@pytest.mark.parametrize("name", ["escape", "link"])
def test_in_a_terminal_too(package, name):
    """Where rich draws lines and colours of its own: those, and nothing of the name's."""
    pty = pytest.importorskip("pty")
    ours, theirs = pty.openpty()
    env = os.environ | {"TERM": "xterm", "COLUMNS": "120", "FORCE_COLOR": "1"}
    for command in ("info",):
        with subprocess.Popen([*CLI, command, str(package)], stdout=theirs, stderr=theirs, env=env):
            pass
    os.close(theirs)
    said = b""
    while True:
        try:
            said += os.read(ours, 1 << 16)
        except OSError:
            break
    os.close(ours)
    text = re.sub(r"\x1b\[[0-9;]*m", "", said.decode()).replace("\r\n", "\n")
    assert not UNSAFE.search(text.replace("\n", ""))
    assert b"\x1b[2J" not in said and b"\x1b]8;" not in said


# The streams


@contextmanager
def streams():
    """(out, err): what arrives beneath the clean streams."""
    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8", newline="\n") for _ in range(2))
    with redirect_stdout(out), redirect_stderr(err):
        yield out, err
        assert sys.stdout is out and sys.stderr is err


def arrived(stream) -> str:
    stream.flush()
    return stream.buffer.getvalue().decode("utf-8")


BAD = "\x1b]0;owned\x07\u202e\ud800"
CLEAN = "\\x1b]0;owned\\x07\\u202e\\ud800"


def test_what_anybody_prints_is_clean():
    import warnings

    with streams() as (out, err), clean_streams():
        print(f"one {BAD}\ntwo")
        sys.stdout.writelines([f"three {BAD}\n"])
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            warnings.showwarning = lambda text, *_: sys.stderr.write(f"{text}\n")
            warnings.warn(f"four {BAD}", stacklevel=1)
        say(f"five {BAD}\nsix", "seven")
        print_text(f"eight {BAD}\nnine")
    assert arrived(out) == f"one {CLEAN}\ntwo\nthree {CLEAN}\neight {CLEAN}\nnine\n"
    assert arrived(err) == f"four {CLEAN}\nfive {CLEAN}\\nsix\nseven\n"


def test_tables_and_bars_are_clean(monkeypatch):
    from rich.table import Table
    from rich.text import Text

    from shapeshift.app.progress import progress_bar

    screen = {"force_terminal": True, "force_interactive": True, "width": 200}
    monkeypatch.setattr("shapeshift.app.progress.open_console", lambda: open_console(**screen))
    with streams() as (out, err), clean_streams():
        table = Table(f"column {BAD}", title=BAD)
        table.add_row(BAD)
        table.add_row(Text(BAD, style="bold"))
        table.add_row(Text.assemble("a", (BAD, "link http://x")))
        for console in (open_console(), open_console(width=300, force_terminal=True)):
            console.print(table, BAD, Text(BAD), f"[/red] {BAD}")
        with progress_bar() as bar:
            task = bar.add_task(f"[/red] {BAD}", total=2)
            print(f"while it runs {BAD}")
            bar.advance(task)
    for text in map(arrived, (out, err)):
        assert "\x1b]" not in text and "\u202e" not in text and "\ud800" not in text
        assert "owned\x07" not in text
    assert arrived(err).count("[/red]") >= 3 and "while it runs" in arrived(err)


def test_json_keeps_its_meaning_whatever_the_encoding():
    for encoding in ("utf-8", "ascii", "cp1252"):
        out = io.TextIOWrapper(io.BytesIO(), encoding)
        value = {"name": f"{BAD} 漢字 😀", "long": "n" * 10**5}
        with redirect_stdout(out), clean_streams():
            print_json(value)
        out.flush()
        assert json.loads(out.buffer.getvalue().decode(encoding)) == value


def test_letters_that_the_output_lacks_end_nothing():
    out = io.TextIOWrapper(io.BytesIO(), "ascii")
    with redirect_stdout(out), clean_streams():
        print("Wärme 漢")
    out.flush()
    assert out.buffer.getvalue() == b"W\\xe4rme \\u6f22\n"


class Full(io.StringIO):
    def write(self, text):
        raise OSError(28, "No space left on device")


@pytest.mark.parametrize("name", ["stdout", "stderr"])
def test_a_full_disk_behind_a_stream_is_named(name):
    with pytest.raises(OSError) as full:
        CleanStream(Full(), f"standard {name}").write("x")
    assert full.value.filename == f"standard {name}"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
@pytest.mark.parametrize("words", [("--help",), ("info", ROOT / "assets/workshop.shift")])
def test_the_program_says_that_its_output_found_no_room(words):
    with open("/dev/full", "wb") as full:
        done = subprocess.run([*CLI, *map(str, words)], stdout=full, stderr=subprocess.PIPE)
    assert done.returncode == 2
    assert done.stderr.decode().strip().endswith("No space left on device: standard output")


@pytest.mark.skipif(os.name == "nt", reason="pipes of POSIX")
@pytest.mark.parametrize("words", [("--help",), ("info", ROOT / "assets/workshop.shift")])
def test_a_reader_that_goes_away_ends_it_quietly(words):
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run([*CLI, *map(str, words)], stdout=write, stderr=subprocess.PIPE)
    os.close(write)
    assert (done.returncode, done.stderr) == (0, b"")


def test_nothing_in_the_program_says_anything_otherwise():
    """No print, and no console of rich's, but through app/terminal.py."""
    # match_run.py is a process of its own, whose lines the program reads.
    own = {"terminal.py", "clean_console.py", "first_start.py", "match_run.py"}
    for path in (ROOT / "app").rglob("*.py"):
        if path.name in own:
            continue
        text = path.read_text()
        assert not re.search(r"\bConsole\(|\bProgress\(|sys\.std(out|err)\.write", text), path
        for found in re.finditer(r"(?<![.\w])print\((.*)", text):
            assert "file=text" in found[1], f"{path}: {found[0]}"  # into memory


def test_a_fault_names_nothing_unsafe(monkeypatch, capsys):
    def fail(command, arguments):
        raise ZeroDivisionError(BAD)

    monkeypatch.setattr(cli, "run_command", fail)
    assert cli.main(["info", "x"]) == 3
    assert CLEAN in capsys.readouterr().err
