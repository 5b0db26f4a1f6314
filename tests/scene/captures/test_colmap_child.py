"""Scripts with pycolmap in a process of their own: what is said where one does not end well."""

from collections import namedtuple

import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.colmap.colmap_child import FULL_BYTES, run_child

Usage = namedtuple("Usage", "total used free")
FAILURE = "it ended with code {code}; {log} has its last words."


def ended(folder, monkeypatch, ending: str, free: int) -> list[dict]:
    script = folder / "script.py"
    script.write_text(f"import os, sys\nprint('{{\"found\": 3}}', flush=True)\n{ending}\n")
    monkeypatch.setattr("shutil.disk_usage", lambda path: Usage(10**9, 10**9 - free, free))
    return run_child(script, [], folder / "log.txt", lambda *_: None, FAILURE)


@pytest.mark.parametrize("ending", ["os.abort()", "sys.exit(1)"])
def test_a_full_disk_is_told_from_other_ends(tmp_path, monkeypatch, ending):
    """SQLite's C++ wrapper ends the process by SIGABRT; it was said to be memory."""
    with pytest.raises(BadFile, match=f"the disk of {tmp_path} is full; make room there"):
        ended(tmp_path, monkeypatch, ending, FULL_BYTES - 1)
    with pytest.raises(BadFile, match="it ended with code"):
        ended(tmp_path, monkeypatch, ending, FULL_BYTES)


@pytest.mark.parametrize(("ending", "said"), [
    ("import signal; os.kill(os.getpid(), signal.SIGXCPU)", "took longer than these photos"),
    ("import signal; os.kill(os.getpid(), signal.SIGPROF)", "took longer than these photos"),
    ("sys.exit(4)", "this system limits no process"),
    ("sys.exit(3)", "is not installed"),
])  # fmt: skip
def test_what_a_limit_ended_is_said(tmp_path, monkeypatch, ending, said):
    with pytest.raises(BadFile, match=said):
        ended(tmp_path, monkeypatch, ending, 10**9)


@pytest.mark.parametrize("free", [0, 10**9])
def test_what_ends_well_gives_its_reports(tmp_path, monkeypatch, free):
    assert ended(tmp_path, monkeypatch, "", free) == [{"found": 3}]
