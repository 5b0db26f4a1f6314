"""The one door: what it says and does before any of the program is loaded."""

import importlib.util
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def launch(tmp_path, monkeypatch):
    """launch.py as a module, its environment folder moved away from the real one."""
    spec = importlib.util.spec_from_file_location("launch", ROOT / "launch.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "VENV", tmp_path / "venv")
    monkeypatch.setattr(module, "PYTHON", tmp_path / "venv/bin/python")
    return module


@pytest.fixture
def calls(launch, monkeypatch):
    """The commands that it would run; none is."""
    seen = []

    def run(command, **_):
        seen.append(command)
        if "venv" in command:
            launch.PYTHON.parent.mkdir(parents=True)
            launch.PYTHON.touch()
        return subprocess.CompletedProcess(command, run.returncode)

    run.returncode = 0
    monkeypatch.setattr(launch.subprocess, "run", run)
    monkeypatch.setattr(launch, "missing_packages", lambda testing: [])
    seen_run = type("Calls", (list,), {})(seen)
    seen_run.all, seen_run.run = seen, run
    return seen_run


def test_first_start_installs_and_the_second_does_nothing(launch, calls):
    launch.make_environment(testing=False)
    assert [c[2] for c in calls.all] == ["venv", "pip"]
    calls.all.clear()
    launch.make_environment(testing=False)
    assert calls.all == []


def test_the_test_environment_serves_the_program_too_but_not_the_other_way(launch, calls):
    launch.make_environment(testing=False)
    assert launch.is_ready(False) and not launch.is_ready(True)
    launch.make_environment(testing=True)
    assert launch.is_ready(False) and launch.is_ready(True)


def test_a_failed_install_is_not_taken_for_a_finished_one(launch, calls, capsys):
    calls.run.returncode = 0
    launch.make_environment(testing=False)
    launch.stamp_file(False).unlink()
    calls.run.returncode = 1
    with pytest.raises(SystemExit) as stopped:
        launch.make_environment(testing=False)
    assert stopped.value.code == 2
    assert "pip could not install" in capsys.readouterr().err
    assert not launch.is_ready(False)


def test_changed_requirements_install_again(launch, calls, monkeypatch):
    launch.make_environment(testing=False)
    monkeypatch.setattr(launch.sys, "version", "another Python")
    assert not launch.is_ready(False)


def test_without_root_one_line_says_what_to_install(launch, monkeypatch, capsys):
    monkeypatch.setattr(launch.os, "geteuid", lambda: 1000)
    launch.install_packages(["libegl1", "pocl-opencl-icd"])
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert "sudo apt-get install -y --no-install-recommends libegl1 pocl-opencl-icd" in lines[0]


def test_old_python_is_refused_in_one_sentence(launch, monkeypatch, capsys):
    monkeypatch.setattr(launch.sys, "version_info", (3, 10, 4))
    with pytest.raises(SystemExit) as stopped:
        launch.main([])
    assert stopped.value.code == 2
    assert "needs Python 3.11 or newer, this is 3.10.4" in capsys.readouterr().err


def test_every_library_has_a_package(launch):
    assert launch.has_library("libc.so.6") or not sys.platform.startswith("linux")
    assert not launch.has_library("libnot-there.so.9")


@pytest.mark.skipif(not (ROOT / ".venv/ready").exists(), reason="not started through launch.py")
def test_a_second_start_adds_under_a_second():
    def seconds(command):
        start = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True, cwd=ROOT)
        return time.perf_counter() - start

    door = [sys.executable, "launch.py", "--help"]
    inside = [ROOT / ".venv/bin/python", "-m", "app.cli", "--help"]
    seconds(door)  # the set-up, if something changed
    assert min(seconds(door) for _ in range(3)) - min(seconds(inside) for _ in range(3)) < 1.0


@pytest.mark.parametrize("words", [["--help"], ["-h"], ["help"], ["--version"]])
def test_what_is_only_asked_installs_nothing(launch, calls, monkeypatch, words):
    """The Python that started it answers; its standard library is enough."""
    handed = []
    monkeypatch.setattr(launch, "hand_over", lambda *given: handed.append(given) or 0)
    assert launch.main(words) == 0
    ((arguments, python),) = handed
    assert calls.all == [] and str(python) == sys.executable and arguments[-1] == words[0]


@pytest.mark.parametrize("words", [["--help"], ["-h"], ["help"], ["--version"]])
def test_what_is_only_asked_needs_the_standard_library_alone(words):
    answer = subprocess.run(
        [sys.executable, "-I", "-S", ROOT / "app" / "cli.py", *words],
        capture_output=True, text=True, cwd=ROOT, check=True,
    )  # fmt: skip
    assert answer.stdout.startswith(("usage: ", "shapeshift ")) and answer.stderr == ""


@pytest.mark.parametrize("words", [["--help"], ["-h"], ["-q", "--help"]])
def test_help_of_the_tests_installs_nothing(launch, calls, capsys, words):
    assert launch.main(["test", *words]) == 0
    told = capsys.readouterr()
    assert calls.all == [] and told.err == ""
    assert told.out.startswith("usage: python3 launch.py test") and "--slow" in told.out
