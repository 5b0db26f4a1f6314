"""Where tasks run: what --cluster says."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Protocol

from shapeshift.app.cluster.task import Task
from shapeshift.app.command_line import EXPERT, Opt
from shapeshift.app.errors import UsageError

if TYPE_CHECKING:
    from shapeshift.app.cluster.board import Shown

NONE = "none"


@dataclass(frozen=True, kw_only=True)
class ClusterOptions:
    """Options of commands whose work falls into tasks."""

    cluster: Annotated[str, Opt(metavar="WHERE")] = NONE
    """Who does the work: none (this process), local or local:N (so many processes of this
    machine), tls://HOST:PORT (a scheduler of `cluster scheduler`), slurm:FILE (docs/cluster.md)."""
    certificates: Annotated[Path | None, EXPERT] = None
    """The folder of `cluster certificates`, for a cluster of other machines.  Default: none."""
    gpus: Annotated[int, EXPERT] = 0
    """GPUs of this machine that the processes of --cluster local share, one each."""


class Cluster(Protocol):
    """Something that runs tasks."""

    def run(self, tasks: Sequence[Task]) -> None:
        """Returns when all are done; those that were done before are not run again.

        Raises TaskFailed after the last one where any failed.  After Ctrl-C no process is left,
        and the same call goes on.
        """
        ...


def check_cluster(options: ClusterOptions) -> None:
    """Before long work: what --cluster and --gpus say, and whether what they need is installed.

    Raises UsageError.
    """
    from shapeshift.app.cluster.place import read_place

    place = read_place(options.cluster)
    check_gpus(place.kind, options.gpus)
    if place.kind != NONE:
        from shapeshift.app.cluster.certificates import require_dask

        require_dask()


def check_gpus(kind: str, gpus: int) -> None:
    """Raises UsageError where --gpus is no number of them, or --cluster of that kind has none."""
    if gpus < 0 or (gpus and kind != "local"):
        raise UsageError(
            f"--gpus is {gpus}, expected the GPUs of this machine, with --cluster local; of other "
            "machines `cluster worker --gpus` says how many there are."
        )


@contextmanager
def open_cluster(
    where: str = NONE, certificates: Path | None = None, gpus: int = 0,
    shown: "Shown | None" = None,
) -> Iterator[Cluster]:  # fmt: skip
    """What runs tasks where --cluster says; shown: instead of a bar.  Raises UsageError."""
    from shapeshift.app.cluster.board import board
    from shapeshift.app.cluster.here import Here
    from shapeshift.app.cluster.place import read_place

    place = read_place(where)
    check_gpus(place.kind, gpus)
    if place.kind == "none":
        yield Here(shown or board)
        return
    from shapeshift.app.cluster.certificates import require_dask

    require_dask()
    from shapeshift.app.cluster import dask_cluster

    if place.kind == "local":
        opened = dask_cluster.local_cluster(max(place.workers, gpus), gpus)
    elif place.kind == "scheduler":
        opened = dask_cluster.scheduler_at(place.address, certificates)
    else:
        from shapeshift.app.cluster.slurm import slurm_cluster

        opened = slurm_cluster(place.file, certificates)
    with opened as cluster:
        cluster.shown = shown or board
        yield cluster
