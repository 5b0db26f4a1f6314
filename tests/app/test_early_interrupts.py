"""Ctrl-C before the program can answer: it waits, and is answered as ever."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from shapeshift.app.first_start import is_ready
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
