"""Progress bars of the commands: on stderr, and only where somebody sees them move."""

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn

Thing = TypeVar("Thing")


def progress_bar(*columns: "str | ProgressColumn", transient: bool = True) -> "Progress":
    """A bar of rich's; into a file or a pipe, where it would leave an empty line, nothing."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    return Progress(
        *columns, console=console, transient=transient, disable=not console.is_interactive
    )


def tracked(work: Collection[Thing], what: str) -> Iterator[Thing]:
    """The things of the work one by one, with a bar that says how many of them are done."""
    with progress_bar() as bar:
        yield from bar.track(work, description=what)
