"""Progress bars of the commands: on stderr, and only where somebody sees them move."""

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING, TypeVar

from app.terminal import open_console

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn

Thing = TypeVar("Thing")


def progress_bar(*columns: "str | ProgressColumn", transient: bool = True) -> "Progress":
    """A bar of rich's; into a file or a pipe, where it would leave an empty line, nothing."""
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn

    from app.clean_console import CleanProgress

    console = open_console()
    usual = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
    columns = columns or (*usual, TimeRemainingColumn())
    for column in columns:
        if isinstance(column, TextColumn):
            column.markup = False  # names out of files may hold brackets
    return CleanProgress(
        *columns, console=console, transient=transient, disable=not console.is_interactive
    )


def tracked(work: Collection[Thing], what: str) -> Iterator[Thing]:
    """The things of the work one by one, with a bar that says how many of them are done."""
    with progress_bar() as bar:
        yield from bar.track(work, description=what)
