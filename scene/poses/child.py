"""Runs colmap_run.py in a process of its own and passes on what it tells."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import IO

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.poses.colmap_run import ABSENT

Progress = Callable[[str, int, int], None]  # what is done now, how many of how many


def run_child(what: str, job: Path, log: Path, progress: Progress) -> list[dict]:
    """Does `what` of the job; gives what was told beside progress.

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
            told = list(read_lines(child.stdout, progress))
            code = child.wait()
        finally:
            if child.poll() is None:
                child.kill()
            child.wait()
            child.stdin.close()
            child.stdout.close()
    if code == ABSENT:
        raise BadFile("pycolmap, which finds poses, is not installed; install the requirements.")
    if code:
        raise BadFile(
            f"the search for poses ended with code {code}, perhaps for want of memory; {log} has "
            "its last words.  Try smaller photos (--side) or fewer (--every)."
        )
    return told


def read_lines(lines: IO[bytes] | None, progress: Progress) -> list[dict]:
    """The JSON objects that are no progress; other libraries' words are left out."""
    kept = []
    for line in lines or ():
        try:
            said = json.loads(line)
        except ValueError:
            continue
        if not isinstance(said, dict):
            continue
        if "stage" in said:
            progress(said["stage"], said["done"], said["of"])
        else:
            kept.append(said)
    return kept
