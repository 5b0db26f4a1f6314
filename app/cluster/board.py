"""What the tasks of a run are at: one bar over all of them, and their own sentences below it."""

import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

from shapeshift.app.cluster.run_task import progress_words
from shapeshift.app.progress import progress_bar

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
