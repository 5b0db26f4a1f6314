"""A task that counts, with a checkpoint after each step: a stand-in for the program's commands."""

import os
from pathlib import Path

from shapeshift.app.cluster.task import Task

# Instead of the program, under the same watch: the first word is a script.
STAND_IN = (
    "import sys; sys.path[:0] = {paths!r}; "
    "from shapeshift.app.cluster.run_task import watch_parent; watch_parent(); "
    "exec(open(sys.argv[1]).read())"
)
COUNT = """
import os, sys, time
out, resume = sys.argv[2], "--resume" in sys.argv
part = out + ".part"
n = int(open(part).read()) if resume else 0
open(out + ".from", "a").write(f"{n}\\n")
print(f"from {n}", file=sys.stderr, flush=True)
open(out + ".pid", "w").write(f"{os.getpid()} {os.getppid()}")
try:
    while n < int(sys.argv[3]):
        n += 1
        open(part + "x", "w").write(str(n))
        os.replace(part + "x", part)
        time.sleep(0.01)
except KeyboardInterrupt:
    print("kept", file=sys.stderr)
    sys.exit(130)
open(out, "w").write("x" * n)
"""
# For the workers of Dask, which are processes of their own.
PRELOAD = f"from shapeshift.app.cluster import run_task\nrun_task.START = {STAND_IN!r}\n"


def counting_task(folder: Path, name: str, steps: int, **more) -> Task:
    """It writes so many letters."""
    script, out = folder / "count.py", str(folder / f"{name}.txt")
    if not script.exists():
        script.write_text(COUNT)
    argv = (str(script), out, str(steps))
    return Task(
        name, argv, (str(script),), (out,), checkpoint=out + ".part", resume=("--resume",), **more
    )


def begun_from(task: Task) -> list[int]:
    """The step that each attempt has begun from."""
    return [int(line) for line in Path(task.writes[0] + ".from").read_text().split()]


def pids(task: Task) -> tuple[int, int]:
    """Of the last attempt's process and of who started it."""
    own, parent = Path(task.writes[0] + ".pid").read_text().split()
    return int(own), int(parent)


def lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
        return Path(f"/proc/{pid}/stat").read_text().split(") ")[1][0] != "Z"
    except (OSError, IndexError):
        return False
