"""What --cluster costs around tasks: start, memory, processor time a task, and a second start.

    python3 tools/app/cluster.py --out docs/bench/cluster.csv

Each row is a process of its own.  The task is `cameras`, which converts a file of eight cameras;
alone_ms: that command started by hand.  start_cpu_s: of opening and closing the cluster without a
task.  processes and memory_mb: all of them while no task runs.  over_alone_ms: processor time a
task beyond the command alone.  again_ms: a task that is done already.  Processor time is that of
all processes.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.app.cluster.open_cluster import open_cluster  # noqa: E402
from shapeshift.app.cluster.task import Task  # noqa: E402
from shapeshift.app.measure import processor  # noqa: E402
from shapeshift.scene.cameras.camera_list import CameraList  # noqa: E402
from shapeshift.scene.cameras.framing import orbit_path  # noqa: E402
from shapeshift.scene.cameras.write_cameras import write_cameras  # noqa: E402

WHERE = ("none", "local:1", "local:2")
TASKS = 8
COLUMNS = "cluster,start_cpu_s,processes,memory_mb,tasks,alone_ms,over_alone_ms,again_ms"


def cpu_s() -> float:
    """Of this process and of its children that have ended."""
    used = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(each.ru_utime + each.ru_stime for each in used)


def family() -> list[int]:
    """This process and all below it."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parents[int(stat.parent.name)] = int(stat.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue  # it has ended
    found = {os.getpid()}
    while more := {p for p, parent in parents.items() if parent in found} - found:
        found |= more
    return sorted(found)


def memory_mb(pids: list[int]) -> float:
    """Proportional: pages that several share are counted once."""
    total = 0
    for pid in pids:
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                total += int(line.split()[1]) * 1024
    return total / 1e6


def tasks_in(folder: Path) -> list[Task]:
    cameras = folder / "cameras.json"
    views = orbit_path(8, np.zeros(3), 1.0, (64, 48))
    write_cameras(CameraList(tuple(views), ("",) * 8, "bench"), cameras, "ours")
    made = []
    for number in range(TASKS):
        out = str(folder / f"{number}.json")
        argv = ("cameras", str(cameras), "--to", "nerfstudio", "--out", out)
        made.append(Task(f"task {number}", argv, (str(cameras),), (out,)))
    return made


def spent(where: str, tasks: list[Task]) -> tuple[float, float, int, float]:
    """(processor seconds of a cluster that does the tasks, those of doing them once more, its
    processes, their MB at rest).
    """
    began = cpu_s()
    with open_cluster(where) as cluster:
        pids = family()
        memory = memory_mb(pids)
        if tasks:
            cluster.run(tasks)
        done = cpu_s()
        cluster.run(tasks)  # in this process alone: no worker hears of it
        again = cpu_s() - done
    return cpu_s() - began - again, again, len(pids), memory


def row(where: str) -> str:
    """In this process."""
    with tempfile.TemporaryDirectory() as name:
        tasks = tasks_in(Path(name))
        began = cpu_s()
        for task in tasks:
            command = [sys.executable, str(ROOT / "shapeshift" / "__main__.py"), *task.argv]
            subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
            os.unlink(task.writes[0])
        alone = (cpu_s() - began) / TASKS
        spent(where, [])  # imports of this process
        start, _, processes, memory = spent(where, [])
        whole, again, _, _ = spent(where, tasks)
    over = (whole - start) / TASKS - alone
    return (
        f"{where},{start:.2f},{processes},{memory:.0f},{TASKS},{1000 * alone:.0f},"
        f"{1000 * over:.0f},{1000 * again / TASKS:.1f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path)
    parser.add_argument("--row", choices=WHERE, help="this row alone, in this process")
    asked = parser.parse_args()
    if asked.row:
        sys.stdout.write(row(asked.row) + "\n")
        return
    rows = []
    for where in WHERE:
        command = [sys.executable, __file__, "--row", where]
        rows.append(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        sys.stdout.write(rows[-1])
    if asked.out:
        head = "# python3 tools/app/cluster.py --out docs/bench/cluster.csv\n"
        head += f"# {processor()}, {os.cpu_count()} cores\n"
        asked.out.write_text(head + COLUMNS + "\n" + "".join(rows))


if __name__ == "__main__":
    main()
