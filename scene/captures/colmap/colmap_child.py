"""Runs a script that uses pycolmap in a process of its own and passes on what it tells.

pycolmap is C++ that logs to standard error, holds the interpreter for minutes and ends the process
on what it does not like: none of this may happen to the program.
"""

import json
import queue
import shutil
import signal
import sqlite3
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import IO

from shapeshift.runtime_models.model import BadFile

Progress = Callable[[str, int, int], None]  # what is done now, how many of how many
POLL_S = 0.5
FULL_BYTES = 1 << 20  # less is left on a full disk: its last write wanted more
# Exit codes of a script: pycolmap is not installed or does not load; nothing limits this process.
ABSENT, UNLIMITED = 3, 4
OVER_TIME = {-getattr(signal, name) for name in ("SIGPROF", "SIGXCPU") if hasattr(signal, name)}


def run_child(
    script: Path, words: list[str], log: Path, progress: Progress, failure: str
) -> list[dict]:
    """Runs the script; returns what it reports, JSON objects a line, besides progress.

    words: behind its name; log: gets its standard error, a database of it lies beside; failure: a
    sentence for when it does not end well, {code} and {log} are filled in.  Interrupted, it ends
    the process; what that wrote stays.  Raises BadFile.
    """
    # -P: this folder's modules are not to stand in for those of packages.
    command = [sys.executable, "-P", str(script), *words]
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
        raise BadFile(
            "pycolmap, which photos are matched with, is not installed; install the requirements."
        )
    if code == UNLIMITED:
        raise BadFile(
            "this system limits no process, and pycolmap reads strangers' photos in none."
        )
    if code in OVER_TIME:
        raise BadFile(
            f"pycolmap took longer than these photos should take; {log} has its last words.  Leave "
            "out photos that are damaged, or give fewer."
        )
    if code and shutil.disk_usage(log.parent).free < FULL_BYTES:  # C++ ends with SIGABRT then
        raise BadFile(f"the disk of {log.parent} is full; make room there and start it again.")
    if code:
        raise BadFile(failure.format(code=code, log=log))
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
