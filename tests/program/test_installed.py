"""What the program says of itself: name, version, help; and that nobody has to read it all."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
SCRIPT = "import sys; from shapeshift.app.cli import main; sys.exit(main())"  # as pip writes it


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """A folder of packages with ours in it, laid out as pyproject.toml says."""
    folder = tmp_path_factory.mktemp("site")
    for package, source in PROJECT["tool"]["setuptools"]["package-dir"].items():
        shutil.copytree(ROOT / source, folder / package.replace(".", "/"),
                        ignore=shutil.ignore_patterns("__pycache__"))  # fmt: skip
    return folder


def run_installed(site: Path, *words: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-P", "-c", SCRIPT, *words], capture_output=True, text=True, timeout=120,
        cwd=site.parent, env={**os.environ, "PYTHONPATH": str(site)},
    )  # fmt: skip


def test_an_installed_program_has_its_own_name_and_no_tests(site):
    told = run_installed(site, "--help")
    assert told.returncode == 0 and told.stdout.startswith("usage: shapeshift [command] [options]")
    assert "launch.py" not in told.stdout and not re.search(r"^  test ", told.stdout, re.M)
    told = run_installed(site, "info", "--help")
    assert told.stdout.startswith("usage: shapeshift info SCENE [options]")
    told = run_installed(site, "tets")
    assert told.returncode == 2 and "did you mean" not in told.stderr
    told = run_installed(site, "info", str(ROOT / "assets" / "workshop.shift"), "--json")
    assert told.returncode == 0, told.stderr


def test_a_checkout_says_launch_py_and_has_tests():
    told = launch("--help").stdout
    assert told.startswith(("usage: python3 launch.py [command]", "usage: py launch.py [command]"))
    assert re.search(r"^  test +run the tests$", told, re.M)
    assert "did you mean test?" in launch("tets").stderr


@pytest.mark.parametrize("words", [("--version",), ("help", "render"), ("--help",), ("help",)])
def test_what_needs_no_scene_is_said_at_once(words):
    told = launch(*words)
    assert told.returncode == 0 and told.stderr == ""
    if words == ("--version",):
        assert told.stdout == f"shapeshift {PROJECT['project']['version']}\n"
    else:
        assert told.stdout.startswith("usage: ")


def launch(*words: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-m", "shapeshift", *words], capture_output=True, text=True, cwd=ROOT,
        timeout=120,
    )  # fmt: skip


LONG_READS = {
    "the list of commands": ("--help",),
    "a command's options": ("train", "--help"),
    "the version": ("--version",),
    "what is in a scene": ("info", "assets/workshop.shift"),
    "JSON": ("info", "assets/workshop.shift", "--json"),
}


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such pipes")
@pytest.mark.parametrize("streams", ["stdout", "both"])
@pytest.mark.parametrize("what", LONG_READS)
def test_nobody_has_to_read_to_the_end(what, streams):
    """The other end of the pipe is closed before a word is written: as `| head -1`, worse."""
    read_end, write_end = os.pipe()
    os.close(read_end)
    try:
        done = subprocess.run(
            [sys.executable, "-m", "shapeshift", *LONG_READS[what]], cwd=ROOT, timeout=120,
            stdout=write_end, stderr=write_end if streams == "both" else subprocess.PIPE,
            env={**os.environ, "PYTHONUNBUFFERED": ""},
        )  # fmt: skip
    finally:
        os.close(write_end)
    assert done.returncode == 0
    assert not done.stderr, done.stderr


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such pipes")
def test_a_refusal_that_nobody_reads_is_one_all_the_same():
    read_end, write_end = os.pipe()
    os.close(read_end)
    done = subprocess.run(
        [sys.executable, "-m", "shapeshift", "info", "nothing.ply"], cwd=ROOT, timeout=120,
        stdout=subprocess.PIPE, stderr=write_end,
    )  # fmt: skip
    os.close(write_end)
    assert done.returncode == 2 and done.stdout == b""
