"""--cluster none: tasks one after the other on this machine, each in a process of its own."""

from collections.abc import Sequence

from shapeshift.app.cluster.board import Board, Shown, board
from shapeshift.app.cluster.run_task import TaskFailed, run_task
from shapeshift.app.cluster.task import Task


class Here:
    """Runs tasks without a cluster."""

    def __init__(self, shown: Shown = board) -> None:
        self.shown = shown

    def run(self, tasks: Sequence[Task]) -> None:
        """Returns when all are done.  A task that fails is said at once, and the others go on.

        Raises TaskFailed after the last one where any failed.
        """
        keys = check_tasks(tasks)
        failed: list[TaskFailed] = []
        open_tasks = [task for task in tasks if not task.is_done(keys[task.name])]
        with self.shown(len(tasks), len(tasks) - len(open_tasks)) as shown:
            for task in open_tasks:
                self._run_one(task, keys[task.name], shown, failed)
        raise_failed(failed, len(tasks))

    def _run_one(self, task: Task, key: str, shown: Board, failed: list[TaskFailed]) -> None:
        try:
            run_task(task, key, lambda line: shown.hear(task.name, task.argv[0], line))
        except TaskFailed as error:
            failed.append(error)
        shown.end(task.name)


def check_tasks(tasks: Sequence[Task]) -> dict[str, str]:
    """The key of each by name.  Raises ValueError where two share a name or a file."""
    names = [task.name for task in tasks]
    files = [path for task in tasks for path in task.writes]
    for words, what in ((names, "name"), (files, "file to write")):
        twice = {word for word in words if words.count(word) > 1}
        if twice:
            raise ValueError(f"two tasks have one {what}: {min(twice)}")
    return {task.name: task.key() for task in tasks}


def raise_failed(failed: Sequence[TaskFailed], count: int) -> None:
    """The first failure, and how many there were, where any was.  Raises TaskFailed."""
    if not failed:
        return
    more = f"  ({len(failed)} of {count} tasks failed.)" if len(failed) > 1 else ""
    raise TaskFailed(f"{failed[0]}{more}")
