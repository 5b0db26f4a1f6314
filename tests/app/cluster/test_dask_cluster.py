"""Tasks on Dask's workers: the same bytes, killed workers, Ctrl-C, ports, strangers."""

import contextlib
import os
import signal
import socket
import ssl
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from shapeshift.app.cluster import run_task as running
from shapeshift.app.cluster.certificates import write_certificates
from shapeshift.app.cluster.open_cluster import open_cluster
from shapeshift.app.cluster.run_task import TaskFailed
from shapeshift.app.cluster.task import Task
from shapeshift.app.errors import UsageError
from tests.support.cluster.counting import (
    PRELOAD,
    STAND_IN,
    begun_from,
    counting_task,
    lives,
    pids,
)

pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="looks at processes and ports in /proc"
)
ROOT = Path(__file__).resolve().parents[3]
PATIENCE_S = 120.0


@pytest.fixture(scope="module")
def preload(tmp_path_factory) -> Path:
    file = tmp_path_factory.mktemp("preload") / "stand_in.py"
    file.write_text(PRELOAD)
    return file


@pytest.fixture(scope="module")
def two(preload) -> Iterator:
    """Two workers of this machine, one of them with a GPU's slot."""
    import dask

    with dask.config.set({"distributed.worker.preload": [str(preload)]}):
        with open_cluster("local:2", gpus=1) as cluster:
            yield cluster


def wait_for(*paths: str) -> None:
    until = time.monotonic() + PATIENCE_S
    while not all(map(os.path.exists, paths)) and time.monotonic() < until:
        time.sleep(0.02)
    assert all(map(os.path.exists, paths))


def test_none_and_two_workers_write_the_same_bytes(two, tmp_path, monkeypatch):
    monkeypatch.setattr(running, "START", STAND_IN)
    folders = [tmp_path / "none", tmp_path / "two"]
    with open_cluster("none") as here:
        for folder, cluster in zip(folders, (here, two), strict=True):
            folder.mkdir()
            tasks = [counting_task(folder, f"t{i}", 3 + i) for i in range(4)]
            cluster.run(tasks)
            cluster.run(tasks)  # does nothing twice
            assert [begun_from(task) for task in tasks] == [[0]] * 4
    for name in ("t0", "t1", "t2", "t3"):
        for ending in (".txt", ".txt.done.json"):
            one, other = ((folder / f"{name}{ending}").read_bytes() for folder in folders)
            assert one == other and len(one) >= 3


def test_a_killed_worker_is_replaced_and_its_task_goes_on(two, tmp_path):
    """kill -9 of the worker's process in the middle: the same bytes, from the checkpoint."""
    import threading

    task = counting_task(tmp_path, "killed", 300)
    failed: list[BaseException] = []

    def run() -> None:
        try:
            two.run([task])
        except BaseException as error:
            failed.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    wait_for(task.checkpoint)
    child, worker = pids(task)
    os.kill(worker, signal.SIGKILL)
    thread.join(PATIENCE_S)
    assert not thread.is_alive() and not failed
    first, second = begun_from(task)
    assert first == 0 < second < 300 and not lives(child) and not lives(worker)
    assert Path(task.writes[0]).read_text() == "x" * 300


def test_failures_and_slots_are_said_in_a_sentence(two, tmp_path):
    sad = Task("sad", ("no.py",), (), (str(tmp_path / "sad"),))
    absent = Task("absent", ("no.py",), (str(tmp_path / "no"),), (str(tmp_path / "other"),))
    good = counting_task(tmp_path, "good", 3, slots={"gpu": 1})
    with pytest.raises(TaskFailed, match=r"sad: ended with code 1; its last words: .*no\.py"):
        two.run([sad, good])
    assert Path(good.writes[0]).read_text() == "xxx"
    with pytest.raises(OSError, match="no"):  # it cannot be hashed either
        two.run([absent])
    with pytest.raises(UsageError, match="g wants 2 slot gpu, and none of the 2 workers"):
        two.run([counting_task(tmp_path, "g", 3, slots={"gpu": 2})])


def listening(processes: set[int]) -> dict[str, set[int]]:
    """Local addresses, in the kernel's hexadecimal, of processes' listening sockets -> ports."""
    inodes = set()
    for pid in processes:
        for link in Path(f"/proc/{pid}/fd").iterdir():
            try:
                target = os.readlink(link)
            except OSError:
                continue
            if target.startswith("socket:["):
                inodes.add(target[8:-1])
    found: dict[str, set[int]] = {}
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            row = line.split()
            if row[3] == "0A" and row[9] in inodes:
                address, port = row[1].split(":")
                found.setdefault(address, set()).add(int(port, 16))
    return found


def family(pid: int) -> set[int]:
    """A process and all below it."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parents[int(stat.parent.name)] = int(stat.read_text().rpartition(")")[2].split()[1])
        except (OSError, IndexError):
            continue
    found = {pid}
    while more := {p for p, parent in parents.items() if parent in found} - found:
        found |= more
    return found


def test_local_workers_listen_on_this_machine_alone(two):
    found = listening(family(os.getpid()))
    assert set(found) == {"0100007F"}  # 127.0.0.1
    assert len(found["0100007F"]) >= 6  # each of two workers two, and the scheduler


def test_nobody_else_of_this_machine_gets_in(two):
    """Others of the machine reach its ports, too: they need the certificate of this run."""
    from distributed import Client
    from distributed.security import Security

    address = two.client.scheduler.address
    assert address.startswith("tls://127.0.0.1:")
    for security in (None, Security.temporary()):
        reach = address if security else address.replace("tls", "tcp")
        with pytest.raises((OSError, TimeoutError)):
            Client(reach, security=security, timeout=2, set_as_default=False)


PARENT = """
import sys
sys.path.insert(0, {root!r})
def main():
    import dask
    from shapeshift.app.cluster.open_cluster import open_cluster
    from shapeshift.app.cluster.task import Task
    dask.config.set({{"distributed.worker.preload": [{preload!r}]}})
    try:
        with open_cluster("local:2") as cluster:
            cluster.run([Task(**each) for each in {tasks!r}])
    except KeyboardInterrupt:
        print("Interrupted.", file=sys.stderr)
        sys.exit(130)
if __name__ == "__main__":
    main()
"""


@pytest.mark.slow
def test_ctrl_c_leaves_no_process_and_all_to_go_on_with(two, tmp_path, preload):
    """As a terminal sends it: to the whole group."""
    tasks = [counting_task(tmp_path, f"c{i}", 500) for i in range(2)]
    script = tmp_path / "parent.py"
    script.write_text(
        PARENT.format(root=str(ROOT), preload=str(preload), tasks=[vars(task) for task in tasks])
    )
    with open(tmp_path / "said", "w") as said:
        parent = subprocess.Popen(
            [sys.executable, str(script)], start_new_session=True, stderr=said,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )  # fmt: skip
    wait_for(*(task.checkpoint for task in tasks))
    all_of_it = family(parent.pid)
    assert len(all_of_it) >= 5  # two workers, two tasks
    os.killpg(parent.pid, signal.SIGINT)
    assert parent.wait(PATIENCE_S) == 130
    until = time.monotonic() + 5  # multiprocessing's own tracker hears of it last
    while any(map(lives, all_of_it)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not [pid for pid in all_of_it if lives(pid)]
    said = (tmp_path / "said").read_text().splitlines()
    assert sorted(said) == ["Interrupted.", "c0: from 0", "c0: kept", "c1: from 0", "c1: kept"]
    for task in tasks:
        reached = int(Path(task.checkpoint).read_text())
        assert 0 < reached < 500 and not os.path.exists(task.writes[0])
    two.run(tasks)
    for task in tasks:
        assert begun_from(task)[1] > 0 and Path(task.writes[0]).read_text() == "x" * 500


def refuses_strangers(host: str, port: int) -> bool:
    """Whether who has no certificate hears nothing, in plain words and over TLS."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    with socket.create_connection((host, port), 10) as plain:
        plain.sendall(b"x" * 64)
        with contextlib.suppress(ConnectionError):
            if plain.recv(1) not in (b"", b"\x15"):  # nothing, or TLS's alert
                return False
    try:
        with socket.create_connection((host, port), 10) as raw:
            with context.wrap_socket(raw) as wrapped:
                return wrapped.recv(1) == b""
    except (ssl.SSLError, ConnectionError):
        return True


@pytest.mark.slow
def test_a_cluster_by_commands_turns_strangers_away(tmp_path, preload):
    """Certificates, a scheduler and a worker as they are started by hand, on one address."""
    host, port = "127.0.0.2", 20_000 + os.getpid() % 20_000  # not where all of this machine listen
    address, ours, theirs = f"tls://{host}:{port}", tmp_path / "ours", tmp_path / "theirs"
    write_certificates(ours)
    write_certificates(theirs)
    environment = os.environ | {"DASK_DISTRIBUTED__WORKER__PRELOAD": f"['{preload}']"}
    parts = []

    def start(*words: str) -> None:
        command = [sys.executable, str(ROOT / "shapeshift" / "__main__.py"), "cluster", *words]
        parts.append(subprocess.Popen(
            [*command, address, "--certificates", str(ours)], stderr=subprocess.PIPE, text=True,
            env=environment, cwd=tmp_path,
        ))  # fmt: skip
        assert "Ctrl-C ends" in parts[-1].stderr.readline()

    try:
        start("scheduler")
        start("worker")
        found = {}
        for part in parts:
            for where, ports in listening(family(part.pid)).items():
                found[where] = found.get(where, set()) | ports
        assert set(found) <= {"0100007F", "0200007F"} and port in found["0200007F"]
        task = counting_task(tmp_path, "tls", 3)
        with open_cluster(address, ours) as cluster:
            cluster.run([task])
        assert Path(task.writes[0]).read_text() == "xxx"
        with pytest.raises(UsageError, match=f"no scheduler answers at {address}"):
            with open_cluster(address, theirs):
                pass
        for each in found["0200007F"]:  # the scheduler's, the worker's and its nanny's
            assert refuses_strangers(host, each)
    finally:
        for part in reversed(parts):
            part.send_signal(signal.SIGINT)
            part.wait(PATIENCE_S)
    assert [part.returncode for part in parts] == [130, 130]
