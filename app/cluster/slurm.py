"""--cluster slurm:FILE: workers are jobs of SLURM, by dask-jobqueue, where that is installed."""

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from shapeshift.app.cluster.certificates import read_certificates
from shapeshift.app.cluster.dask_cluster import LOOPBACK, DaskCluster, quiet_dask
from shapeshift.app.errors import UsageError
from shapeshift.app.program import ROOT, is_installed

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
            "--cluster slurm wants dask-jobqueue, which is not installed: `pip install "
            "dask-jobqueue`."
        ) from None
    from distributed import Client

    with (
        quiet_dask(),
        SLURMCluster(**job_options(said, certificates)) as cluster,
        Client(cluster) as client,
    ):
        cluster.scale(said["workers"])
        yield DaskCluster(client)
