"""--cluster none: tasks one after the other on this machine, each in a process of its own."""

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
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import IO

from shapeshift.app.cluster.task import Task, is_of_code_here
from shapeshift.app.errors import UsageError
from shapeshift.app.progress import PERIOD, progress_bar
from shapeshift.runtime_models.files.whole_file import LOCKS, open_locked
from shapeshift.runtime_models.program import ROOT, is_installed

# Runs one task in a process of its own, on the machine where this is called.

START = (
    "import sys; sys.path[:0] = {paths!r}; "
    "from shapeshift.app.cluster.run_task import main; sys.exit(main())"
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


# What the tasks of a run are at: one bar over all of them, and their own sentences below it.

MOST_SHOWN = 3  # tasks whose words stand beside the bar


class Board:
    """Hears lines of tasks by name; made by `board`."""

    def __init__(self, show: Callable[..., None], say: Callable[[str], None]) -> None:
        self._show, self._say, self._lock = show, say, threading.Lock()
        self._now: dict[str, str] = {}  # what those under way said last

    def hear(self, name: str, command: str, line: str) -> None:
        """A line of a task's standard error, or of who runs it."""
        words = progress_words(line, command)
        if words is None:
            self._say(f"{name}: {line}")
        with self._lock:
            self._now[name] = self._now.get(name, "") if words is None else words
            self._update()

    def end(self, name: str) -> None:
        """The task is done, or has failed."""
        with self._lock:
            self._now.pop(name, None)
            self._update(advance=1)

    def _update(self, advance: int = 0) -> None:
        shown = [f"{name}: {words}" if words else name for name, words in self._now.items()]
        more = f"; {len(shown) - MOST_SHOWN} more" if len(shown) > MOST_SHOWN else ""
        self._show(description="; ".join(shown[:MOST_SHOWN]) + more, advance=advance)


Shown = Callable[[int, int], AbstractContextManager[Board]]  # of so many tasks, some done already


def board_of_words(hear: Callable[[str], None]) -> Shown:
    """Instead of a bar: words for a function, as they come."""

    def show(description: str, advance: int = 0) -> None:
        if description:
            hear(description)

    return lambda count, done: nullcontext(Board(show, hear))


@contextmanager
def board(count: int, done: int) -> Iterator[Board]:
    """A bar over so many tasks, of which some are done already."""
    with progress_bar() as bar:
        task = bar.add_task("starting", total=count, completed=done)

        def show(**facts) -> None:
            bar.update(task, **facts)

        def say(text: str) -> None:
            bar.console.print(text, soft_wrap=True)

        yield Board(show, say)


class Here:
    """Runs tasks without a cluster."""

    def __init__(self, shown: Shown = board) -> None:
        self.shown = shown

    def run(self, tasks: Sequence[Task]) -> None:
        """Returns when all are done.  A task that fails is said at once, and the others go on.

        Raises TaskFailed after the last one where any failed.
        """
        keys = check_tasks(tasks)
        failed: list[TaskFailed] = []
        open_tasks = [task for task in tasks if not task.is_done(keys[task.name])]
        with self.shown(len(tasks), len(tasks) - len(open_tasks)) as shown:
            for task in open_tasks:
                self._run_one(task, keys[task.name], shown, failed)
        raise_failed(failed, len(tasks))

    def _run_one(self, task: Task, key: str, shown: Board, failed: list[TaskFailed]) -> None:
        try:
            run_task(task, key, lambda line: shown.hear(task.name, task.argv[0], line))
        except TaskFailed as error:
            failed.append(error)
        shown.end(task.name)


def check_tasks(tasks: Sequence[Task]) -> dict[str, str]:
    """The key of each by name.  Raises ValueError where two share a name or a file."""
    names = [task.name for task in tasks]
    files = [path for task in tasks for path in task.writes]
    for words, what in ((names, "name"), (files, "file to write")):
        twice = {word for word in words if words.count(word) > 1}
        if twice:
            raise ValueError(f"two tasks have one {what}: {min(twice)}")
    return {task.name: task.key() for task in tasks}


def raise_failed(failed: Sequence[TaskFailed], count: int) -> None:
    """The first failure, and how many there were, where any was.  Raises TaskFailed."""
    if not failed:
        return
    more = f"  ({len(failed)} of {count} tasks failed.)" if len(failed) > 1 else ""
    raise TaskFailed(f"{failed[0]}{more}")


# The program as a task: it ends with whoever started it, and keeps what it has by then.
#
# It reads standard input, whose other end its parent holds.  Where that closes, because the parent
# wants so or was killed, this process is interrupted as by Ctrl-C, and after a while for good.

GRACE_S = 20.0  # to save what there is


def main() -> int:
    watch_parent()
    if len(sys.argv) > 1 and sys.argv[1].endswith(".py"):
        return run_script(sys.argv[1:])
    from shapeshift.app.cli import main as run_program

    return run_program()


def run_script(argv: list[str]) -> int:
    """A program of tools/ instead of a command of this one, as Python itself starts it."""
    import runpy

    sys.argv[:] = argv
    sys.path.insert(0, os.path.dirname(argv[0]))
    runpy.run_path(argv[0], run_name="__main__")
    return 0


def watch_parent() -> None:
    """From the main thread, before anything else."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # workers ignore it, and hand that on
    threading.Thread(target=end_with_parent, name="parent", daemon=True).start()


def end_with_parent() -> None:
    while os.read(sys.stdin.fileno(), 4096):
        pass
    interrupt()
    time.sleep(GRACE_S)
    end_group()


def interrupt() -> None:
    if os.name == "nt":
        import _thread

        _thread.interrupt_main()
    else:  # the main thread may be asleep
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)


def end_group() -> None:
    """This process with all that it has started."""
    if hasattr(os, "killpg") and os.getpgrp() == os.getpid():
        os.killpg(os.getpgrp(), signal.SIGKILL)
    os._exit(1)
