"""The one gate for outside parsers: a stranger's file is read by a process with limits.

`ask("mesh", path, words)` gives what the door's function (doors.py) makes of the file.  The process
loads the package once and serves many files; one that is cut off is replaced.  A file may take the
processor time of its size and the memory of its account, and no more: what goes beyond is one
sentence.
"""

import atexit
import os
import queue
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from shapeshift.runtime_models.files.memory import VARIABLE
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.files.whole_file import temporary_folder
from shapeshift.runtime_models.gate.doors import DOORS, Door
from shapeshift.runtime_models.gate.limits import MEMORY, TIME, resident
from shapeshift.runtime_models.gate.wire import receive, send
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.program import package_words

CHILD = Path(__file__).with_name("child.py")
TICK_S = 0.05  # between looks at a process that works
WAIT = 20  # times its processor time that a process may take on a busy machine
START_S = 120  # to start and to load a package
PIPE = 1 << 20  # bytes that may wait in a pipe
IDLE = 1  # processes of a door that are kept
MOST_FILES = 500  # that one process serves: what libraries leave behind goes with it
OWN = ("PXR_", "USD_", "TF_", "OMP_", "FFREPORT", "GDK_")  # words that change a library
Tell = Callable[[dict], None]


class Ended(Exception):
    """The process is gone; `time`, `memory` or `crash` says why."""


class Process:
    """One process behind the gate."""

    def __init__(self) -> None:
        words = {k: v for k, v in os.environ.items() if not k.startswith(OWN)}
        # One thread, one arena: each further one would reserve memory that no file asked for.
        words |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "1",
                  "PXR_WORK_THREAD_LIMIT": "1", "ORT_DISABLE_TELEMETRY": "1"}  # fmt: skip
        python = sys.executable or ""
        if sys.platform == "win32":  # the environment's own python.exe would start another one
            python, words["__PYVENV_LAUNCHER__"] = getattr(sys, "_base_executable", python), python
        package = sys.modules[__name__.partition(".")[0]]  # of which this module is a part
        program = str(Path(package.__file__ or "").with_name("__main__.py"))
        # -P: the current folder's modules are not to stand in for those of packages; nor, where
        # this process was started by -I, those of PYTHONPATH.
        alone = ["-I"] if sys.flags.isolated else []
        try:
            self.child = subprocess.Popen(
                [python, "-P", *alone, str(CHILD), program], stdin=subprocess.PIPE,
                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=words,
            )  # fmt: skip
        except OSError as why:
            raise BadFile(
                f"the process that would read the file does not start ({why.strerror or why}); "
                f"it would be {python or 'of no Python that is known'}"
            ) from None
        widen(self.child.stdin)
        widen(self.child.stdout)
        self.served = 0
        self.owner = os.getpid()
        self.wanted: queue.SimpleQueue[int | None] = queue.SimpleQueue()
        self.answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        heard = (self.child.stdout, self.wanted, self.answers)
        threading.Thread(target=listen, args=heard, daemon=True).start()

    def ask(self, request: dict, patience: float, most: int, hear: Tell | None) -> dict:
        """The answer to a request.  Raises Ended, BadFile where nothing can be limited."""
        assert self.child.stdin is not None
        try:
            send(self.child.stdin, request)  # type: ignore[arg-type]
        except OSError:
            raise Ended("crash") from None
        self.wanted.put(most)
        limit, deadline = 0, time.monotonic() + START_S
        while True:
            try:
                said = self.answers.get(timeout=TICK_S)
            except queue.Empty:
                if time.monotonic() > deadline:
                    raise Ended("time") from None
                if limit and (resident(self.child.pid) or 0) > limit:
                    raise Ended("memory") from None
                continue
            if said is None:
                raise Ended(self.cause())
            if "armed" in said:
                limit = self.limit_of(said)
                deadline = time.monotonic() + patience
            elif "tell" not in said:
                self.served += 1
                return said
            elif hear is not None:
                hear(said["tell"])

    def limit_of(self, said: dict) -> int:
        """Bytes in memory that the parent watches for, 0: none.  Raises BadFile."""
        if TIME in said["armed"] and MEMORY in said["armed"]:
            return 0
        if TIME not in said["armed"] or resident(self.child.pid) is None:
            raise BadFile(
                "this system sets no limits of time and memory to the process that would read the "
                "file, so it is not read"
            )
        return int(said["most"])

    def cause(self) -> str:
        """Why the process has ended."""
        import signal

        try:
            code = self.child.wait(1.0)
        except subprocess.TimeoutExpired:  # it lives, and what it said was no answer
            return "crash"
        timed = {-getattr(signal, name, 0) for name in ("SIGPROF", "SIGXCPU")} - {0}
        quota = 1816  # Windows: ERROR_NOT_ENOUGH_QUOTA, of a job's time
        return "time" if code in timed | {quota} else "crash"

    def end(self) -> None:
        if self.owner != os.getpid():  # a fork's copy: the process is its parent's
            return
        self.child.kill()
        self.child.wait()
        self.wanted.put(None)
        for stream in (self.child.stdin, self.child.stdout):
            try:
                if stream is not None:
                    stream.close()
            except OSError:  # what waited to be written has no reader
                pass


def widen(stream: Any) -> None:
    """Lets more wait in a pipe where the system can: fewer turns of the processor for a file."""
    try:
        import fcntl

        fcntl.fcntl(stream, fcntl.F_SETPIPE_SZ, PIPE)
    except (ImportError, AttributeError, OSError):  # not Linux, or more pipes than a user may have
        pass


def listen(
    pipe: BinaryIO, wanted: "queue.SimpleQueue[int | None]", answers: "queue.SimpleQueue[Any]"
) -> None:
    """Puts what a process says into the queue, up to its answer; None where it ends before.

    wanted: the most bytes of each; what nobody asked for stays in the pipe.
    """
    while (most := wanted.get()) is not None:
        more = True
        while more:
            try:
                said = receive(pipe, most)
                more = "armed" in said or "tell" in said
            except Exception:  # of what a process says that its file has taken over: any
                answers.put(None)
                return
            answers.put(said)
            del said  # its arrays are the reader's


idle_processes: dict[str, list[Process]] = {}
_lock = threading.Lock()


def ask(
    name: str, path: Path, words: list, *, memory: int | None = None, size: int | None = None,
    hear: Tell | None = None,
) -> Any:  # fmt: skip
    """What a door's function gives for a file.  Raises BadFile, one sentence.

    words: what the function is given; memory: bytes that the file may take, the door's own where
    none are said; size: of the file, where it is not that of `path`.
    """
    door = DOORS[name]
    size = path.stat().st_size if size is None else size
    seconds = seconds_of(door, size)
    memory = door.memory if memory is None else memory
    process, kept = taken(name), False
    try:
        try:
            answer = asked(process, door, words, seconds, memory, hear)
        except Ended as ended:
            if str(ended) != "crash" or not process.served:
                raise
            process.end()  # perhaps a file before has left it so: once more by a fresh one
            process = Process()
            answer = asked(process, door, words, seconds, memory, hear)
        kept = "memory" not in answer
    except Ended as ended:
        raise cut_off(door, path, size, seconds, str(ended)) from None
    finally:
        if kept:
            let_go(name, process)
        else:
            process.end()
    return value_of(answer, door, path, size)


def asked(
    process: Process, door: Door, words: list, seconds: float, memory: int, hear: Tell | None,
    method: str = "",
) -> dict:  # fmt: skip
    request = {
        "imports": door.imports, "target": door.target, "words": words, "method": method,
        "seconds": seconds, "memory": memory, "tells": door.tells,
    }  # fmt: skip
    return process.ask(request, WAIT * seconds, memory, hear)


def seconds_of(door: Door, size: int) -> float:
    """Of processor time that a file of so many bytes may take."""
    return door.seconds + door.seconds_a_byte * size


def value_of(answer: dict, door: Door, path: Path, size: int) -> Any:
    """What an answer holds.  Raises BadFile for all but a value."""
    where = path_end(path)
    if "done" in answer:
        return answer["done"]
    if "bad" in answer:
        raise BadFile(answer["bad"])
    if "refused" in answer:
        raise BadFile(f"{where}: {answer['refused']}; {door.advice}")
    if "absent" in answer:
        raise BadFile(
            f"{where} needs the package {door.package}, which does not load "
            f"({str(answer['absent'])[:80]}): {package_words(door.package)} installs it"
        )
    raise cut_off(door, path, size, 0.0, "memory")


def cut_off(door: Door, path: Path, size: int, seconds: float, why: str) -> BadFile:
    """The sentence for a file at which the process was ended, or ended itself."""
    where = path_end(path)
    if why == "time":
        return BadFile(
            f"{where}: reading it took over {seconds:.3g} s of processor time, more than a file of "
            f"{size:,} bytes needs; it is damaged, {door.advice}"
        )
    if why == "memory":
        return BadFile(
            f"{where}: reading it takes more memory than a file of {size:,} bytes may; it is "
            f"damaged, or --memory or {VARIABLE} (GB) allows more"
        )
    return BadFile(
        f"{where}: {door.package} ends on it, or wants more memory than its {size:,} bytes may "
        f"take; {door.advice}, or --memory or {VARIABLE} (GB) allows more"
    )


def taken(name: str) -> Process:
    """A process of a door that waits, or a new one."""
    with _lock:
        waiting = idle_processes.setdefault(name, [])
        while waiting:
            process = waiting.pop()
            if process.owner == os.getpid() and process.child.poll() is None:
                return process
            process.end()
    return Process()


def put_back(name: str, process: Process) -> None:
    with _lock:
        waiting = idle_processes.setdefault(name, [])
        if len(waiting) < IDLE:
            waiting.append(process)
            return
    process.end()


@contextmanager
def in_utf8(path: Path) -> Iterator[str]:
    """A name of a file for libraries that take UTF-8 alone: its own, or that of a link to it.

    Where the folder alone has another name, the link is to that: files beside are found by it.
    Raises BadFile where there can be no link.
    """
    if is_utf8(str(path)):
        yield str(path)
        return
    with ExitStack() as held:
        try:
            folder = held.enter_context(temporary_folder())
            if is_utf8(path.name):
                (link := folder / "beside").symlink_to(path.parent, target_is_directory=True)
                link /= path.name
            else:
                link = folder / f"file{path.suffix if is_utf8(path.suffix) else ''}"
                link.symlink_to(path)
        except OSError as why:
            raise no_link(path, why) from None
        yield str(link)


def no_link(path: Path, why: OSError) -> BadFile:
    return BadFile(
        f"{path_end(path)}: its name is no UTF-8, and no link of another name can be made "
        f"({why.strerror}); rename it"
    )


def is_utf8(name: str) -> bool:
    try:
        name.encode()
    except UnicodeEncodeError:  # bytes that Python keeps as halves of pairs
        return False
    return True


class Held:
    """A process that keeps what it has opened of one file, until it is closed."""

    def __init__(self, name: str, path: Path, words: list, memory: int) -> None:
        """Opens the file by the door's class; `facts` is what that says of it.  Raises BadFile."""
        self.door, self.path = DOORS[name], path
        self.size = path.stat().st_size
        self.process: Process | None = taken(name)
        self._turn = threading.Lock()  # one pipe, whoever asks
        # Not by __del__: in a ring of garbage the pipes may be closed before it is called.
        self._forgotten = weakref.finalize(self, let_go, name, self.process)
        self._forgotten.atexit = False  # the process ends with its pipe
        self.facts = self._ask(words, "", seconds_of(self.door, self.size), memory)

    def call(self, method: str, *words: Any, seconds: float, memory: int) -> Any:
        """What a method of the opened object gives.  Raises BadFile.

        memory: bytes that it may take together with what was opened.
        """
        with self._turn:
            return self._ask(list(words), method, seconds, memory)

    def _ask(self, words: list, method: str, seconds: float, memory: int) -> Any:
        if self.process is None:
            raise BadFile(f"{path_end(self.path)}: it was cut off before; {self.door.advice}")
        if self.process.owner != os.getpid():  # a fork's copy: two would read one pipe
            raise BadFile(f"{path_end(self.path)}: another process has opened it; open it again")
        try:
            answer = asked(self.process, self.door, words, seconds, memory, None, method)
        except Ended as ended:
            self.close(for_good=True)
            raise cut_off(self.door, self.path, self.size, seconds, str(ended)) from None
        except BaseException:
            self.close(for_good=True)
            raise
        if ("done" not in answer and not method) or "memory" in answer:
            self.close(for_good="memory" in answer)
        return value_of(answer, self.door, self.path, self.size)

    def close(self, for_good: bool = False) -> None:
        """Lets go of the file; for_good: the process, which serves others else, is ended."""
        process, self.process = self.process, None
        if process is None:
            return
        self._forgotten.detach()
        if for_good:
            process.end()
        else:
            let_go(self.door.name, process)


def let_go(name: str, process: Process) -> None:
    """Another file may have the process."""
    if process.served >= MOST_FILES:
        process.end()
    else:
        put_back(name, process)


def end_all() -> None:
    """Ends the processes that wait."""
    with _lock:
        for process in [each for waiting in idle_processes.values() for each in waiting]:
            process.end()
        idle_processes.clear()


atexit.register(end_all)
