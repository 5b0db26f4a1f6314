"""What asks the program to end: Ctrl-C, a job manager or `kill`, a terminal that is closed.

All are answered as Ctrl-C is: a KeyboardInterrupt, or what a long run does in its place.
"""

import os
import signal
import stat
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType

ENDINGS = tuple(
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")  # the last is of Windows' consoles
    if hasattr(signal, name)
)
Handler = Callable[[int, FrameType | None], None]


def interrupt(number: int, frame: FrameType | None) -> None:
    """The handler of those that come from outside."""
    leave_terminal(number)
    raise KeyboardInterrupt


def leave_terminal(number: int) -> None:
    """After SIGHUP nobody reads: each line would end in an error, in the middle of saving."""
    if number != getattr(signal, "SIGHUP", None):
        return
    for stream in (sys.__stdin__, sys.__stdout__, sys.__stderr__):
        with suppress(OSError, ValueError, AttributeError):  # it is no file, or closed
            handle = stream.fileno()  # type: ignore[union-attr]
            if stat.S_ISCHR(os.fstat(handle).st_mode):  # isatty() is false of one that is gone
                os.dup2(os.open(os.devnull, os.O_RDWR), handle)


def answer_endings() -> None:
    """For a program of its own, from its main thread: SIGTERM and SIGHUP interrupt as Ctrl-C."""
    for each in ENDINGS:
        if each != signal.SIGINT and signal.getsignal(each) != signal.SIG_IGN:  # nohup's
            signal.signal(each, interrupt)


@contextmanager
def answered(handler: Handler) -> Iterator[Callable[[], None]]:
    """While it lasts they all go to `handler`; the function that is given ends that earlier."""
    before = {
        each: signal.getsignal(each)
        for each in ENDINGS
        if each == signal.SIGINT or signal.getsignal(each) != signal.SIG_IGN
    }

    def restore() -> None:
        for each, old in before.items():
            signal.signal(each, old)

    for each in before:
        signal.signal(each, handler)
    try:
        yield restore
    finally:
        restore()


@contextmanager
def uninterrupted() -> Iterator[None]:
    """They wait until the end of this: numpy takes one while it is imported for a broken
    installation.  launch.py has held Ctrl-C back since Python started.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    signal.pthread_sigmask(signal.SIG_BLOCK, ENDINGS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDINGS)
