"""What a command is at: bars where somebody sees them move, elsewhere a line a minute on stderr."""

import os
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol, TypeVar

from shapeshift.app.terminal import open_console, say

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn

Item = TypeVar("Item")
LINE_EVERY_S = 60.0
PERIOD = "SHAPESHIFT_LINE_EVERY_S"  # in the environment: another one, for a program that reads them


class Work(Protocol):
    """Something that is under way."""

    def words(self) -> str:
        """How far it is; "" where nothing is to be said."""
        ...


_under_way: list[Work] = []  # the innermost last; lines report that one


def progress_bar(*columns: "str | ProgressColumn", transient: bool = True) -> "Progress":
    """A bar of rich's; into a file or a pipe it draws nothing, and `lines` tell of it."""
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn

    console = open_console()
    usual = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
    columns = columns or (*usual, TimeRemainingColumn())
    for column in columns:
        if isinstance(column, TextColumn):
            column.markup = False  # names out of files may hold brackets
    return _bar_type()(
        *columns, console=console, transient=transient, disable=not console.is_interactive
    )


def tracked(work: Collection[Item], what: str) -> Iterator[Item]:
    """The items of the work one by one, with a bar that says how many of them are done."""
    with progress_bar() as bar:
        task = bar.add_task(what, total=len(work))
        for item in work:
            yield item
            bar.advance(task)


@contextmanager
def working(what: str) -> Iterator[Callable[[str], None]]:
    """Shows what is done for as long as it takes; gives a function for what comes next."""
    now = Words(what)
    with listed(now), open_console().status(what) as status:

        def report(text: str) -> None:
            now.text = text
            status.update(text)

        yield report


@contextmanager
def lines(command: str) -> Iterator[None]:
    """While it lasts, a line a minute on stderr where that is no terminal: what is under way."""
    if sys.stderr is None or is_terminal(sys.stderr):
        yield
        return
    over, began = threading.Event(), time.monotonic()

    def report() -> None:
        while not over.wait(line_period_s()):
            words = next(filter(None, (work.words() for work in reversed(_under_way))), "at work")
            minutes = (time.monotonic() - began) / 60
            try:
                say(f"{command}: {words} ({minutes:.0f} min)")
            except (OSError, ValueError):
                return  # nobody reads any more

    thread = threading.Thread(target=report, name="a line a minute", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def line_period_s() -> float:
    """Seconds from one line to the next."""
    try:
        period = float(os.environ.get(PERIOD, ""))
    except ValueError:
        return LINE_EVERY_S
    return period if 0.01 <= period <= LINE_EVERY_S else LINE_EVERY_S


def is_terminal(stream) -> bool:
    """Whether a bar can move there."""
    return stream.isatty() and os.environ.get("TERM", "") not in ("dumb", "unknown")


class Words:
    """Work that says of itself how far it is."""

    def __init__(self, text: str = "") -> None:
        self.text = text

    def words(self) -> str:
        return self.text


@contextmanager
def listed(work: Work) -> Iterator[None]:
    """While it lasts, lines are of this work."""
    _under_way.append(work)
    try:
        yield
    finally:
        _under_way.remove(work)


def _bar_type() -> type:
    """A Progress of rich's that lines can tell of.  Made late: rich takes a while to load."""
    from shapeshift.app.clean_console import CleanProgress

    class Bar(CleanProgress):
        """Listed from start to stop."""

        def start(self) -> None:
            _under_way.append(self)
            super().start()

        def stop(self) -> None:
            if self in _under_way:
                _under_way.remove(self)
            super().stop()

        def words(self) -> str:
            running = [task for task in self.tasks if not task.finished]
            if not running:
                return ""
            task = running[-1]
            words = [task.description]
            if task.total:
                whole = task.total > 1 and float(task.total).is_integer()
                part = f"{task.completed:.0f} of {task.total:.0f}"
                words.append(part if whole else f"{task.percentage:.0f} %")
            words += [text for text in task.fields.values() if isinstance(text, str)]
            return ", ".join(filter(None, words))

    return Bar
