"""Where tasks run: what --cluster says."""

import ipaddress
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Protocol

from shapeshift.app.cluster.task import Task
from shapeshift.app.command_line import EXPERT, Opt
from shapeshift.app.errors import UsageError

if TYPE_CHECKING:
    from shapeshift.app.cluster.run_task import Shown

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
    from shapeshift.app.cluster.run_task import Here, board

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
        from shapeshift.app.cluster.dask_cluster import slurm_cluster

        opened = slurm_cluster(place.file, certificates)
    with opened as cluster:
        cluster.shown = shown or board
        yield cluster


# What --cluster says, and who may listen where.

FORMS = "none, local, local:N, tcp://127.0.0.1:PORT, tls://HOST:PORT or slurm:FILE"
MOST_LOCAL = 256  # workers of one machine
USUAL_LOCAL = 2
ADDRESS = re.compile(r"(tcp|tls)://(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+):(\d{1,5})")


@dataclass(frozen=True)
class ClusterPlace:
    """Where tasks run."""

    kind: str  # none | local | scheduler | slurm
    workers: int = 0  # of local
    address: str = ""  # of a scheduler
    file: Path = Path()  # of slurm


@dataclass(frozen=True)
class Address:
    """Of a scheduler, checked."""

    text: str
    protocol: str  # tcp | tls
    host: str
    port: int


def read_place(text: str) -> ClusterPlace:
    """What --cluster says.  Raises UsageError."""
    kind, colon, rest = text.partition(":")
    if text == "none":
        return ClusterPlace("none")
    if kind == "local":
        if colon and not (rest.isascii() and rest.isdigit() and 1 <= int(rest) <= MOST_LOCAL):
            raise UsageError(f"--cluster is '{text}', expected local:1 to local:{MOST_LOCAL}.")
        return ClusterPlace("local", int(rest) if colon else USUAL_LOCAL)
    if kind == "slurm" and rest:
        from shapeshift.app.paths import plain

        return ClusterPlace("slurm", file=plain(rest))
    if kind in ("tcp", "tls"):
        return ClusterPlace("scheduler", address=read_address(text, "--cluster").text)
    raise UsageError(f"--cluster is '{text}', expected {FORMS}.")


def read_address(text: str, option: str) -> Address:
    """tcp://127.0.0.1:PORT or tls://HOST:PORT.  Raises UsageError."""
    found = ADDRESS.fullmatch(text)
    if not found or not 1 <= int(found[3]) <= 65535:
        raise UsageError(
            f"{option} is '{text}', expected tls://HOST:PORT, or tcp://127.0.0.1:PORT on this "
            "machine alone."
        )
    address = Address(text, found[1], found[2].strip("[]"), int(found[3]))
    if address.protocol == "tcp" and not is_loopback(address.host):
        from shapeshift.runtime_models.program import program

        raise UsageError(
            f"{option} is '{text}': whoever reaches such a port runs what he likes, so tcp:// is "
            f"for 127.0.0.1 alone; use tls://{found[2]}:{found[3]} with --certificates, which "
            f"`{program()} cluster certificates --out DIR` makes."
        )
    return address


def is_loopback(host: str) -> bool:
    """Whether nobody but this machine reaches it; names other than localhost may mean anything."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
