"""The one door: what it says and does before any of the program is loaded."""

import ast
import importlib.util
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).resolve().parents[2]
WHICH_PYTHON = ROOT / "shapeshift" / "which_python.py"


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


@pytest.fixture
def which_python():
    """Of this checkout, as launch.py loads it."""
    spec = importlib.util.spec_from_file_location("which_python", WHICH_PYTHON)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


FITS = {"linux-x86_64": ("2.28", ["3.11", "3.12", "3.14"]), "win-amd64": ("", ["3.11", "3.14"]),
        "macos-arm64": ("14.0", ["3.13"])}  # fmt: skip


@pytest.mark.parametrize("version", [(3, 6, 0), (3, 10, 4), (3, 15, 0)])
def test_a_python_that_does_not_fit_starts_another_or_is_one_sentence(
    launch, no_set_up, monkeypatch, capsys, version
):
    """Too old or too new; nothing is made by it."""
    from shapeshift.app import first_start

    monkeypatch.setattr(first_start, "is_ready", lambda testing: False)
    monkeypatch.setattr(launch.sys, "version_info", version)
    monkeypatch.setenv("PATH", "")
    for place in ("HOME", "USERPROFILE", "PYENV_ROOT", "XDG_DATA_HOME", "APPDATA", "LOCALAPPDATA"):
        monkeypatch.setenv(place, os.devnull)
    monkeypatch.setattr(launch.sys, "executable", os.path.join(os.devnull, "python"))
    monkeypatch.setattr(launch, "WHICH_PYTHON", str(WHICH_PYTHON))
    monkeypatch.setattr(launch.os.path, "exists", lambda path: False)
    with pytest.raises(SystemExit) as stopped:
        launch.main(["info"])
    assert stopped.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    short = ".".join(map(str, version[:2]))
    assert f"needs Python 3.11 to 3.14, this is {short}, and no other was found here" in line
    assert "install Python 3.14 beside it" in line
    monkeypatch.undo()


def test_another_python_gets_all_that_was_said(launch, monkeypatch):
    handed = []
    monkeypatch.setattr(launch, "hand_over", lambda *given: handed.append(given) or 7)
    monkeypatch.setattr(launch, "WHICH_PYTHON", str(WHICH_PYTHON))
    monkeypatch.setattr(launch.sys, "version_info", (3, 10, 4))

    class Chosen:
        loader = type("Loader", (), {"exec_module": lambda self, module: setattr(
            module, "choose_python", lambda testing: f"/other/{testing}")})()  # fmt: skip

    monkeypatch.setattr(launch.importlib.util, "spec_from_file_location", lambda *_: Chosen)
    monkeypatch.setattr(launch.importlib.util, "module_from_spec", lambda _: type("Module", (), {}))
    assert launch.main(["test", "-k", "x"]) == 7 and launch.main(["info", "a b"]) == 7
    program = str(ROOT / "launch.py")
    assert handed == [("/other/True", [program, "test", "-k", "x"]),
                      ("/other/False", [program, "info", "a b"])]  # fmt: skip


@pytest.mark.parametrize(("described", "fits"), [
    ("cpython 3.11 linux-x86_64 2.28 venv", True), ("cpython 3.14 linux-x86_64 2.41 no-venv", True),
    ("cpython 3.11 linux-x86_64 2.27 venv", False), ("cpython 3.13 linux-x86_64 2.41 venv", False),
    ("cpython 3.11 linux-x86_64 2.9 venv", False),  # 9 is less than 28, whatever letters say
    ("cpython 3.1 linux-x86_64 2.41 venv", False), ("cpython 3.11 linux-x86_64 - venv", True),
    ("pypy 3.11 linux-x86_64 2.41 venv", False), ("cpython 3.11 linux-aarch64 2.41 venv", False),
    ("cpython-free-threaded 3.14 win-amd64 - venv", False), ("cpython 3.14 win-amd64 - venv", True),
    ("cpython 3.14 win32 - venv", False), ("cpython 3.13 macos-arm64 13.7 venv", False),
    ("cpython 3.13 macos-arm64 14.0 venv", True), ("cpython 3.13 macos-arm64 26.1 venv", True),
])  # fmt: skip
def test_what_fits(which_python, described, fits):
    assert which_python.fits_here(described.split(), FITS) is fits


@pytest.mark.parametrize(("described", "words"), [
    ("cpython 3.15 linux-x86_64 2.41 venv", "Python 3.11 to 3.14, this is 3.15, and no other was"),
    ("pypy 3.11 linux-x86_64 2.41 venv", "this is pypy 3.11, and no other was found here; install"),
    ("cpython 3.11 linux-x86_64 2.17 venv", "need glibc 2.28 or newer, this system has 2.17"),
    ("cpython 3.13 macos-arm64 13.7 venv", "need macOS 14.0 or newer, this system has 13.7"),
    ("cpython 3.13 win32 - venv", "come for Linux x86_64, Windows x86-64, macOS arm64, and"),
    ("cpython 3.13 linux-riscv64 2.41 venv", "this Python is one for Linux riscv64"),
])  # fmt: skip
def test_why_nothing_fits_is_one_sentence(which_python, described, words):
    said = which_python.why_none(described.split(), FITS)
    assert words in said and said.endswith(".") and ". " not in said


class Machine:
    """Stands for the Pythons of a machine: what each command would say."""

    def __init__(self, which_python, monkeypatch, said: dict[str, str]) -> None:
        self.asked: list[list[str]] = []
        monkeypatch.setattr(which_python, "ask", self.ask)
        monkeypatch.setattr(which_python.shutil, "which", lambda name: f"/bin/{name}")
        self._said = said

    def ask(self, command):
        self.asked.append(command)
        said = self._said.get(" ".join(command))
        return (f"path of {' '.join(command)}", said.split()) if said else None


def test_the_newest_python_that_fits_is_taken(which_python, monkeypatch):
    """One without ensurepip only where there is no other; the folder of pyenv knows them too."""
    word = "cpython {} linux-x86_64 2.36 {}".format
    said = {"/bin/python3.14": word("3.14", "no-venv"), "/bin/python3.13": word("3.13", "venv"),
            "/bin/python3.12": word("3.12", "venv")}  # fmt: skip
    machine = Machine(which_python, monkeypatch, said)
    assert which_python.another_python(FITS) == "path of /bin/python3.12"  # not locked for 3.13
    machine._said = {"/bin/python3.14": word("3.14", "no-venv")}
    assert which_python.another_python(FITS) == "path of /bin/python3.14"
    machine._said = {"/bin/python3.12": "pypy 3.12 linux-x86_64 2.36 venv"}  # a shim says another
    assert which_python.another_python(FITS) is None


@pytest.mark.skipif(os.name == "nt", reason="programs of a shell")
def test_pythons_of_pyenv_are_found_the_newest_first(which_python, monkeypatch, tmp_path):
    for version in ("3.12.9", "3.12.11", "3.13.1"):
        program = tmp_path / "versions" / version / "bin" / f"python{version[:4]}"
        program.parent.mkdir(parents=True)
        program.write_text(f"#!/bin/sh\necho {program}\n"
                           f"echo cpython {version[:4]} linux-x86_64 2.36 venv\n")  # fmt: skip
        program.chmod(0o755)
    monkeypatch.setenv("PYENV_ROOT", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(which_python.shutil, "which", lambda name: None)
    found = which_python.another_python({"linux-x86_64": ("2.28", ["3.12"])})
    assert found == str(tmp_path / "versions/3.12.11/bin/python3.12")


@pytest.mark.skipif(os.name == "nt", reason="programs of a shell")
@pytest.mark.parametrize("body", ["exit 1", "echo one line", "echo a; echo b c", "echo a; kill $$"])
def test_a_program_that_is_no_python_is_passed_over(which_python, tmp_path, body):
    program = tmp_path / "python3.13"
    program.write_text(f"#!/bin/sh\n{body}\n")
    program.chmod(0o755)
    assert which_python.ask([str(program)]) is None
    assert which_python.ask([str(tmp_path / "none")]) is None
    assert which_python.ask([sys.executable])[1] == which_python.describe()


def test_windows_asks_its_launcher(which_python, monkeypatch):
    """`py -3.14` before folders and PATH; nothing is installed by it."""
    monkeypatch.setattr(which_python.os, "name", "nt")
    word = "cpython 3.11 win-amd64 - venv"
    machine = Machine(which_python, monkeypatch, {"py -3.11": word})
    assert which_python.another_python({"win-amd64": ("", ["3.11", "3.14"])}) == "path of py -3.11"
    assert machine.asked[0] == ["py", "-3.14"] and machine.asked[-1] == ["py", "-3.11"]
    assert any("Python314" in command[0] for command in machine.asked)
    seen = []
    monkeypatch.undo()
    monkeypatch.setattr(which_python.subprocess, "run", lambda *a, **more: seen.append(more["env"]))
    with pytest.raises(AttributeError):  # the answer is none
        which_python.ask(["py", "-3.11"])
    assert seen[0]["PYTHON_MANAGER_AUTOMATIC_INSTALL"] == "false"


def test_this_python_is_one_that_the_locks_come_for(which_python):
    """In both locks: the tests run here."""
    assert which_python.choose_python(False) is None and which_python.choose_python(True) is None
    assert which_python.read_fits(True).keys() <= which_python.read_fits(False).keys()


def test_pythons_that_are_refused_can_read_the_refusal():
    """No syntax, no annotation and no import on the way to it that is newer than 3.6."""
    loads = {"glob", "importlib.util", "os", "platform", "re", "shutil", "signal", "subprocess",
             "sys", "sysconfig"}  # fmt: skip
    for path in (ROOT / "launch.py", WHICH_PYTHON):
        tree = ast.parse(path.read_text(), feature_version=(3, 6))
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                arguments = [node.returns, *(a.annotation for a in node.args.args)]
                assert not any(arguments), f"{node.name}: annotations are evaluated there"
        loaded = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
        assert {alias.name for node in loaded for alias in node.names} <= loads


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
    for words in ([], ["-q"], ["-x", "-v"], ["-q", "--durations=20"]):
        given = ["-n", "2", "--dist", "loadfile", "--no-loadscope-reorder", *words]
        assert launch.pytest_words(words) == ["-m", "pytest", *given]
    for words in (["-n", "0"], ["--slow", "-q"], ["tests/scene", "-k", "x"], ["--pdb"]):
        assert launch.pytest_words(words) == ["-m", "pytest", *words]
    for cores in (1, None):  # None: not known
        monkeypatch.setattr(launch.os, "cpu_count", lambda cores=cores: cores)
        assert launch.pytest_words(["-q"]) == ["-m", "pytest", "-q"]


@pytest.mark.parametrize(
    ("slow", "minutes", "begins"),
    [(True, 1.0, False), (True, 2.0, True), (True, float("inf"), True), (False, 0.0, True)],
)
def test_slow_tests_begin_within_their_minutes(request, slow, minutes, begins):
    """61 seconds after the start."""
    (conftest,) = (p for p in request.config.pluginmanager.get_plugins() if hasattr(p, "BEGAN"))
    config = SimpleNamespace(
        getoption={"--slow-minutes": minutes}.get, stash={conftest.BEGAN: time.monotonic() - 61}
    )
    item = SimpleNamespace(keywords=["slow"] if slow else [], config=config)
    if begins:
        conftest.pytest_runtest_setup(item)
    else:
        with pytest.raises(pytest.skip.Exception, match="1 minutes are over"):
            conftest.pytest_runtest_setup(item)


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
