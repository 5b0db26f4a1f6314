"""A command of this program as a process of its own, for long work beside the window."""

import atexit
import os
import re
import subprocess
import sys
import threading
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import IO

from shapeshift.app.program import ROOT, is_installed
from shapeshift.app.progress import PERIOD

LINES_EVERY_S = 0.3  # of progress
START = (
    "import sys; sys.path[:0] = {paths!r}; "
    "from shapeshift.app.cli import main; sys.exit(main())"
)  # -P leaves the current folder out
COUNT = re.compile(r"(\d+) of (\d+)")
PERCENT = re.compile(r"(\d+) ?%")
PATIENCE_S = 5.0  # for a process that is told to end
CREATE_NO_WINDOW = 0x08000000  # of Windows


class ProgramChild:
    """Starts at once; `poll` it once a frame.

    It is ended with this program.  What it has written by then stays whole, as after Ctrl-C.
    """

    def __init__(self, words: Sequence[str]) -> None:
        """words: a command with its options.  Raises OSError where it cannot be started."""
        paths = [] if is_installed() else [str(ROOT)]
        command = [sys.executable, "-P", "-c", START.format(paths=paths), *words]
        environment = os.environ | {PERIOD: str(LINES_EVERY_S), "TERM": "dumb"}
        self._child = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            env=environment, creationflags=CREATE_NO_WINDOW if sys.platform == "win32" else 0,
        )  # fmt: skip
        assert self._child.stderr is not None
        self._name = words[0]
        self.progress = ("starting", 0.0)  # what is being done, part done 0..1
        self.said = ""  # its last line that is no progress
        self.cancelled = False
        self._reader = threading.Thread(
            target=self._read, args=(self._child.stderr,), name="child", daemon=True
        )
        self._reader.start()
        atexit.register(self.end)

    def _read(self, stream: IO[bytes]) -> None:
        with stream:
            for line in stream:
                self._hear(line.decode("utf-8", "replace").strip())

    def _hear(self, line: str) -> None:
        """A line of progress, as app/progress.py writes it, or a sentence."""
        found = re.fullmatch(rf"{re.escape(self._name)}: (.*) \(\d+ min\)", line)
        if not found:
            self.said = line or self.said
            return
        words = found[1]
        part = self.progress[1]
        if count := COUNT.search(words):
            part = int(count[1]) / max(int(count[2]), 1)
        elif percent := PERCENT.search(words):
            part = int(percent[1]) / 100
        self.progress = (words, min(part, 1.0))

    @property
    def running(self) -> bool:
        """Whether it is under way still."""
        return self._child.poll() is None

    @property
    def code(self) -> int | None:
        """Its exit code; None while it runs, or while its last words are on their way."""
        if self.running or self._reader.is_alive():
            return None
        return self._child.returncode

    def cancel(self) -> None:
        """Asks it to end; what is drawn stays for the same command later."""
        self.cancelled = True
        if self.running:
            self._child.terminate()

    def end(self) -> None:
        """Ends it, and waits until it has."""
        atexit.unregister(self.end)
        self.cancel()
        try:
            self._child.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._child.kill()
            self._child.wait()
        self._reader.join(PATIENCE_S)

    def problem(self) -> str:
        """Why it did not end well, one sentence; "" where it did."""
        if self.code == 0:
            return ""
        before = f"shapeshift {self._name}: "
        return self.said.removeprefix(before) or f"{self._name} ended with code {self.code}."


class ChildWork(ABC):
    """Work of the window that one command at a time does."""

    def __init__(self) -> None:
        self._child: ProgramChild | None = None

    @property
    def running(self) -> bool:
        return self._child is not None

    @property
    def progress(self) -> tuple[str, float]:
        """What is being done, part done."""
        return self._child.progress if self._child else ("", 0.0)

    def cancel(self) -> None:
        """Ends it; what the command keeps of it stays."""
        if self._child is not None:
            self._child.cancel()

    def poll(self) -> bool:
        """Once a frame: says how it ended; True while it is under way."""
        child = self._child
        if child is None or child.code is None:
            return child is not None
        self._child = None
        if child.cancelled:
            self.say_left()
        elif problem := child.problem():
            self.say_failed(problem)
        else:
            self.show(child)
        return True

    @abstractmethod
    def say_left(self) -> None:
        """That it was cancelled."""

    @abstractmethod
    def say_failed(self, why: object) -> None:
        """A sentence of the command, or of why it could not be started."""

    @abstractmethod
    def show(self, child: ProgramChild) -> None:
        """What was made."""
