"""tests/xr/monado.sh where it cannot do its work: one sentence, no path, its own exit code."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("monado.sh")
CANNOT = 3  # exit code
INSTALLED = "echo installed"
NEEDS_BASH = ("bash", "sha256sum", "cut", "mkdir", "mktemp", "flock", "rm", "chmod", "cat", "id",
              "sort", "tail", "touch", "sh", "env", "dirname")  # fmt: skip

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux") or not shutil.which("flock"),
    reason="a script for Linux",
)


def run(folder: Path, **programs: str) -> subprocess.CompletedProcess:
    """The script with no other programs than those, by their text, and the plainest ones."""
    commands = folder / "commands"
    commands.mkdir()
    for name in NEEDS_BASH:
        if found := shutil.which(name):
            (commands / name).symlink_to(found)
    for name, text in programs.items():
        path = commands / name.replace("_", "-")
        path.unlink(missing_ok=True)
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)
    return subprocess.run(
        ["bash", SCRIPT, folder / "runtime"],
        env={"PATH": str(commands), "HOME": str(folder)},
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60,
    )  # fmt: skip


def said(ran: subprocess.CompletedProcess) -> str:
    """The one sentence why there is no runtime."""
    assert (ran.returncode, ran.stdout) == (CANNOT, ""), ran
    (line,) = [line for line in ran.stderr.splitlines() if not line.startswith("building")]
    assert line.startswith("no OpenXR runtime for the tests: ") and line.endswith(".")
    return line


def test_without_apt(tmp_path):
    assert "there is no apt here" in said(run(tmp_path))


def test_without_root_and_packages(tmp_path):
    told = said(run(tmp_path, apt_get="exit 0", dpkg_query="exit 1", id="echo 1000"))
    assert "libcjson1" in told and "needs root" in told


def test_without_the_packages_in_the_archive(tmp_path):
    refuses = "echo E: Unable to locate package libcjson1; exit 100"
    told = said(run(tmp_path, apt_get=refuses, dpkg_query="exit 1", id="echo 0"))
    assert "Unable to locate package" in told


def test_without_the_source_in_any_archive(tmp_path):
    told = said(run(tmp_path, apt_get="exit 0", dpkg_query=INSTALLED))
    assert "monado_25.0.0+dfsg.orig.tar.xz" in told


def test_a_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "runtime").write_text("a file")
    assert "cannot be written" in said(run(tmp_path, apt_get="exit 0", dpkg_query=INSTALLED))


def test_what_was_built_is_found_again(runtime, tmp_path):
    """Without a download or a build: the second call is quick."""
    ran = subprocess.run(
        ["bash", SCRIPT, runtime.folder],
        env=os.environ, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=30,
    )  # fmt: skip
    assert ran.returncode == 0 and not ran.stderr, ran
    assert Path(ran.stdout.strip()) == runtime.manifest(service=False)
    assert runtime.manifest(service=True).is_file()
