"""launch.py cluster: what other machines need to take part in the work of this one."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from shapeshift.app.command_line import EXPERT, POSITIONAL, Opt

MOST_WORKERS = 256


@dataclass(frozen=True)
class Options:
    """Make one cluster of several machines: certificates once, a scheduler on one machine, workers
    on all, and then --cluster tls://HOST:PORT on the commands that know it (docs/cluster.md)."""

    action: Annotated[
        Literal["certificates", "scheduler", "worker"], Opt(positional=True, metavar="ACTION")
    ]
    """certificates, scheduler or worker."""
    address: Annotated[str, POSITIONAL] = ""
    """Of the scheduler: tls://HOST:PORT, or tcp://127.0.0.1:PORT for this machine alone."""
    out: Path | None = None
    """For certificates: a new folder, to be copied to every machine of the cluster, and to nobody
    else.  Default: none."""
    certificates: Path | None = None
    """That folder, for a scheduler or worker at tls://.  Default: none."""
    workers: int = 1
    """Tasks that this machine works on at once."""
    gpus: int = 0
    """GPUs of this machine; so many workers, at least, take one each."""
    host: Annotated[str, EXPERT] = ""
    """The address of this machine that workers listen on.  Default: the one that faces the
    scheduler."""


def run(options: Options) -> int:
    from shapeshift.app.cluster.certificates import require_dask
    from shapeshift.app.cluster.open_cluster import read_address
    from shapeshift.app.errors import UsageError

    if options.action == "certificates":
        return make_certificates(options)
    if not options.address:
        raise UsageError(f"{options.action} wants an address, such as tls://192.168.0.2:8786.")
    address = read_address(options.address, "ADDRESS")
    if not (1 <= options.workers <= MOST_WORKERS and 0 <= options.gpus <= MOST_WORKERS):
        raise UsageError(f"--workers and --gpus are up to {MOST_WORKERS}, and --workers 1 or more.")
    require_dask()
    from shapeshift.app.cluster.serve import serve_scheduler, serve_workers

    if options.action == "scheduler":
        serve_scheduler(address, options.certificates)
    else:
        count = max(options.workers, options.gpus)
        serve_workers(address, options.certificates, options.host, count, options.gpus)
    return 0


def make_certificates(options: Options) -> int:
    from shapeshift.app.cluster.certificates import require_dask, write_certificates
    from shapeshift.app.errors import UsageError
    from shapeshift.app.paths import full
    from shapeshift.app.terminal import say

    if options.out is None:
        raise UsageError("certificates wants --out DIR, a new folder.")
    require_dask()
    write_certificates(options.out)
    say(
        f"{full(options.out)}: a certificate and its key, for a year.  Copy the folder to every "
        "machine of the cluster; whoever has it can run programs there."
    )
    return 0
