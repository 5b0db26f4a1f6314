"""Runs one task in a process of its own, on the machine where this is called."""

import contextlib
import json
import os
import queue
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import IO

from shapeshift.app.cluster.child import GRACE_S
from shapeshift.app.cluster.task import Task, is_of_code_here
from shapeshift.app.errors import UsageError
from shapeshift.app.program import ROOT, is_installed
from shapeshift.app.progress import PERIOD
from shapeshift.runtime_models.files.whole_file import LOCKS, open_locked

START = (
    "import sys; sys.path[:0] = {paths!r}; "
    "from shapeshift.app.cluster.child import main; sys.exit(main())"
)  # -P leaves the current folder out
LINES_EVERY_S = 2.0  # of a task's progress
LOOK_S = 0.5  # between looks at what else may end a task
CREATE_NO_WINDOW = 0x08000000  # of Windows
BAD_INPUT, FAULT = 2, 3  # exit codes with a sentence
OTHER_CODE = (
    "the program's code on {host} is another than where and when the command began that hands out "
    "the tasks; start it again, with the same code on all machines."
)
Hear = Callable[[str], None]  # a line of the task's standard error


class TaskFailed(UsageError):
    """A task ended otherwise than well; the message is its own last sentence."""


class TaskStopped(Exception):
    """A task was ended because nobody wants it any more; its checkpoint stays."""


def run_task(task: Task, key: str, hear: Hear, wanted: Callable[[], bool] = lambda: True) -> None:
    """Returns when all that the task writes is there, at once where it was before.

    key: `task.key()` of who hands it out.  Raises TaskFailed, and TaskStopped once not `wanted`;
    also after Ctrl-C no process of the task is left.
    """

    def in_a_process(words: tuple[str, ...], note: int) -> bool:
        child = start(task, words, note)
        said = follow(child, task.argv[0], hear, wanted)
        if child.returncode != 0:
            raise TaskFailed(f"{task.name}: {why_failed(task, child.returncode, said)}")
        return True

    do_once(task, key, in_a_process, hear, wanted)


def do_once(
    task: Task, key: str, work: Callable[[tuple[str, ...], int], bool], hear: Hear,
    wanted: Callable[[], bool] = lambda: True,
) -> bool:  # fmt: skip
    """Whether the task is done: before, by another attempt, or now by `work`.

    work: given the words of this attempt, and the handle of its note; False where it was ended
    early.  The rest as run_task.
    """
    if task.is_done(key):
        return True
    if not is_of_code_here(key):
        raise TaskFailed(f"{task.name}: {OTHER_CODE.format(host=socket.gethostname())}")
    for path in (task.writes[0], str(task.begun_note)):
        os.makedirs(os.path.dirname(path), exist_ok=True)
    with alone(task, hear, wanted) as note:
        if task.is_done(key):
            return True
        begun = read_key(note)
        words = task.words(begun if begun == key else "")
        write_key(note, key)
        if not work(words, note.fileno()):
            return False
        lacking = [path for path in task.writes if not os.path.exists(path)]
        if lacking:
            raise TaskFailed(f"{task.name}: ended well, yet {lacking[0]} is not there.")
        if is_of_code_here(key):
            task.note_done(key)
        else:  # nobody knows which parts of it were done by which
            hear("the program's code was changed meanwhile: a later start does it anew")
        task.begun_note.unlink(missing_ok=True)
    return True


def why_failed(task: Task, code: int, said: str) -> str:
    """A sentence: the task's own where it refused something, else how it ended and what it said."""
    if said and code in (BAD_INPUT, FAULT):
        return said.removeprefix(f"shapeshift {task.argv[0]}: ")
    how = f"ended by signal {-code}" if code < 0 else f"ended with code {code}"
    return f"{how}; its last words: {said}" if said else f"{how}."


@contextmanager
def alone(task: Task, hear: Hear, wanted: Callable[[], bool]) -> Iterator[IO[str]]:
    """The note of an attempt, once no other attempt at this task lives.

    One may: the worker that started it was killed, or cut off from the others.
    """
    note, said = open_locked(task.begun_note), False
    while note is None:
        if not said:
            hear("waiting until an earlier attempt at it has ended")
            said = True
        time.sleep(LOOK_S)
        if not wanted():
            raise TaskStopped(task.name)
        note = open_locked(task.begun_note)
    with note:
        yield note


def read_key(note: IO[str]) -> str:
    """The key of the attempt before; "" where there was none, or its note is not whole."""
    note.seek(0)
    with contextlib.suppress(ValueError):
        noted = json.loads(note.read())
        if isinstance(noted, dict) and isinstance(noted.get("key"), str):
            return noted["key"]
    return ""


def write_key(note: IO[str], key: str) -> None:
    """In place: the file is the lock."""
    note.seek(0)
    note.truncate()
    note.write(json.dumps({"key": key}) + "\n")
    note.flush()


def start(task: Task, words: tuple[str, ...], note: int) -> subprocess.Popen[bytes]:
    """The program in a process group of its own, which also holds the lock of its note."""
    paths = [] if is_installed() else [str(ROOT)]
    command = [sys.executable, "-P", "-c", START.format(paths=paths), *words]
    environment = os.environ | {PERIOD: str(LINES_EVERY_S), "TERM": "dumb"}
    environment["SHAPESHIFT_TASK"] = task.name
    try:
        return subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            env=environment, start_new_session=True, pass_fds=[note] if LOCKS else [],
            creationflags=CREATE_NO_WINDOW if sys.platform == "win32" else 0,
        )  # fmt: skip
    except OSError as error:
        raise TaskFailed(f"{task.name}: could not be started ({error.strerror}).") from None


def follow(
    child: subprocess.Popen[bytes], command: str, hear: Hear, wanted: Callable[[], bool]
) -> str:
    """Its last line that is no progress, once it has ended; all are heard in this thread."""
    lines: queue.SimpleQueue[str] = queue.SimpleQueue()  # "" is the end
    last = ""

    def read() -> None:
        assert child.stderr is not None
        with child.stderr:
            for raw in child.stderr:
                if line := raw.decode("utf-8", "replace").strip():
                    lines.put(line)
        lines.put("")

    def hear_next(wait_s: float) -> None:
        nonlocal last
        with contextlib.suppress(queue.Empty):
            if line := lines.get(timeout=wait_s):
                last = line if progress_words(line, command) is None else last
                hear(line)
            else:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    child.wait(wait_s)

    reader = threading.Thread(target=read, name="a task's lines", daemon=True)
    reader.start()
    try:
        while child.poll() is None:
            hear_next(LOOK_S)
            if not wanted():
                raise TaskStopped(command)
    finally:
        end(child)
        reader.join(LOOK_S)  # longer only where others hold the pipe
        while not lines.empty():
            hear_next(0)
    return last


def progress_words(line: str, command: str) -> str | None:
    """What a line of app/progress.py says of a command; None of any other line."""
    if not (line.startswith(f"{command}: ") and line.endswith(" min)")):
        return None
    return line.removeprefix(f"{command}: ").rpartition(" (")[0]


def end(child: subprocess.Popen[bytes]) -> None:
    """Lets it save what there is; then, or at once after another Ctrl-C, all of its group ends."""
    assert child.stdin is not None
    with contextlib.suppress(OSError):
        child.stdin.close()
    try:
        child.wait(GRACE_S)
    except subprocess.TimeoutExpired:
        pass
    finally:
        if hasattr(os, "killpg"):
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(child.pid, signal.SIGKILL)
        elif child.poll() is None:
            child.kill()
        child.wait()
