"""The one door: what it says and does before any of the program is loaded."""

import ast
import importlib.util
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def launch():
    """launch.py as a module; Ctrl-C, which it holds back, is let in again after the test."""
    spec = importlib.util.spec_from_file_location("launch", ROOT / "launch.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    module.hold_interrupts(False)


@pytest.fixture
def no_set_up(monkeypatch):
    """Fails the test where an environment would be made."""
    from shapeshift.app import first_start

    monkeypatch.setattr(first_start, "make_environment", lambda testing: pytest.fail("a set-up"))


def test_old_python_is_refused_in_one_sentence(launch, monkeypatch, capsys):
    monkeypatch.setattr(launch.sys, "version_info", (3, 10, 4))
    with pytest.raises(SystemExit) as stopped:
        launch.main([])
    assert stopped.value.code == 2
    assert "needs Python 3.11 or newer, this is 3.10.4" in capsys.readouterr().err


def test_pythons_that_are_refused_can_read_the_refusal():
    """No syntax, no annotation and no import on the way to it that is newer than 3.6."""
    tree = ast.parse((ROOT / "launch.py").read_text(), feature_version=(3, 6))
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            arguments = [node.returns, *(a.annotation for a in node.args.args)]
            assert not any(arguments), f"{node.name}: annotations are evaluated there"
    loaded = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
    assert [alias.name for node in loaded for alias in node.names] == [
        "os", "signal", "subprocess", "sys"]  # fmt: skip


@pytest.mark.parametrize("failure", [KeyboardInterrupt, OSError(30, "Read-only file system", "x")])
def test_what_ends_the_set_up_is_one_sentence(launch, monkeypatch, capsys, failure):
    from shapeshift.app import first_start

    def end(testing):
        raise failure

    monkeypatch.setattr(first_start, "make_environment", end)
    with pytest.raises(SystemExit) as stopped:
        launch.main(["info"])
    assert stopped.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "Interrupted" in line or line.endswith("cannot be made: Read-only file system: x.")


def test_what_is_handed_over_finds_nothing_by_pythonpath(launch, monkeypatch):
    seen = []
    monkeypatch.setenv("PYTHONPATH", ":")
    monkeypatch.setenv("PYTHONHOME", "/elsewhere")
    monkeypatch.setenv("OTHER", "kept")
    monkeypatch.setattr(launch.os, "name", "posix")
    monkeypatch.setattr(launch.os, "execve", lambda *given: seen.append(given))
    monkeypatch.setattr(launch.subprocess, "Popen", lambda *given, **more: pytest.fail("a child"))
    with pytest.raises(pytest.fail.Exception):  # only since execve came back
        launch.hand_over("/python", ["shapeshift/__main__.py", "info"])
    ((program, command, environment),) = seen
    assert program == "/python" and command == ["/python", "-P", "shapeshift/__main__.py", "info"]
    assert environment["OTHER"] == "kept"
    assert not {"PYTHONPATH", "PYTHONHOME"} & environment.keys()


@pytest.mark.skipif(not (ROOT / ".venv/ready").exists(), reason="not started through launch.py")
def test_a_second_start_adds_under_a_second():
    def seconds(command):
        start = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True, cwd=ROOT)
        return time.perf_counter() - start

    door = [sys.executable, "launch.py", "--help"]
    inside = [ROOT / ".venv/bin/python", "-P", os.path.join("shapeshift", "__main__.py"), "--help"]
    seconds(door)  # the set-up, if something changed
    assert min(seconds(door) for _ in range(3)) - min(seconds(inside) for _ in range(3)) < 1.0


@pytest.mark.parametrize("words", [["--help"], ["-h"], ["help"], ["--version"]])
def test_what_is_only_asked_installs_nothing(launch, no_set_up, monkeypatch, words):
    """The Python that started it answers; its standard library is enough."""
    handed = []
    monkeypatch.setattr(launch, "hand_over", lambda *given: handed.append(given) or 0)
    assert launch.main(words) == 0
    ((python, (program, asked)),) = handed
    assert python == sys.executable and asked == words[0]
    assert Path(program) == ROOT / "shapeshift" / "__main__.py"


@pytest.mark.parametrize("words", [["--help"], ["-h"], ["help"], ["--version"]])
def test_what_is_only_asked_needs_the_standard_library_alone(words):
    answer = subprocess.run(
        [sys.executable, "-I", "-S", ROOT / "shapeshift" / "__main__.py", *words],
        capture_output=True, text=True, cwd=ROOT, check=True,
    )  # fmt: skip
    assert answer.stdout.startswith(("usage: ", "shapeshift ")) and answer.stderr == ""


@pytest.mark.parametrize("words", [["--help"], ["-h"], ["-q", "--help"]])
def test_help_of_the_tests_installs_nothing(launch, no_set_up, capsys, words):
    assert launch.main(["test", *words]) == 0
    told = capsys.readouterr()
    assert told.err == ""
    assert told.out.startswith("usage: python3 launch.py test") and "--slow" in told.out


def test_the_whole_suite_runs_in_two_processes_and_a_choice_of_it_in_one(launch, monkeypatch):
    """Slow tests have two cores for themselves: some watch a runtime, or the clock."""
    monkeypatch.setattr(launch.os, "cpu_count", lambda: 2)
    for words in ([], ["-q"], ["-x", "-v"]):
        given = ["-n", "2", "--dist", "loadfile", "--no-loadscope-reorder", *words]
        assert launch.pytest_words(words) == ["-m", "pytest", *given]
    for words in (["-n", "0"], ["--slow", "-q"], ["tests/scene", "-k", "x"], ["--pdb"]):
        assert launch.pytest_words(words) == ["-m", "pytest", *words]
    for cores in (1, None):  # None: not known
        monkeypatch.setattr(launch.os, "cpu_count", lambda cores=cores: cores)
        assert launch.pytest_words(["-q"]) == ["-m", "pytest", "-q"]


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals of POSIX")
@pytest.mark.parametrize("ready", [False, True])
@pytest.mark.parametrize("words", [["info"], ["test"]])
def test_an_interrupt_waits_for_the_program_and_ends_a_set_up(launch, monkeypatch, words, ready):
    """A set-up and pytest answer by themselves; the program, once its modules are there."""
    from shapeshift.app import first_start

    held = []

    def note(*_):
        held.append(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ()))
        return 0

    monkeypatch.setattr(first_start, "is_ready", lambda testing: ready)
    monkeypatch.setattr(first_start, "make_environment", note)
    monkeypatch.setattr(launch, "hand_over", note)
    monkeypatch.setattr(launch.os, "chdir", lambda folder: None)
    assert launch.main(words) == 0
    assert held == ([ready, True] if words == ["info"] else [False, False])
