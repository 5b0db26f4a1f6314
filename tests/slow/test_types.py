"""pyright over the whole repository: every import is found, and no folder has more errors than it
had.  `.venv/bin/basedpyright` says the same; its rules are in pyproject.toml."""

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from shapeshift.app import first_start

ROOT = Path(__file__).resolve().parents[2]
# Errors that are left, by folder; a folder that is not named has none.  A number may only become
# smaller.
MOST = {
    "tests": 3,
    "tests/app": 334,
    "tests/decomposition": 66,
    "tests/fixtures": 1,
    "tests/program": 31,
    "tests/rasterizer": 123,
    "tests/renderer": 210,
    "tests/runtime_models": 365,
    "tests/scene": 236,
    "tests/shapeshift": 35,
    "tests/slow": 12,
    "tests/support": 178,
    "tests/training": 183,
    "tests/vr": 75,
    "tests/web": 3,
    "tests/xr": 12,
}
NEVER = {"reportMissingImports", "reportUndefinedVariable", "reportUnusedCoroutine"}


def folder_of(path: Path) -> str:
    """The top folder, and for tests the one below, as MOST names them."""
    parts = path.relative_to(ROOT).parts[:-1]
    return "/".join(parts[: 2 if parts[:1] == ("tests",) else 1])


@pytest.fixture(scope="module")
def errors() -> dict[str, list[dict]]:
    """What pyright says, by folder."""
    pytest.importorskip("basedpyright", reason="the type checker is not installed here")
    if not first_start.PYTHON.exists():
        pytest.skip("no .venv, in which pyright looks for packages; launch.py test makes it")
    first_start.write_stubs()
    command = [sys.executable, "-m", "basedpyright", "--outputjson"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=1800)
    assert done.returncode in (0, 1), done.stdout[-2000:] + done.stderr  # 2: it could not check
    told = json.loads(done.stdout)
    assert told["summary"]["filesAnalyzed"] > 1000
    found: dict[str, list[dict]] = {}
    for each in told["generalDiagnostics"]:
        if each["severity"] == "error":
            found.setdefault(folder_of(Path(each["file"])), []).append(each)
    return found


def lines_of(errors: list[dict]) -> str:
    return "\n".join(
        f"{each['file']}:{each['range']['start']['line'] + 1}: {each['message']} "
        f"({each.get('rule')})"
        for each in errors
    )


@pytest.mark.slow
def test_every_import_and_every_name_is_found(errors):
    """These are no matter of taste anywhere."""
    lost = [each for found in errors.values() for each in found if each.get("rule") in NEVER]
    assert not lost, lines_of(lost)


@pytest.mark.slow
def test_no_folder_has_more_errors_than_it_had(errors):
    counts = Counter({folder: len(found) for folder, found in errors.items()})
    print(dict(sorted(counts.items())), counts.total())
    more = {folder: n for folder, n in counts.items() if n > MOST.get(folder, 0)}
    told = "\n".join(lines_of(errors[folder]) for folder in more)
    assert not more, f"{told}\n{more}, at most {MOST}"
