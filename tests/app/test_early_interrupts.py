"""Ctrl-C before the program can answer: it waits, and is answered as ever; SIGTERM and SIGHUP
are answered as Ctrl-C is.
"""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from shapeshift.app.first_start import is_ready
from shapeshift.app.interrupts import ENDINGS, answer_endings, leave_terminal
from shapeshift.app.training.run_loop import interrupts
from tests.support.models import random_package

ROOT = Path(__file__).resolve().parents[2]
DOORS = {
    "launch": [sys.executable, "launch.py"],
    "program": [sys.executable, "-P", "shapeshift/__main__.py"],
}
pytestmark = pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals of POSIX")


def interrupted_before() -> None:
    """A Ctrl-C that came before Python was there; as launch.py does, it is held back."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    os.kill(os.getpid(), signal.SIGINT)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return random_package(tmp_path_factory.mktemp("scene"), 60)


@pytest.mark.parametrize("door", DOORS)
def test_an_interrupt_before_the_start_is_answered(scene, door):
    if door == "launch" and not is_ready(False):
        pytest.skip("not started through launch.py test")
    ended = subprocess.run(
        [*DOORS[door], "info", str(scene)], cwd=ROOT, preexec_fn=interrupted_before,
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "Interrupted.\n")


def test_an_interrupt_while_the_command_is_imported_is_answered(scene, tmp_path):
    """In the middle of numpy, which makes an ImportError of it."""
    (tmp_path / "datetime.py").write_text(
        "import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n"
        "import _datetime\nfrom _datetime import *\nfrom _datetime import datetime_CAPI\n"
    )
    main = str(ROOT / "shapeshift" / "__main__.py")
    code = (
        f"import runpy, sys; sys.path[:0] = [{str(tmp_path)!r}]; "
        f"sys.argv = ['', 'info', {str(scene)!r}]; runpy.run_path({main!r}, run_name='__main__')"
    )
    ended = subprocess.run(
        [sys.executable, "-P", "-c", code], cwd=ROOT,
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "Interrupted.\n")


def test_the_environment_and_the_tests_can_be_interrupted(monkeypatch):
    """Only the program itself is started with Ctrl-C held back."""
    sys.path.insert(0, str(ROOT))
    try:
        import launch
    finally:
        sys.path.remove(str(ROOT))
    held = []

    def handed_over(*_):
        held.append(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ()))

    monkeypatch.setattr(launch, "hand_over", handed_over)
    monkeypatch.setattr("shapeshift.app.first_start.make_environment", handed_over)
    monkeypatch.chdir(ROOT)
    monkeypatch.setitem(sys.modules, "app.first_start", sys.modules["shapeshift.app.first_start"])
    monkeypatch.setattr("shapeshift.app.first_start.is_ready", lambda testing: False)
    try:
        launch.main(["test"])
        launch.main(["info", "x"])
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    assert held == [False, False, False, True]  # environment, tests, environment, program


@pytest.fixture
def settled():
    """As a program that is started from a shell has them; those of the tests come back."""
    before = {each: signal.getsignal(each) for each in ENDINGS}
    for each in ENDINGS:  # the tests may run under nohup
        usual = signal.default_int_handler if each == signal.SIGINT else signal.SIG_DFL
        signal.signal(each, usual)
    yield
    for each, handler in before.items():
        signal.signal(each, handler)


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_a_program_is_interrupted_by_what_ends_others(settled, name):
    number = getattr(signal, name)
    answer_endings()
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(number)
    signal.signal(number, signal.SIG_IGN)  # as nohup leaves it
    answer_endings()
    signal.raise_signal(number)


@pytest.mark.parametrize("number", ENDINGS)
def test_a_training_is_asked_once_and_interrupted_by_the_second(settled, number, capsys):
    answer_endings()
    with interrupts() as asked:
        signal.raise_signal(number)
        assert asked == [number] and "the work is kept" in capsys.readouterr().err
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
    with pytest.raises(KeyboardInterrupt):  # as before it
        signal.raise_signal(number)


def test_after_its_terminal_was_closed_a_program_can_still_write(monkeypatch):
    """Of a terminal whose other side is gone each write is an error; files are left as they are."""
    other, terminal = os.openpty()
    kept, written = os.pipe()
    with os.fdopen(terminal, "wb", 0) as screen, os.fdopen(written, "wb", 0) as file:
        monkeypatch.setattr(sys, "__stderr__", screen)
        monkeypatch.setattr(sys, "__stdout__", file)
        monkeypatch.setattr(sys, "__stdin__", None)
        os.close(other)
        with pytest.raises(OSError):
            os.write(terminal, b"lost")
        leave_terminal(signal.SIGTERM)
        with pytest.raises(OSError):
            os.write(terminal, b"lost")
        leave_terminal(signal.SIGHUP)
        assert os.write(terminal, b"lost") == 4
        file.write(b"kept")
        assert os.read(kept, 10) == b"kept"
    os.close(kept)


def test_a_command_that_is_terminated_ends_as_after_ctrl_c(scene):
    code = (
        "import os, signal, sys; from shapeshift.app import cli\n"
        "def end(options): os.kill(os.getpid(), signal.SIGTERM)\n"
        "import shapeshift.app.commands.info as info; info.run = end\n"
        f"sys.argv = ['shapeshift', 'info', {str(scene)!r}]; sys.exit(cli.main())"
    )
    ended = subprocess.run(
        [sys.executable, "-P", "-c", code], cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "Interrupted.\n")
