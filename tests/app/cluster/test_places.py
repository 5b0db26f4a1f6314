"""What --cluster says, certificates, jobs of SLURM: what is refused, in which words."""

import datetime
import sys
from pathlib import Path

import pytest

from shapeshift.app.cluster.certificates import read_certificates, require_dask, write_certificates
from shapeshift.app.cluster.command import Options, run
from shapeshift.app.cluster.dask_cluster import job_options, read_jobs, slurm_cluster
from shapeshift.app.cluster.open_cluster import (
    ClusterPlace,
    is_loopback,
    open_cluster,
    read_address,
    read_place,
)
from shapeshift.app.errors import UsageError


@pytest.mark.parametrize(("text", "place"), [
    ("none", ClusterPlace("none")), ("local", ClusterPlace("local", 2)),
    ("local:1", ClusterPlace("local", 1)),
    ("local:256", ClusterPlace("local", 256)),
    ("slurm:/a/b.toml", ClusterPlace("slurm", file=Path("/a/b.toml"))),
    ("tcp://127.0.0.1:1", ClusterPlace("scheduler", address="tcp://127.0.0.1:1")),
    ("tcp://[::1]:8786", ClusterPlace("scheduler", address="tcp://[::1]:8786")),
    ("tls://big.example:65535", ClusterPlace("scheduler", address="tls://big.example:65535")),
])  # fmt: skip
def test_places_are_read(text, place):
    assert read_place(text) == place


@pytest.mark.parametrize("text", [
    "", "None", "local:", "local:0", "local:257", "local:-1", "local:x", "local:1.5", "local:²",
    "slurm", "slurm:", "tcp://127.0.0.1", "tls://a:0", "tls://a:65536", "tls://:1", "tls://a b:1",
    "http://a:1", "tls:a:1", "moon", "tls://a:1/x",
])  # fmt: skip
def test_other_words_are_refused(text):
    with pytest.raises(UsageError, match="--cluster is"):
        read_place(text)


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.0.2", "big.example", "[::]", "127.0.0.1.evil",
                                  "128.0.0.1"])  # fmt: skip
def test_an_open_port_without_certificates_is_refused(host):
    """Whoever reaches a worker's port runs code there."""
    with pytest.raises(UsageError, match=r"tcp:// is for 127\.0\.0\.1 alone; use tls://") as caught:
        read_address(f"tcp://{host}:8786", "--cluster")
    assert "cluster certificates --out DIR" in str(caught.value)
    assert read_address(f"tls://{host}:8786", "--cluster").host == host.strip("[]")


def test_loopback_is_this_machine_alone():
    assert all(map(is_loopback, ("localhost", "127.0.0.1", "127.9.9.9", "::1")))
    assert not any(map(is_loopback, ("", "localhost.evil", "10.0.0.1", "::", "0.0.0.0")))


def test_gpus_are_of_local_processes():
    for where, gpus in (("none", 1), ("local", -1), ("tcp://127.0.0.1:1", 1)):
        with pytest.raises(UsageError, match="--gpus is"), open_cluster(where, None, gpus):
            pass


def test_without_the_extra_one_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)  # what makes an import fail
    with pytest.raises(UsageError, match=r"Dask, which `\S+ \S*launch.py extras cluster` installs"):
        require_dask()
    with pytest.raises(UsageError, match="extras cluster"), open_cluster("local"):
        pass
    with open_cluster("none"):
        pass  # needs nothing


def test_the_command_asks_for_what_it_needs(tmp_path):
    with pytest.raises(UsageError, match="certificates wants --out DIR"):
        run(Options("certificates"))
    with pytest.raises(UsageError, match="scheduler wants an address"):
        run(Options("scheduler"))
    with pytest.raises(UsageError, match=r"tcp:// is for 127\.0\.0\.1 alone"):
        run(Options("worker", "tcp://10.0.0.1:8786"))
    for more in ({"workers": 0}, {"workers": 257}, {"gpus": -1}):
        with pytest.raises(UsageError, match="--workers and --gpus"):
            run(Options("worker", "tcp://127.0.0.1:8786", **more))


@pytest.fixture(scope="module")
def certificates(tmp_path_factory) -> Path:
    pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
    folder = tmp_path_factory.mktemp("certificates") / "pair"
    assert run(Options("certificates", out=folder)) == 0
    return folder


def test_certificates_are_for_their_owner_and_never_replaced(certificates):
    before = (certificates / "cluster-key.pem").read_bytes()
    if sys.platform != "win32":
        assert (certificates.stat().st_mode & 0o777, *(
            (certificates / name).stat().st_mode & 0o777
            for name in ("cluster.pem", "cluster-key.pem")
        )) == (0o700, 0o600, 0o600)  # fmt: skip
    with pytest.raises(UsageError, match="exists; name another --out"):
        write_certificates(certificates)
    assert (certificates / "cluster-key.pem").read_bytes() == before


def test_certificates_that_are_none_are_refused(certificates, tmp_path):
    def refused(match: str) -> None:
        with pytest.raises(UsageError, match=match):
            read_certificates(tmp_path, "tls://a:1")

    assert read_certificates(certificates, "tls://a:1").require_encryption
    with pytest.raises(UsageError, match="tls://a:1 wants --certificates DIR"):
        read_certificates(None, "tls://a:1")
    refused("there is no cluster.pem in it")
    for name in ("cluster.pem", "cluster-key.pem"):
        (tmp_path / name).write_bytes((certificates / name).read_bytes())
    (tmp_path / "cluster-key.pem").chmod(0o644)
    if sys.platform != "win32":
        refused("can be read by others")
    (tmp_path / "cluster-key.pem").chmod(0o600)
    (tmp_path / "cluster.pem").write_text("no certificate")
    refused("are no certificate and its key")
    write_certificates(tmp_path / "other")
    (tmp_path / "cluster.pem").write_bytes((tmp_path / "other" / "cluster.pem").read_bytes())
    refused("belong to different pairs")


def test_a_certificate_ends_after_a_year(certificates, monkeypatch):
    class Later(datetime.datetime):
        @classmethod
        def now(cls, zone=None):
            return super().now(zone) + datetime.timedelta(days=366)

    monkeypatch.setattr(datetime, "datetime", Later)
    with pytest.raises(UsageError, match="was valid until"):
        read_certificates(certificates, "tls://a:1")


JOBS = """
workers = 8
cores = 4
memory = "32GB"
interface = "ib0"
queue = "gpu"
gpus = 1
job_extra_directives = ["--qos=high"]
"""


def test_jobs_of_slurm_are_what_the_file_says(certificates, tmp_path, monkeypatch):
    """Never run here: what dask-jobqueue would be asked for."""
    file = tmp_path / "jobs.toml"
    file.write_text(JOBS)
    asked = job_options(read_jobs(file), certificates)
    assert asked["queue"] == "gpu" and asked["cores"] == 4 and asked["processes"] == 1
    assert asked["protocol"] == "tls://" and asked["security"].require_encryption
    assert asked["job_extra_directives"] == ["--qos=high", "--gres=gpu:1"]
    assert asked["worker_extra_args"][-2:] == ["--resources", "gpu=1"]
    assert "workers" not in asked and "gpus" not in asked
    with pytest.raises(UsageError, match="wants --certificates DIR"):
        job_options(read_jobs(file), None)
    monkeypatch.setitem(sys.modules, "dask_jobqueue", None)
    with pytest.raises(UsageError, match=r"launch\.py extras slurm`"):
        with slurm_cluster(file, certificates):
            pass


@pytest.mark.parametrize(("text", "match"), [
    ("workers = 0", "workers is 0, expected a whole number from 1"),
    ("workers = true", "workers is True"), ("cores = 'four'", "cores is 'four'"),
    ("job_extra_directives = [1]", "expected a list of texts"), ("shell = 'x'", "has 'shell'"),
    ("workers = 1", "lacks 'cores'"), ("=", "not TOML"), ("#" * 70_000, "expected a few lines"),
])  # fmt: skip
def test_other_files_of_jobs_are_refused(tmp_path, text, match):
    file = tmp_path / "jobs.toml"
    file.write_text(text)
    with pytest.raises(UsageError, match=match):
        read_jobs(file)
    with pytest.raises(UsageError, match="No such file"):
        read_jobs(tmp_path / "none.toml")
