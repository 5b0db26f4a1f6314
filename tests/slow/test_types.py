"""mypy over the package as it is installed: no folder has more errors than it had."""

import re
import shutil
import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
# Errors that are left, by folder.  A number may only become smaller; 0 is where all of them go.
MOST = {
    "api": 0,
    "app": 0,
    "rasterizer": 0,
    "decomposition": 0,
    "renderer": 0,
    "runtime_models": 0,
    "scene": 0,
    "training": 0,
    "vr": 0,
}


@pytest.fixture(scope="module")
def errors(tmp_path_factory) -> dict[str, list[str]]:
    """The lines of mypy by folder, of the package laid out as a wheel has it."""
    site = tmp_path_factory.mktemp("site")
    for package, source in PACKAGES["package-dir"].items():
        shutil.copytree(ROOT / source, site / package.replace(".", "/"),
                        ignore=shutil.ignore_patterns("__pycache__"))  # fmt: skip
    command = [sys.executable, "-m", "mypy", "-p", "shapeshift", "--no-error-summary"]
    command += ["--config-file", str(ROOT / "pyproject.toml"), "--cache-dir", str(site / "cache")]
    done = subprocess.run(command, cwd=site, capture_output=True, text=True, timeout=1200)
    assert done.returncode in (0, 1), done.stdout + done.stderr  # 2: it could not check
    found: dict[str, list[str]] = {}
    for line in done.stdout.splitlines():
        if match := re.match(r"shapeshift/([^/:]+)[^:]*:\d+: error: ", line):
            found.setdefault(match[1], []).append(line)
    return found


@pytest.mark.slow
def test_no_folder_has_more_errors_than_it_had(errors):
    counts = {name: len(lines) for name, lines in errors.items()}
    print(dict(sorted(counts.items())), sum(counts.values()))
    more = {name: n for name, n in counts.items() if n > MOST.get(name, 0)}
    told = "\n".join(line for name in more for line in errors[name])
    assert not more, f"{told}\n{more}, at most {MOST}"


@pytest.mark.slow
def test_names_that_are_not_there_are_faults_everywhere(errors):
    """What is undefined, defined twice or called with too many arguments is no matter of taste."""
    kinds = Counter(
        kind for lines in errors.values() for line in lines
        if (kind := line.rsplit("[")[-1].rstrip("]")) in ("name-defined", "import-not-found")
    )  # fmt: skip
    assert not kinds
