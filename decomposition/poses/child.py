"""Runs colmap_run.py in a process of its own and passes on what it tells."""

import json
import queue
import sqlite3
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import IO

from shapeshift.decomposition.poses.colmap_run import ABSENT
from shapeshift.runtime_models.model import BadFile

Progress = Callable[[str, int, int], None]  # what is done now, how many of how many
POLL_S = 0.5


def run_child(what: str, job: Path, log: Path, progress: Progress) -> list[dict]:
    """Does `what` of the job; returns what it reports besides progress.

    Interrupted, it ends the process; what that wrote into its database stays for the next run.
    Raises BadFile where the process does not end well.
    """
    script = str(Path(__file__).with_name("colmap_run.py"))
    command = [sys.executable, "-P", script, what, str(job)]
    with log.open("ab") as errors:
        child = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors
        )
        try:
            reports = listen(child, log.parent / "database.db", progress)
            code = child.wait()
        finally:
            child.kill()
            child.wait()
            for stream in (child.stdin, child.stdout):
                if stream is not None:
                    stream.close()
    if code == ABSENT:
        raise BadFile("pycolmap, which finds poses, is not installed; install the requirements.")
    if code:
        raise BadFile(
            f"the search for poses ended with code {code}, perhaps for want of memory; {log} has "
            "its last words.  Try smaller photos (--side) or fewer (--every)."
        )
    return reports


def listen(child: subprocess.Popen, database: Path, progress: Progress) -> list[dict]:
    """The JSON objects that are no progress, until the process ends its output."""
    lines: queue.Queue[dict | None] = queue.Queue()
    threading.Thread(target=read_lines, args=(child.stdout, lines), daemon=True).start()
    kept: list[dict] = []
    watched: dict = {}
    while True:
        try:
            said = lines.get(timeout=POLL_S)
        except queue.Empty:
            if watched:
                done = rows_of(database, watched["watch"])
                progress(watched["stage"], done, watched["of"])
            continue
        if said is None:
            return kept
        watched = said if "watch" in said else {}
        if "done" in said:
            progress(said["stage"], said["done"], said["of"])
        elif not watched:
            kept.append(said)


def read_lines(stream: IO[bytes], lines: "queue.Queue[dict | None]") -> None:
    """Puts each JSON object of the stream into the queue, None at its end; other words are left."""
    for said in objects_of(stream):
        lines.put(said)
    lines.put(None)


def objects_of(stream: IO[bytes]) -> Iterator[dict]:
    try:
        for line in stream:
            try:
                said = json.loads(line)
            except ValueError:
                continue
            if isinstance(said, dict):
                yield said
    except ValueError:  # closed while it was read: the program is being interrupted
        return


def rows_of(database: Path, table: str) -> int:
    """How many rows a table has; 0 where it is not there yet, or being written."""
    try:
        with closing(sqlite3.connect(f"{database.as_uri()}?mode=ro", uri=True)) as base:
            return base.execute(f"select count(*) from {table}").fetchone()[0]
    except sqlite3.Error:
        return 0
