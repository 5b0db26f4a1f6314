"""Files of a few bytes that ask for gigabytes: refused, in memory that their bytes explain.

Measured in processes of their own, as the system sees it.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import tests.support.hostile.format_bombs  # noqa: F401  which adds its own to BOMBS
from shapeshift.scene.captures.photo import FREE_PIXELS, PIXEL
from tests.support.hostile.bombs import BOMBS

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="memory is told by /proc"
)
RUN = Path(__file__).parents[1] / "support" / "hostile" / "bomb_run.py"
# Written out, and not what the program believes: docs/formats.md, "Memory".
A_BYTE, FREE = 64, 64 << 20
BESIDE = 48 << 20  # bytes: what the allocator rounds up, code that runs for the first time
PICTURES = ("photo", "depth", "trained")  # readers whose free amount is told in pixels
OPEN = {  # bombs that are none any more, or files at the edge of what is taken on trust
    "frames that each repeat what is said for all", "mesh of twenty thousand materials",
    "photo as large as one may be whatever its bytes", "training photo as large as one may be",
}  # fmt: skip


def size_of(path: Path) -> int:
    return sum(f.stat().st_size for f in (path.rglob("*") if path.is_dir() else [path]))


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> dict[str, tuple[int, dict]]:
    """Of each bomb its bytes and what reading it took."""
    paths, command = {}, [sys.executable, str(RUN)]
    for i, (name, (make, reader)) in enumerate(BOMBS.items()):
        folder = tmp_path_factory.mktemp(f"bomb{i}")
        paths[name] = make(folder)
        command += [reader, str(paths[name])]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    lines = map(json.loads, done.stdout.splitlines())
    return {n: (size_of(p), line) for (n, p), line in zip(paths.items(), lines, strict=True)}


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_takes_no_more_than_its_bytes_explain(results, name):
    size, line = results[name]
    assert "fault" not in line, line
    free = FREE_PIXELS * PIXEL if BOMBS[name][1] in PICTURES else FREE
    assert line["bytes"] <= A_BYTE * size + free + BESIDE, (line["bytes"] >> 20, size, line)
    assert line["seconds"] < 20
    if name not in OPEN:
        said = line["refused"]
        assert said and "\n" not in said and len(said) < 400
        assert said.endswith("."), said


@pytest.mark.parametrize(
    "name", ["package of 600 000 anchors of 1000 bytes", "package of 45 million anchors"]
)
def test_the_packages_that_took_gigabytes_are_refused_at_once(results, name):
    """55 kB took 10 GB, 36 kB took 1.4: now hardly more than the program itself."""
    size, line = results[name]
    assert size < 1_000_000 and line["bytes"] < FREE and line["seconds"] < 2
    assert "--memory" in line["refused"] or "a number in it is wrong" in line["refused"]
