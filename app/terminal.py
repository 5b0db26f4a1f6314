"""The way out to standard output and standard error: all that the commands say passes here.

Names in files may hold what steers a terminal (runtime_models/files/plain_text.py); here it is
written out, in plain lines, in tables, in progress and in what libraries say.  JSON keeps its
meaning.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from shapeshift.app.clean_stream import CleanStream, trusted
from shapeshift.runtime_models.files.plain_text import json_text, one_line, several_lines

if TYPE_CHECKING:
    from rich.console import Console

NAMES = {"stdout": "standard output", "stderr": "standard error"}


@contextmanager
def clean_streams() -> Iterator[None]:
    """All that is written to sys.stdout and sys.stderr in the block is clean; flushed at its end.

    Letters that the output's encoding lacks are written out, too, instead of ending the program.
    """
    before = {name: getattr(sys, name) for name in NAMES}
    errors = {}
    for name, stream in before.items():
        if stream is None or isinstance(stream, CleanStream):
            continue
        if hasattr(stream, "reconfigure"):
            errors[name] = stream.errors
            stream.reconfigure(errors="backslashreplace")
        setattr(sys, name, CleanStream(stream, NAMES[name]))
    try:
        yield
        if sys.stdout is not None:
            sys.stdout.flush()  # while an error can be printed
    finally:
        for name, stream in before.items():
            setattr(sys, name, stream)
            if name in errors:
                stream.reconfigure(errors=errors[name])


def drop_output() -> None:
    """Nobody takes standard output any more; what is left of it would raise again at the end."""
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (OSError, ValueError, AttributeError):
        pass  # it is no file


def say(*lines: str) -> None:
    """Lines for people, on standard error; whatever a name holds, each is one."""
    print(*map(one_line, lines), sep="\n", file=sys.stderr, flush=True)


def print_text(text: str) -> None:
    """What was asked for, on standard output, in as many lines as it has."""
    print(several_lines(text))


def print_json(value: object, indent: int | None = 1) -> None:
    """A result as JSON on standard output, as long as it is."""
    stream = trusted(sys.stdout)
    plain = "utf" in (getattr(stream, "encoding", None) or "utf").lower()
    stream.write(json_text(value, indent, ascii_only=not plain) + "\n")


def open_console(stderr: bool = True, **more) -> "Console":
    """rich's, for tables and progress; words are words, no markup, and clean."""
    from shapeshift.app.clean_console import CleanConsole

    stream = trusted(sys.stderr if stderr else sys.stdout)
    return CleanConsole(file=stream, markup=False, highlight=False, **more)
