"""The set-up of .venv: what it calls, what it says where that fails, and what is mended.

The tests with real environments install two small wheels of their own, without any index.
"""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import pytest

import tests.support.hostile.poisoned_folder as poisoned_folder
from shapeshift.app import first_start

ROOT = Path(__file__).resolve().parents[2]


class Calls:
    """Stands for the Pythons that would be started; each ends with the code of its module."""

    def __init__(self, python: Path) -> None:
        self.words: list[tuple[str, ...]] = []
        self.codes = {"venv": 0, "pip": 0}
        self.said = b""
        self._python = python

    def __call__(self, python, *words, lock, **more):
        self.words.append(words)
        if words[1] == "venv":
            self._python.parent.mkdir(parents=True, exist_ok=True)
            self._python.touch()
        if hasattr(more.get("stdout"), "write"):
            more["stdout"].write(self.said)
        code = self.codes[words[1]]
        return subprocess.Popen([sys.executable, "-c", f"raise SystemExit({code})"],
                                stdout=subprocess.PIPE)  # fmt: skip

    @property
    def modules(self) -> list[str]:
        """venv and pip install, in their order."""
        return [words[1] for words in self.words if words[-1] != "--version"]


@pytest.fixture
def calls(tmp_path, monkeypatch) -> Calls:
    monkeypatch.setattr(first_start, "VENV", tmp_path / "venv")
    monkeypatch.setattr(first_start, "PYTHON", tmp_path / "venv/bin/python")
    monkeypatch.setattr(first_start, "missing_packages", lambda testing: [])
    calls = Calls(tmp_path / "venv/bin/python")
    monkeypatch.setattr(first_start, "run_python", calls)
    return calls


def test_first_start_installs_and_the_second_does_nothing(calls):
    first_start.make_environment(testing=False)
    assert calls.modules == ["venv", "pip"]
    calls.words.clear()
    first_start.make_environment(testing=False)
    assert calls.words == []


def test_the_test_environment_serves_the_program_too_but_not_the_other_way(calls):
    first_start.make_environment(testing=False)
    assert first_start.is_ready(False) and not first_start.is_ready(True)
    first_start.make_environment(testing=True)
    assert first_start.is_ready(False) and first_start.is_ready(True)
    assert calls.modules == ["venv", "pip", "pip"]


def test_a_failed_first_install_is_not_taken_for_a_finished_one(calls, capsys):
    calls.codes["pip"] = 1
    calls.said = b"ERROR: something new\n"
    with pytest.raises(SystemExit) as stopped:
        first_start.make_environment(testing=False)
    assert stopped.value.code == 2
    said = capsys.readouterr().err
    assert "pip could not install the requirements: something new (all" in said
    assert not first_start.is_ready(False)
    (first_start.VENV / "half").mkdir()
    calls.codes["pip"] = 0
    first_start.make_environment(testing=False)
    assert first_start.is_ready(False) and not (first_start.VENV / "half").exists()


def test_a_failed_update_leaves_what_there_was(calls):
    first_start.make_environment(testing=False)
    calls.codes["pip"] = 1
    calls.said = b"WARNING: Retrying ... connection broken by NewConnectionError\n"
    real, first_start.has_pip = first_start.has_pip, lambda lock: True
    try:
        with pytest.raises(SystemExit):
            first_start.make_environment(testing=True)
    finally:
        first_start.has_pip = real
    assert first_start.is_ready(False) and not first_start.is_ready(True)


def test_an_update_that_was_cut_short_is_made_anew(calls, monkeypatch):
    first_start.make_environment(testing=False)
    monkeypatch.setattr(first_start.sys, "version", "another Python")

    def end(words, lock):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(first_start, "run_pip", end)
        with pytest.raises(KeyboardInterrupt):
            first_start.make_environment(testing=False)
    assert (first_start.VENV / "unfinished").exists()
    calls.words.clear()
    first_start.make_environment(testing=False)
    assert calls.modules == ["venv", "pip"] and first_start.is_ready(False)


def test_an_environment_made_by_hand_is_added_to_and_never_emptied(calls):
    first_start.VENV.mkdir()
    for name in ("pyvenv.cfg", "mine"):
        (first_start.VENV / name).touch()
    calls.codes["pip"] = 1
    for _ in range(2):
        with pytest.raises(SystemExit):
            first_start.make_environment(testing=False)
    assert (first_start.VENV / "mine").exists()
    calls.codes["pip"] = 0
    first_start.make_environment(testing=False)
    assert (first_start.VENV / "mine").exists() and first_start.is_ready(False)


@pytest.mark.skipif(os.name == "nt", reason="links need rights on Windows")
def test_nothing_is_deleted_through_a_link(calls, tmp_path, capsys):
    other = tmp_path / "other"
    other.mkdir()
    for name in ("unfinished", "mine"):
        (other / name).touch()
    first_start.VENV.symlink_to(other)
    with pytest.raises(SystemExit):
        first_start.make_environment(testing=False)
    assert (other / "mine").exists()
    assert "is a link to an environment that is damaged" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("said", "words"),
    [("WARNING: Retrying (Retry(total=4)) after connection broken by "
      "'NewConnectionError(...)'\nERROR: No matching distribution found for numpy\n",
      "the package index cannot be reached; check the network"),
     ("ERROR: Could not find a version\nERROR: No matching distribution found for numpy==9\n",
      "the package index has no numpy==9 for Python 3."),
     ("ERROR: Could not install packages due to an OSError: [Errno 28] No space left on device",
      "the disk is full"),
     ("WARNING: Retrying ... SSLError(SSLCertVerificationError(1, '[SSL: CERTIFICATE_VERIFY_FAILED",
      "the certificate of the package index is not trusted"),
     ("ERROR: \x1b]0;owned\x07 wheel\n", "?]0;owned? wheel"),
     ("", "pip has said nothing yet")],
)  # fmt: skip
def test_why_pip_failed_is_one_sentence(calls, capsys, said, words):
    calls.codes["pip"], calls.said = 1, said.encode()
    with pytest.raises(SystemExit):
        first_start.make_environment(testing=False)
    *_, last = capsys.readouterr().err.splitlines()
    assert last.startswith("pip could not install the requirements: ") and words in last
    assert last.endswith("install.log).") and last.isprintable()


def test_changed_requirements_install_again(calls, monkeypatch):
    first_start.make_environment(testing=False)
    monkeypatch.setattr(first_start.sys, "version", "another Python")
    assert not first_start.is_ready(False)


def test_a_stamp_of_nonsense_is_none(calls):
    first_start.make_environment(testing=False)
    first_start.stamp_file(False).write_bytes(b"\xff\x00")
    assert not first_start.is_ready(False)


def test_without_root_one_line_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setattr(first_start.os, "geteuid", lambda: 1000)
    first_start.install_packages(["libegl1", "pocl-opencl-icd"])
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert "sudo apt-get install -y --no-install-recommends libegl1 pocl-opencl-icd" in lines[0]


def test_every_library_has_a_package():
    assert first_start.has_library("libc.so.6") or not sys.platform.startswith("linux")
    assert not first_start.has_library("libnot-there.so.9")


def test_the_lock_goes_with_the_last_process_that_has_it(tmp_path):
    """Two starts never change .venv at once, and no lock outlives those who held it."""
    waiting = [sys.executable, "-c", "import sys; sys.stdin.read()"]
    with first_start.one_at_a_time() as lock:
        assert lock is not None
        with open(first_start.__file__, "rb") as other:
            assert first_start.try_lock(other.fileno()) is False
        child = subprocess.Popen(waiting, stdin=subprocess.PIPE, pass_fds=[lock])
    with open(first_start.__file__, "rb") as other:
        assert first_start.try_lock(other.fileno()) is False  # pip of a start that was killed
        child.kill()
        child.wait()
        assert first_start.try_lock(other.fileno()) is True
    child.stdin.close()


# Real environments


def write_wheel(folder: Path, name: str, version: str) -> None:
    """A wheel of one module that says its version."""
    info = f"{name}-{version}.dist-info"
    files = {
        f"{name}.py": f"VERSION = {version!r}\n",
        f"{name}_data/numbers.txt": "1\n" * 400_000,
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\n"
        "Tag: py3-none-any\n",
    }
    record = "".join(f"{path},,\n" for path in files) + f"{info}/RECORD,,\n"
    with zipfile.ZipFile(folder / f"{name}-{version}-py3-none-any.whl", "w") as wheel:
        for path, text in [*files.items(), (f"{info}/RECORD", record)]:
            wheel.writestr(path, text)


class Project:
    """launch.py and its set-up beside a program that only says what it found."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.wheels = folder / "project", folder / "wheels"
        (self.folder / "app").mkdir(parents=True)
        self.wheels.mkdir()
        (self.folder / "shapeshift").mkdir()
        for name in (
            "launch.py",
            "shapeshift/__init__.py",
            "app/__init__.py",
            "app/first_start.py",
        ):
            shutil.copy(ROOT / name, self.folder / name)
        (self.folder / "shapeshift" / "__main__.py").write_text(
            "import one_wheel, other_wheel\nprint('started', one_wheel.VERSION)\n"
        )
        self.require("1.0")
        for wheel in (("one_wheel", "1.0"), ("one_wheel", "2.0"), ("other_wheel", "1.0"),
                      ("pocl_binary_distribution", "3.0")):  # fmt: skip
            write_wheel(self.wheels, *wheel)
        (folder / "bin").mkdir()  # neither apt-get nor anything else

    def require(self, version: str) -> None:
        text = f"one-wheel=={version}\nother-wheel==1.0\n"
        (self.folder / "requirements.txt").write_text(text)

    def start(self, cwd: Path | None = None, **more: str) -> subprocess.Popen:
        taken = ("PIP_INDEX_URL", "PIP_EXTRA_INDEX_URL")
        env = {k: v for k, v in os.environ.items() if k not in taken}
        env |= {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(self.wheels),
                "PATH": str(self.folder.parent / "bin")} | more  # fmt: skip
        return subprocess.Popen(
            [sys.executable, str(self.folder / "launch.py"), "info"], env=env, cwd=cwd,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        )  # fmt: skip

    def ends_well(self, process: subprocess.Popen, version: str = "1.0") -> str:
        """What was said on standard error."""
        out, err = process.communicate(timeout=240)
        assert (process.returncode, out) == (0, f"started {version}\n"), err
        assert "Traceback" not in err and "ERROR" not in err
        assert not (self.folder / ".venv" / "unfinished").exists()
        return err


@pytest.fixture
def project(tmp_path) -> Project:
    return Project(tmp_path)


@pytest.mark.slow
def test_a_real_first_start_an_update_and_one_that_cannot_be(project):
    said = project.ends_well(project.start())
    assert said.splitlines()[0].startswith(("First start", "Shapeshift needs system"))
    project.require("2.0")
    project.ends_well(project.start(), "2.0")
    assert project.ends_well(project.start(), "2.0") == ""
    project.require("3.0")
    refused = project.start()
    out, err = refused.communicate(timeout=240)
    assert refused.returncode == 2 and not out
    assert "the package index has no one-wheel==3.0" in err.splitlines()[-1]
    project.require("2.0")
    assert project.ends_well(project.start(), "2.0") == ""


@pytest.mark.slow
def test_an_index_that_is_not_there_is_one_sentence(project):
    port = "http://127.0.0.1:9/simple"  # discard: nothing listens
    refused = project.start(PIP_NO_INDEX="", PIP_FIND_LINKS="", PIP_INDEX_URL=port,
                            PIP_RETRIES="1")  # fmt: skip
    _, err = refused.communicate(timeout=240)
    assert refused.returncode == 2
    assert "WARNING" not in err and len(err.splitlines()) <= 4
    assert "the package index cannot be reached; check the network" in err.splitlines()[-1]
    project.ends_well(project.start())


@pytest.mark.slow
@pytest.mark.parametrize("how", ["kill", "kill launch.py alone", "interrupt"])
def test_a_start_that_is_cut_short_is_mended_by_the_next(project, how):
    began = time.monotonic()
    project.ends_well(project.start())
    whole = time.monotonic() - began
    for number in range(3):
        shutil.rmtree(project.folder / ".venv")
        process = project.start()
        time.sleep(random.Random(number).uniform(0.05, 0.95) * whole)
        if how == "kill launch.py alone":
            process.kill()
        else:
            os.killpg(process.pid, signal.SIGKILL if how == "kill" else signal.SIGINT)
        process.communicate()
        project.ends_well(project.start())
        assert project.ends_well(project.start()) == ""


@pytest.mark.slow
def test_an_update_that_is_killed_is_mended(project):
    project.ends_well(project.start())
    for number, version in enumerate(["2.0", "1.0", "2.0"]):
        project.require(version)
        process = project.start()
        time.sleep(random.Random(number).uniform(0.3, 1.5))
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        project.ends_well(project.start(), version)


@pytest.mark.slow
@pytest.mark.parametrize("apart", [0.0, 0.25])
def test_several_first_starts_at_once(project, apart):
    """All together, and a quarter of an installation apart: the last begins half-way through."""
    began = time.monotonic()
    project.ends_well(project.start())
    whole_s = time.monotonic() - began
    shutil.rmtree(project.folder / ".venv")
    processes = []
    for _ in range(3):
        processes.append(project.start())
        time.sleep(apart * whole_s)
    said = [project.ends_well(process) for process in processes]
    assert sum("Installing the Python packages" in text for text in said) == 1
    assert sum("Another start is setting up" in text for text in said) == 2


@pytest.mark.slow
def test_an_environment_without_pip_is_mended(project):
    """What an interrupted first start of earlier versions left behind."""
    python = [sys.executable, "-m", "venv", "--without-pip", str(project.folder / ".venv")]
    subprocess.run(python, check=True)
    project.ends_well(project.start())
    shutil.rmtree(next((project.folder / ".venv").glob("lib/*/site-packages/pip")))
    project.require("2.0")
    project.ends_well(project.start(), "2.0")


@pytest.mark.slow
def test_a_first_start_in_a_folder_of_poison(project, tmp_path):
    folder, mark = tmp_path / "downloads", tmp_path / "mark"
    folder.mkdir()
    poisoned_folder.fill(folder)
    project.ends_well(project.start(cwd=folder, **{poisoned_folder.MARK: str(mark)}))
    assert not mark.exists(), mark.read_text()


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="root may write everywhere")
def test_a_project_that_cannot_be_written_is_one_sentence(project):
    project.folder.chmod(0o555)
    refused = project.start()
    _, err = refused.communicate(timeout=60)
    project.folder.chmod(0o755)
    assert refused.returncode == 2 and "Permission denied" in err.splitlines()[-1]
