"""What a command is at: bars where somebody sees them move, elsewhere a line a minute on stderr."""

import os
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol, TypeVar

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn

Thing = TypeVar("Thing")
LINE_EVERY_S = 60.0


class Work(Protocol):
    """Something that is under way."""

    def words(self) -> str:
        """How far it is; "" where nothing is to be said."""
        ...


_under_way: list[Work] = []  # the innermost last; lines are of that


def progress_bar(*columns: "str | ProgressColumn", transient: bool = True) -> "Progress":
    """A bar of rich's; into a file or a pipe it draws nothing, and `lines` tell of it."""
    from rich.console import Console

    console = Console(stderr=True)
    return _bar_type()(
        *columns, console=console, transient=transient, disable=not console.is_interactive
    )


def tracked(work: Collection[Thing], what: str) -> Iterator[Thing]:
    """The things of the work one by one, with a bar that says how many of them are done."""
    with progress_bar() as bar:
        task = bar.add_task(what, total=len(work))
        for thing in work:
            yield thing
            bar.advance(task)


@contextmanager
def working(what: str) -> Iterator[Callable[[str], None]]:
    """Shows what is done for as long as it takes; gives a function for what comes next."""
    from rich.console import Console
    from rich.markup import escape

    now = Words(what)
    with listed(now), Console(stderr=True).status(escape(what)) as status:

        def tell(text: str) -> None:
            now.text = text
            status.update(escape(text))

        yield tell


@contextmanager
def lines(command: str) -> Iterator[None]:
    """While it lasts, a line a minute on stderr where that is no terminal: what is under way."""
    if sys.stderr is None or is_terminal(sys.stderr):
        yield
        return
    over, began = threading.Event(), time.monotonic()

    def tell() -> None:
        while not over.wait(LINE_EVERY_S):
            words = next(filter(None, (work.words() for work in reversed(_under_way))), "at work")
            minutes = (time.monotonic() - began) / 60
            try:
                print(f"{command}: {words} ({minutes:.0f} min)", file=sys.stderr, flush=True)
            except (OSError, ValueError):
                return  # nobody reads any more

    teller = threading.Thread(target=tell, name="a line a minute", daemon=True)
    teller.start()
    try:
        yield
    finally:
        over.set()
        teller.join()


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
    from rich.errors import MarkupError
    from rich.progress import Progress
    from rich.text import Text

    class Bar(Progress):
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
            try:
                words = [Text.from_markup(task.description).plain]
            except MarkupError:  # of a bar that takes its texts as they are
                words = [task.description]
            if task.total:
                whole = task.total > 1 and float(task.total).is_integer()
                part = f"{task.completed:.0f} of {task.total:.0f}"
                words.append(part if whole else f"{task.percentage:.0f} %")
            words += [text for text in task.fields.values() if isinstance(text, str)]
            return ", ".join(filter(None, words))

    return Bar
