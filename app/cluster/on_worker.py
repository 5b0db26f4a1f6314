"""What a worker of the cluster does with a task: its own process runs the command."""

import os
import signal
import socket

from shapeshift.app.cluster.run_task import TaskFailed, TaskStopped, run_task
from shapeshift.app.cluster.task import Task

DONE, FAILED, STOPPED = "done", "failed", "stopped"


def dask_setup(worker) -> None:
    """Dask calls it in a worker's process: Ctrl-C is for who started it, and he ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def run_on_worker(fields: dict, key: str, topic: str) -> tuple[str, str]:
    """(DONE | FAILED | STOPPED, a sentence).  Lines go to whoever listens to the topic."""
    from distributed import get_worker

    worker, task = get_worker(), Task(**fields)
    mine = worker.get_current_task()

    def hear(line: str) -> None:
        worker.log_event(topic, (task.name, task.argv[0], line))

    def wanted() -> bool:
        state = worker.state.tasks.get(mine)
        return state is not None and state.state == "executing"

    lacking = [path for path in task.reads if not os.path.exists(path)]
    if lacking:
        here = socket.gethostname()
        return FAILED, (
            f"{task.name}: {lacking[0]} is not there on {here}; all machines of a cluster need "
            "the same folder under the same path."
        )
    try:
        run_task(task, key, hear, wanted)
    except TaskFailed as error:
        return FAILED, str(error)
    except TaskStopped:
        return STOPPED, ""
    return DONE, ""
