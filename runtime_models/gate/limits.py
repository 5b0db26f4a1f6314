"""What a process may take of processor time and memory, set by itself before it reads a file.

Linux: a timer of processor time and RLIMIT_CPU, RLIMIT_DATA.  macOS: the same for time; for memory,
which its kernel does not limit, the parent looks on (`resident`).  Windows: a job object that the
process puts itself into.
"""

import os
import sys
import time
from pathlib import Path
from typing import Any

TIME, MEMORY = "time", "memory"
GRACE_S = 2  # that RLIMIT_CPU, of whole seconds, comes later than the timer
STATM = Path("/proc/self/statm")
KB = 1024  # of ru_maxrss, on Linux
PAGE_DATA = 5  # word of statm: pages of data and stacks
PROCESS_TIME, PROCESS_MEMORY = 0x2, 0x100  # JOB_OBJECT_LIMIT_...
EXTENDED = 9  # JobObjectExtendedLimitInformation
TASK_INFO, TASK_BYTES = 4, 96  # PROC_PIDTASKINFO and its size; the second word is resident bytes

held_job: list[Any] = []  # Windows: the job object of this process


def arm(seconds: float, memory: int) -> list[str]:
    """Limits what this process may take from now on; which of TIME and MEMORY are limited.

    memory: bytes that it may have as a whole, see own_bytes.
    """
    try:
        if sys.platform == "win32":
            return arm_windows(seconds, memory)
        return arm_posix(seconds, memory)
    except (ImportError, ValueError, OSError):
        return []


def disarm() -> None:
    """Lets time pass uncounted until the next file; memory stays limited."""
    if sys.platform != "win32":
        import signal

        signal.setitimer(signal.ITIMER_PROF, 0)


def arm_posix(seconds: float, memory: int) -> list[str]:
    import resource
    import signal

    def limit(what: int, most: int) -> None:
        hard = resource.getrlimit(what)[1]
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(what, (most, hard))

    limit(resource.RLIMIT_CORE, 0)
    limit(resource.RLIMIT_CPU, int(time.process_time() + seconds) + 1 + GRACE_S)
    limited = [TIME]
    if sys.platform != "darwin":
        limit(resource.RLIMIT_DATA, memory)
        limited.append(MEMORY)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    return limited


def own_bytes() -> int:
    """Bytes of memory of its own that this process has, 0 where none tells."""
    if sys.platform == "win32":
        return committed()
    if sys.platform == "darwin":
        return resident(os.getpid()) or 0
    try:
        with open(STATM, "rb", buffering=0) as told:
            return int(told.read(1 << 10).split()[PAGE_DATA]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, IndexError, ValueError):  # no /proc
        return most_resident()


def most_resident() -> int:
    """The most bytes that this process has had in memory, as its kernel counts them."""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * KB


def resident(process: int) -> int | None:
    """Bytes of another process that lie in memory, for the parent's watch; None: not known."""
    if sys.platform == "darwin":
        return resident_on_mac(process)
    try:
        pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    except (OSError, IndexError, ValueError):
        return None
    return pages * os.sysconf("SC_PAGE_SIZE")


def resident_on_mac(process: int) -> int | None:
    import ctypes

    told = (ctypes.c_uint64 * (TASK_BYTES // 8))()
    try:
        got = ctypes.CDLL(None).proc_pidinfo(process, TASK_INFO, 0, ctypes.byref(told), TASK_BYTES)
    except AttributeError:
        return None
    return int(told[1]) if got == TASK_BYTES else None


def arm_windows(seconds: float, memory: int) -> list[str]:
    """By a job object, whose limits may be set again and again."""
    import ctypes

    kernel = kernel32()
    if not held_job:
        job = ctypes.c_void_p(kernel.CreateJobObjectW(None, None))
        if not (job and kernel.AssignProcessToJobObject(job, this_process())):
            return []
        held_job.append((job, extended_limits()()))
    job, wanted = held_job[0]
    wanted.flags = PROCESS_TIME | PROCESS_MEMORY
    wanted.process_time = int(1e7 * (time.process_time() + seconds))  # units of 100 ns
    wanted.process_memory = memory
    done = kernel.SetInformationJobObject(
        job, EXTENDED, ctypes.byref(wanted), ctypes.sizeof(wanted)
    )
    return [TIME, MEMORY] if done else []


def committed() -> int:
    import ctypes

    counters = memory_counters()()
    counters.size = ctypes.sizeof(counters)
    kernel32().K32GetProcessMemoryInfo(this_process(), ctypes.byref(counters), counters.size)
    return counters.committed


def kernel32() -> Any:
    import ctypes

    kernel = getattr(ctypes, "windll").kernel32  # noqa: B009  only there
    kernel.CreateJobObjectW.restype = kernel.GetCurrentProcess.restype = ctypes.c_void_p
    return kernel


def this_process() -> Any:
    import ctypes

    return ctypes.c_void_p(kernel32().GetCurrentProcess())


def extended_limits() -> type:
    """JOBOBJECT_EXTENDED_LIMIT_INFORMATION."""
    import ctypes

    class BasicLimits(ctypes.Structure):
        _fields_ = [
            ("process_time", ctypes.c_int64), ("job_time", ctypes.c_int64),
            ("flags", ctypes.c_uint32), ("least_set", ctypes.c_size_t),
            ("most_set", ctypes.c_size_t), ("processes", ctypes.c_uint32),
            ("affinity", ctypes.c_size_t), ("priority", ctypes.c_uint32),
            ("scheduling", ctypes.c_uint32), ("io", ctypes.c_uint64 * 6),
            ("process_memory", ctypes.c_size_t), ("job_memory", ctypes.c_size_t),
            ("peak_process", ctypes.c_size_t), ("peak_job", ctypes.c_size_t),
        ]  # fmt: skip

    return BasicLimits


def memory_counters() -> type:
    """PROCESS_MEMORY_COUNTERS."""
    import ctypes

    class Counters(ctypes.Structure):
        _fields_ = [
            ("size", ctypes.c_uint32), ("faults", ctypes.c_uint32),
            ("sets", ctypes.c_size_t * 6), ("committed", ctypes.c_size_t),
            ("peak", ctypes.c_size_t),
        ]  # fmt: skip

    return Counters
