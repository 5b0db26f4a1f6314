"""--cluster slurm:FILE: workers are jobs of SLURM, by dask-jobqueue, where that is installed."""

import os
import secrets
import time
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapeshift.app.cluster import on_worker
from shapeshift.app.cluster.certificates import read_certificates
from shapeshift.app.cluster.on_worker import DONE, FAILED, run_on_worker
from shapeshift.app.cluster.run_task import (
    GRACE_S,
    Board,
    Shown,
    TaskFailed,
    board,
    check_tasks,
    raise_failed,
)
from shapeshift.app.cluster.task import Task
from shapeshift.app.errors import UsageError
from shapeshift.app.terminal import say
from shapeshift.runtime_models.files.whole_file import open_locked, temporary_folder
from shapeshift.runtime_models.program import ROOT, install_words, is_installed

if TYPE_CHECKING:
    from distributed import Client, Future
    from distributed.security import Security


# Tasks on Dask's workers: of this machine, behind an address, or jobs of SLURM.

LOOPBACK = "127.0.0.1"
QUIET = 60  # a level of logging above all: what matters we say ourselves
CONNECT_S = 15.0


class DaskCluster:
    """Runs tasks on the workers of a scheduler."""

    shown: Shown = staticmethod(board)

    def __init__(self, client: "Client") -> None:
        self.client = client

    def run(self, tasks: Sequence[Task]) -> None:
        """As Cluster.run."""
        keys = check_tasks(tasks)
        waiting = [task for task in tasks if not task.is_done(keys[task.name])]
        self._check_slots(waiting)
        failed: list[TaskFailed] = []
        futures: dict[Future, Task] = {}
        with (
            self.shown(len(tasks), len(tasks) - len(waiting)) as shown,
            self._heard(shown) as topic,
        ):
            try:
                for task in waiting:
                    futures[self._submit(task, keys[task.name], topic)] = task
                self._gather(futures, shown, failed)
            except BaseException:
                self._stop(list(futures), waiting)
                raise
        raise_failed(failed, len(tasks))

    def _submit(self, task: Task, key: str, topic: str) -> "Future":
        # pure: Dask would give the result of an earlier run without looking at the files
        return self.client.submit(
            run_on_worker, asdict(task), key, topic, pure=False, resources=dict(task.slots) or None
        )

    def _gather(
        self, futures: "dict[Future, Task]", shown: Board, failed: list[TaskFailed]
    ) -> None:
        from distributed import as_completed

        with self.client.as_current():
            ended = as_completed(list(futures), raise_errors=False)
        for future in ended:
            task = futures[future]
            try:
                state, sentence = future.result()
            except Exception as error:  # of Dask: its worker was killed again and again
                state, sentence = FAILED, f"{task.name}: {lost(error)}"
            if state != DONE:
                failed.append(TaskFailed(sentence or f"{task.name}: it was taken from its worker."))
            shown.end(task.name)

    @contextmanager
    def _heard(self, shown: Board) -> Iterator[str]:
        """A topic whose events, (name, command, line), are shown."""
        topic = f"shapeshift-{secrets.token_hex(8)}"

        def handle(event: tuple[float, Any]) -> None:
            shown.hear(*event[1])

        self.client.subscribe_topic(topic, handle)
        try:
            yield topic
        finally:
            self.client.unsubscribe_topic(topic)

    def _stop(self, futures: "list[Future]", tasks: Sequence[Task]) -> None:
        """Takes all back, and waits until the attempts have saved what they have."""
        self.client.cancel(futures)
        until = time.monotonic() + 1.5 * GRACE_S
        for task in tasks:
            while task.begun_note.exists() and time.monotonic() < until:
                if note := open_locked(task.begun_note):
                    note.close()
                    break
                time.sleep(0.1)

    def _check_slots(self, tasks: Sequence[Task]) -> None:
        """Raises UsageError where a task wants what no worker has."""
        workers = self.client.scheduler_info(n_workers=-1)["workers"].values()
        for task in tasks:
            for slot, count in task.slots.items():
                if workers and all(w["resources"].get(slot, 0) < count for w in workers):
                    raise UsageError(
                        f"{task.name} wants {count} slot {slot}, and none of the {len(workers)} "
                        f"workers has that; start one with --{slot}s {count}."
                    )
        if tasks and not workers:
            say("No worker is there yet; the tasks wait for the first.")


def lost(error: Exception) -> str:
    """Why Dask gave a task up, a sentence."""
    if type(error).__name__ == "KilledWorker":
        return (
            "the workers that ran it were killed one after the other, perhaps for want of memory; "
            "what it had is kept."
        )
    text = str(error).strip().splitlines()
    return f"Dask gave it up ({text[0] if text else type(error).__name__})."


@contextmanager
def quiet_dask() -> Iterator[Path]:
    """Dask without words of its own, and a folder for its files, which goes afterwards."""
    import logging

    import dask

    settings = {
        "distributed.admin.system-monitor.disk": False, "distributed.version": 2,
        "distributed.diagnostics.nvml": False, "distributed.worker.daemon": False,
    }  # fmt: skip
    logging.getLogger("distributed").setLevel(QUIET)
    with temporary_folder() as own, dask.config.set(settings):
        yield own


def node_options(host: str, security: "Security | None") -> dict[str, Any]:
    """Of a scheduler or a worker: it listens on one host, and its HTTP server on this machine."""
    protocol = "tls" if security else "tcp"
    return {
        "host": host, "protocol": protocol, "security": security,
        "dashboard_address": f"{LOOPBACK}:0", "dashboard": False,
    }  # fmt: skip


def worker_options(number: int, workers: int, gpus: int, folder: Path) -> dict[str, Any]:
    """Of one of several workers on a machine, the first `gpus` of them with a GPU each."""
    import dask

    threads = str(max((os.cpu_count() or 1) // workers, 1))  # PoCL takes all otherwise
    environment = {"POCL_MAX_PTHREAD_COUNT": os.environ.get("POCL_MAX_PTHREAD_COUNT", threads)}
    if number < gpus:
        environment["SHAPESHIFT_GPU"] = str(number)
    return {
        "nthreads": 1, "memory_limit": None, "local_directory": str(folder), "silence_logs": QUIET,
        "env": environment, "resources": {"gpu": 1} if number < gpus else {},
        "preload": [*dask.config.get("distributed.worker.preload"), on_worker.__name__],
    }  # fmt: skip


@contextmanager
def local_cluster(count: int, gpus: int) -> Iterator[DaskCluster]:
    """So many workers on this machine, behind a certificate that nobody else has."""
    from distributed import Client, Nanny, Scheduler, SpecCluster
    from distributed.security import Security

    with quiet_dask() as folder:
        node = node_options(LOOPBACK, security := Security.temporary())
        workers = {
            i: {"cls": Nanny, "options": node | worker_options(i, count, gpus, folder)}
            for i in range(count)
        }
        scheduler = {"cls": Scheduler, "options": node | {"port": 0}}
        with (
            SpecCluster(workers, scheduler, security=security, silence_logs=QUIET) as cluster,
            Client(cluster) as client,
        ):
            client.wait_for_workers(count, timeout=60)
            yield DaskCluster(client)


@contextmanager
def scheduler_at(address: str, certificates: Path | None) -> Iterator[DaskCluster]:
    """The workers of a scheduler that runs already.  Raises UsageError where there is none."""
    from distributed import Client

    from shapeshift.app.cluster.certificates import read_certificates
    from shapeshift.runtime_models.program import program

    tls = address.startswith("tls:")
    security = read_certificates(certificates, address) if tls else None
    with quiet_dask():
        try:
            client = Client(address, security=security, timeout=CONNECT_S, set_as_default=False)
        except (OSError, TimeoutError) as error:
            more = f" --certificates {certificates}" if tls else ""
            raise UsageError(
                f"no scheduler answers at {address} ({reason(error)}); start one there with "
                f"`{program()} cluster scheduler {address}{more}`."
            ) from None
        with client:
            yield DaskCluster(client)


def reason(error: BaseException) -> str:
    """In short, what a connection failed by."""
    deepest = error
    while deepest.__cause__ is not None:
        deepest = deepest.__cause__
    text = str(deepest).strip().splitlines()
    return text[0][:100] if text else type(deepest).__name__


MOST_BYTES = 1 << 16
KEYS: dict[str, type] = {  # of the file, as dask-jobqueue calls them; workers is ours
    "workers": int, "queue": str, "account": str, "walltime": str, "cores": int, "memory": str,
    "interface": str, "gpus": int, "job_extra_directives": list, "job_script_prologue": list,
}  # fmt: skip
NEEDED = ("workers", "cores", "memory", "interface")


def read_jobs(file: Path) -> dict[str, Any]:
    """What a TOML file says of the jobs.  Raises UsageError."""
    try:
        if file.stat().st_size > MOST_BYTES:
            raise UsageError(f"{file}: {file.stat().st_size:,} bytes, expected a few lines.")
        said = tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"--cluster slurm:{file}: {error.strerror}.") from None
    except ValueError as error:
        raise UsageError(f"{file}: not TOML ({error}).") from None
    for key, value in said.items():
        if key not in KEYS:
            raise UsageError(f"{file} has '{key}'; {', '.join(KEYS)} are known.")
        right = type(value) is KEYS[key]
        if KEYS[key] is list:
            right = right and all(isinstance(line, str) for line in value)
        if not right or (KEYS[key] is int and value < 1):
            raise UsageError(f"{file}: {key} is {value!r}, expected {WANTED[KEYS[key]]}.")
    for key in NEEDED:
        if key not in said:
            raise UsageError(f"{file} lacks '{key}' (docs/cluster.md has an example).")
    return said


WANTED = {int: "a whole number from 1", str: "a text", list: "a list of texts"}


def job_options(said: dict[str, Any], certificates: Path | None) -> dict[str, Any]:
    """Of dask_jobqueue.SLURMCluster: one worker a job, behind certificates, always."""
    given = {key: value for key, value in said.items() if key not in ("workers", "gpus")}
    directives, prologue = (
        list(given.pop(key, [])) for key in ("job_extra_directives", "job_script_prologue")
    )
    extra = ["--nthreads", "1", "--dashboard-address", f"{LOOPBACK}:0"]
    if gpus := said.get("gpus", 0):
        directives.append(f"--gres=gpu:{gpus}")
        extra += ["--resources", "gpu=1"]
    if not is_installed():
        prologue.append(f"export PYTHONPATH={ROOT}")
    return given | {
        "processes": 1, "protocol": "tls://",
        "security": read_certificates(certificates, "a cluster of SLURM"),
        "job_extra_directives": directives, "job_script_prologue": prologue,
        "worker_extra_args": extra,
        "scheduler_options": {
            "interface": said["interface"], "dashboard_address": f"{LOOPBACK}:0",
        },
    }  # fmt: skip


@contextmanager
def slurm_cluster(file: Path, certificates: Path | None) -> Iterator[DaskCluster]:
    """Jobs of SLURM as workers, for as long as the block lasts.  Raises UsageError."""
    said = read_jobs(file)
    try:
        from dask_jobqueue import SLURMCluster
    except ImportError:
        raise UsageError(
            f"--cluster slurm wants dask-jobqueue, which {install_words('slurm')} installs."
        ) from None
    from distributed import Client

    with (
        quiet_dask(),
        SLURMCluster(**job_options(said, certificates)) as cluster,
        Client(cluster) as client,
    ):
        cluster.scale(said["workers"])
        yield DaskCluster(client)
