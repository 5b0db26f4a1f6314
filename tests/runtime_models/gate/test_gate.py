"""The gate by stand-ins that sleep, allocate, crash: what a damaged file makes a parser do."""

import ctypes
import gc
import os
import signal
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.gate import doors, gate, limits
from shapeshift.runtime_models.gate.gate import Held, ask
from shapeshift.runtime_models.model import BadFile

MB = 1 << 20
PARSER = """
import os, sys, time
import numpy as np
from shapeshift.runtime_models.gate.refusal import Unreadable
from shapeshift.runtime_models.model import BadFile

def read(what, *words, hear=None):
    print("noise of a library")  # reaches nobody: the pipe is not standard output
    if what == "spin":
        while True: pass
    if what == "exit":
        raise SystemExit(0)
    if what == "sleep":
        time.sleep(60)
    if what == "allocate":
        return len(bytearray(words[0]))
    if what == "answer":  # little is taken, much is given
        return np.broadcast_to(np.zeros(1), words[0])
    if what == "abort":
        os.abort()
    if what == "refuse":
        raise Unreadable("no such thing\\nas a file")
    if what == "bad":
        raise BadFile("a whole sentence")
    if what == "raise":
        raise KeyError("odd")
    if what == "recurse":
        return read("recurse")
    if what == "pid":
        return os.getpid()
    if what == "garbage":
        for pipe in range(3, 9):
            try: os.write(pipe, b"x" * 400)
            except OSError: pass
        time.sleep(60)
    if what == "tell":
        return [hear(done=i) for i in range(3)] and "told"
    return list(words)

class Opened:
    def __init__(self, start): self.sum = start
    def facts(self): return {"start": self.sum}
    def add(self, array): self.sum = self.sum + float(array.sum()); return self.sum
    def spin(self):
        while True: pass
"""


@pytest.fixture
def served(tmp_path, monkeypatch):
    """A door whose parser is PARSER, in the processes that the test starts."""
    (tmp_path / "stand_in_parser.py").write_text(PARSER)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    door = doors.Door("test", "files", "numpy", ("numpy",), "stand_in_parser:read", 0.3, 1e-3,
                      100 * MB, tells=True)  # fmt: skip
    held = doors.Door("held", "files", "numpy", ("numpy",), "stand_in_parser:Opened", 0.3, 0.0,
                      100 * MB)  # fmt: skip
    absent = doors.Door("absent", "files", "no-such", ("no_such_package",), "x:y", 1, 0, MB)
    for each in (door, held, absent):
        monkeypatch.setitem(gate.DOORS, each.name, each)
    path = tmp_path / "file.bin"
    path.write_bytes(b"0123456789")
    yield path
    for process in gate.idle_processes.pop("test", []):
        process.end()


def test_values_come_back_as_they_are(served):
    given = [1, "ü\udcff", None, [2.5, {"a": [True]}], b"\0\xff", b""]
    assert ask("test", served, ["echo", *given]) == given
    for kind in ("<f4", ">i2", "?", "<U3"):
        array = np.ones((2, 0, 3) if kind == "?" else (2, 3), kind)
        (back,) = ask("test", served, ["echo", array])
        assert back.dtype == array.dtype and back.shape == array.shape
        np.testing.assert_array_equal(back, array)
    told = []
    assert ask("test", served, ["tell"], hear=told.append) == "told"
    assert told == [{"done": i} for i in range(3)]


def test_one_process_serves_many_files_and_is_replaced_when_it_ends(served):
    first = ask("test", served, ["pid"])
    assert ask("test", served, ["pid"]) == first
    for word in ("refuse", "bad", "raise"):  # a bad file costs no process
        with pytest.raises(BadFile):
            ask("test", served, [word])
    assert ask("test", served, ["pid"]) == first
    for word in ("abort", "exit"):
        with pytest.raises(BadFile, match="ends on it"):
            ask("test", served, [word])
    assert ask("test", served, ["pid"]) != first


def test_a_process_that_died_of_an_earlier_file_is_not_held_against_the_next(served):
    process = ask("test", served, ["pid"])
    os.kill(process, signal.SIGSTOP)  # alive when it is taken, dead before it answers
    threading.Timer(0.3, os.kill, [process, signal.SIGKILL]).start()
    assert ask("test", served, ["echo", 3]) == [3]


@pytest.mark.parametrize(
    ("word", "sentence"),
    [
        ("refuse", "file.bin: no such thing as a file; copy it again."),
        ("bad", "a whole sentence."),
        ("raise", "file.bin: cannot be read ('odd'); copy it again."),
    ],
)
def test_what_a_reader_says_is_one_sentence(served, word, sentence):
    with pytest.raises(BadFile) as refusal:
        ask("test", served, [word])
    assert str(refusal.value).endswith(sentence)


@pytest.mark.parametrize("word", ["spin", "recurse"])
def test_time_and_depth_have_an_end(served, word):
    """0.3 s and 1e-3 s a byte of ten bytes: 0.31 s of processor time."""
    begun = time.monotonic()
    with pytest.raises(BadFile, match=r"over 0\.31 s|more memory"):
        ask("test", served, [word])
    assert time.monotonic() - begun < 10


def test_who_sleeps_is_ended_after_twenty_times_its_time(served, monkeypatch):
    monkeypatch.setattr(gate, "WAIT", 2)
    with pytest.raises(BadFile, match=r"over 0\.31 s of processor time"):
        ask("test", served, ["sleep"])


def test_memory_has_an_end(served, monkeypatch):
    """Half of the budget is given, twice of it is refused, in either direction of the pipe."""
    monkeypatch.setitem(gate.DOORS, "test", replace(gate.DOORS["test"], seconds=30.0))  # slow pages
    assert ask("test", served, ["allocate", 50 * MB]) == 50 * MB
    for words in (["allocate", 200 * MB], ["answer", 25 * MB]):
        with pytest.raises(BadFile, match="more memory"):
            ask("test", served, words)
    assert ask("test", served, ["allocate", 200 * MB], memory=300 * MB) == 200 * MB


def test_garbage_in_the_pipe_is_a_file_that_cannot_be_read(served):
    with pytest.raises(BadFile, match="ends on it"):
        ask("test", served, ["garbage"])


def test_a_missing_package_is_said(served):
    with pytest.raises(BadFile, match=r"needs the package no-such.*pip install no-such"):
        ask("absent", served, [])


def test_without_limits_a_file_is_not_read(served, monkeypatch):
    process = ask("test", served, ["pid"])
    assert process
    monkeypatch.setattr(gate, "TIME", "no such limit")
    with pytest.raises(BadFile, match="sets no limits of time and memory"):
        ask("test", served, ["echo"])


def test_where_the_kernel_limits_no_memory_the_parent_looks_on(served, monkeypatch):
    """As on macOS: resident bytes of the process, which this system tells as well."""
    monkeypatch.setattr(gate, "MEMORY", "not by the kernel")
    monkeypatch.setattr(gate.Process, "limit_of", seen := watched_limit())
    with pytest.raises(BadFile, match="more memory"):
        ask("test", served, ["allocate", 90 * MB], memory=95 * MB)
    assert seen.limits == [20 * MB]


class watched_limit:
    """limit_of with 20 MB as the bound, less than the kernel's."""

    def __init__(self):
        self.limits = []

    def __get__(self, process, kind):
        def limit_of(said):
            self.limits.append(20 * MB)
            return 20 * MB

        return limit_of


def test_ctrl_c_is_answered_while_a_file_is_read(served):
    ask("test", served, ["pid"])
    begun = time.monotonic()
    threading.Timer(0.3, signal.raise_signal, [signal.SIGINT]).start()
    with pytest.raises(KeyboardInterrupt):
        ask("test", served, ["sleep"])
    assert time.monotonic() - begun < 1.3


def test_threads_have_processes_of_their_own(served):
    found = []

    def work():
        found.append(ask("test", served, ["pid"]))

    threads = [threading.Thread(target=work) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 2
    assert len(gate.idle_processes["test"]) == gate.IDLE


def test_what_is_held_open_has_one_budget_of_memory_and_time_for_each_call(served):
    held = Held("held", served, [2.0], 50 * MB)
    assert held.facts == {"start": 2.0}
    may = {"seconds": 0.3, "memory": 50 * MB}
    assert held.call("add", np.ones(5), **may) == 7.0
    assert held.call("add", np.ones(5), **may) == 12.0
    with pytest.raises(BadFile, match=r"over 0\.3 s"):
        held.call("spin", **may)
    with pytest.raises(BadFile, match="cut off before"):
        held.call("add", np.ones(5), **may)


def test_threads_that_hold_one_file_take_turns(served):
    """Answers that are mixed up would be a crash or a wrong sum."""
    held = Held("held", served, [0.0], 50 * MB)
    found = []

    def work():
        for _ in range(20):
            found.append(held.call("add", np.ones(1), seconds=0.3, memory=50 * MB))

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    held.close(for_good=True)
    assert sorted(found) == list(range(1, 61))


def test_a_fork_s_copy_leaves_the_pipe_alone(served, monkeypatch):
    held = Held("held", served, [2.0], 50 * MB)
    held.process.owner += 1
    with pytest.raises(BadFile, match="another process has opened it"):
        held.call("add", np.ones(1), seconds=0.3, memory=50 * MB)
    held.process.owner -= 1
    assert held.call("add", np.ones(1), seconds=0.3, memory=50 * MB) == 3.0
    held.close(for_good=True)


@pytest.mark.skipif(not hasattr(signal, "SIGPROF"), reason="signals of time are POSIX's")
def test_a_parent_that_ignores_signals_of_time_takes_no_limit_away(served, monkeypatch):
    monkeypatch.setattr(gate, "WAIT", 200)
    before = signal.signal(signal.SIGPROF, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGXCPU])
    try:
        begun = time.monotonic()
        with pytest.raises(BadFile, match=r"over 0\.31 s"):
            ask("test", served, ["spin"])
        assert time.monotonic() - begun < 20  # not 200 times 0.31 s
    finally:
        signal.signal(signal.SIGPROF, before)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGXCPU])


def test_without_proc_the_kernel_s_own_count_is_the_start(monkeypatch, tmp_path):
    """At least what lies in memory now; 0 would limit the process below what it has."""
    if sys.platform in ("win32", "darwin"):
        pytest.skip("have counts of their own")
    there = limits.resident(os.getpid())
    monkeypatch.setattr(limits, "STATM", tmp_path / "no" / "statm")
    assert limits.own_bytes() >= there * 0.9


def test_a_process_that_does_not_start_is_said(served, monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "executable", str(tmp_path / "no-python"))
    with pytest.raises(BadFile, match="does not start"):
        ask("test", served, ["pid"])


def test_what_is_forgotten_lets_go_of_its_process(served):
    """Also in a ring of garbage, whose parts are closed in any order."""
    ring = [Held("held", served, [2.0], 50 * MB)]
    process = ring[0].process.child.pid
    ring.append(ring)
    del ring
    gc.collect()
    again = Held("held", served, [3.0], 50 * MB)
    assert again.process.child.pid == process
    assert again.call("add", np.ones(5), seconds=0.3, memory=50 * MB) == 8.0
    again.close()
    gate.end_all()


def test_the_structures_of_windows_have_its_sizes():
    """Of 64 bits, by the headers winnt.h and psapi.h."""
    assert ctypes.sizeof(limits.extended_limits()) == 144
    assert ctypes.sizeof(limits.memory_counters()) == 72


def test_a_job_object_is_given_time_and_memory(monkeypatch):
    """Windows' own functions by a stand-in that keeps what it is told."""
    told = {}

    class Kernel:
        CreateJobObjectW = staticmethod(lambda *_: 7)
        GetCurrentProcess = staticmethod(lambda: 9)

        @staticmethod
        def AssignProcessToJobObject(job, this):
            return 1

        @staticmethod
        def K32GetProcessMemoryInfo(this, counters, size):
            counters._obj.committed = 1000
            return 1

        @staticmethod
        def SetInformationJobObject(job, kind, wanted, size):
            told.update(kind=kind, size=size, memory=wanted._obj.process_memory,
                        time=wanted._obj.process_time, flags=wanted._obj.flags)  # fmt: skip
            return 1

    class Windows:
        kernel32 = type("K", (), {})()

    for name in dir(Kernel):
        if not name.startswith("__"):
            function = getattr(Kernel, name)

            class Call:
                restype = None

                def __init__(self, function):
                    self.function = function

                def __call__(self, *words):
                    return self.function(*words)

            setattr(Windows.kernel32, name, Call(function))
    monkeypatch.setattr(ctypes, "windll", Windows, raising=False)
    monkeypatch.setattr(limits, "held_job", [])
    used = time.process_time()
    assert limits.committed() == 1000
    assert limits.arm_windows(2.0, 500) == [limits.TIME, limits.MEMORY]
    assert (told["kind"], told["size"], told["memory"], told["flags"]) == (9, 144, 500, 0x102)
    assert 0 <= told["time"] / 1e7 - 2.0 - used < 1
    Windows.kernel32.SetInformationJobObject = lambda *_: 0
    assert limits.arm_windows(2.0, 500) == []


def test_the_process_ends_with_the_program(served, tmp_path):
    """Killed while a file is read: nobody is left who reads on."""
    import subprocess

    program = Path(gate.__file__).parents[2] / "shapeshift" / "__main__.py"
    script = tmp_path / "killed.py"
    script.write_text(
        "import sys, runpy\n"
        f"runpy.run_path({str(program)!r}, run_name='x')\n"
        "from pathlib import Path\n"
        "from shapeshift.runtime_models.gate import gate, doors\n"
        "door = doors.Door('t', 'f', 'numpy', (), 'stand_in_parser:read', 60, 0, 1 << 28)\n"
        "gate.DOORS['t'] = door\n"
        "p = gate.taken('t'); print(p.child.pid, flush=True); gate.idle_processes['t'].append(p)\n"
        f"gate.ask('t', Path({str(served)!r}), ['sleep'])\n"
    )
    parent = subprocess.Popen([sys.executable, "-P", str(script)], stdout=subprocess.PIPE)
    child = int(parent.stdout.readline())
    parent.kill()
    parent.wait()
    parent.stdout.close()
    for _ in range(100):
        if not alive(child):
            return
        time.sleep(0.1)
    os.kill(child, signal.SIGKILL)
    pytest.fail("the process goes on")


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
        return Path(f"/proc/{process}/stat").read_text().split()[2] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False
