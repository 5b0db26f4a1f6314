"""Where tasks run: what --cluster says."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Protocol

from shapeshift.app.cluster.task import Task
from shapeshift.app.errors import UsageError

NONE = "none"


class Cluster(Protocol):
    """Something that runs tasks."""

    def run(self, tasks: Sequence[Task]) -> None:
        """Returns when all are done; those that were done before are not run again.

        Raises TaskFailed after the last one where any failed.  After Ctrl-C no process is left,
        and the same call goes on.
        """
        ...


@contextmanager
def open_cluster(where: str = NONE) -> Iterator[Cluster]:
    """What runs tasks where --cluster says.  Raises UsageError."""
    from shapeshift.app.cluster.here import Here

    if where != NONE:
        raise UsageError(f"--cluster is '{where}', expected none.")
    yield Here()
