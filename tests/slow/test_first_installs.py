"""First starts with real environments, of small wheels of their own, without any index."""

import hashlib
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
from shapeshift import which_python

ROOT = Path(__file__).resolve().parents[2]


def write_wheel(folder: Path, name: str, version: str, needs: str = "", more: str = "") -> None:
    """A wheel of one module that says its version."""
    info = f"{name}-{version}.dist-info"
    files = {
        f"{name}.py": f"VERSION = {version!r}  # {more}\n",
        f"{name}_data/numbers.txt": "1\n" * 400_000,
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
        + (f"Requires-Dist: {needs}\n" if needs else ""),
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
            "pyproject.toml",
            "shapeshift/__init__.py",
            "shapeshift/__init__.pyi",
            "shapeshift/which_python.py",
            "app/__init__.py",
            "app/first_start.py",
        ):
            shutil.copy(ROOT / name, self.folder / name)
        (self.folder / "shapeshift" / "__main__.py").write_text(
            "import one_wheel, other_wheel\nprint('started', one_wheel.VERSION)\n"
        )
        for wheel in (("one_wheel", "1.0"), ("one_wheel", "2.0"), ("other_wheel", "1.0"),
                      ("pocl_binary_distribution", "3.0")):  # fmt: skip
            write_wheel(self.wheels, *wheel)
        self.require("1.0")
        self.lock("requirements-opencl.lock", ["pocl-binary-distribution==3.0"])
        (folder / "bin").mkdir()  # neither apt-get nor anything else

    def require(self, version: str) -> None:
        self.lock("requirements.lock", [f"one-wheel=={version}", "other-wheel==1.0"])

    def lock(self, name: str, pins: list[str], pythons: str = "") -> None:
        """A lock of the wheels that are here; of one that is not, with the hash of nothing."""
        _, version, place, _, _ = which_python.describe()
        lines = [f"# fits {place}: {pythons or version}"]
        for pin in pins:
            wheel = self.wheels / f"{pin.replace('-', '_').replace('==', '-')}-py3-none-any.whl"
            data = wheel.read_bytes() if wheel.exists() else b""
            lines.append(f"{pin} --hash=sha256:{hashlib.sha256(data).hexdigest()}")
        (self.folder / name).write_text("\n".join(lines) + "\n")

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
    project.require("3.0")  # which the index does not have
    refused = project.start()
    out, err = refused.communicate(timeout=240)
    assert refused.returncode == 2 and not out
    assert "the package index has no one-wheel==3.0" in err.splitlines()[-1]
    project.require("2.0")
    assert project.ends_well(project.start(), "2.0") == ""


@pytest.mark.slow
def test_a_wheel_that_is_not_the_locked_one_is_one_sentence_and_never_ready(project):
    """Nothing of the set is installed, the next start tries again."""
    write_wheel(project.wheels, "one_wheel", "1.0", more="changed on its way")
    for _ in range(2):
        refused = project.start()
        out, err = refused.communicate(timeout=240)
        assert refused.returncode == 2 and not out and "Traceback" not in err
        last = err.splitlines()[-1]
        assert "what came as one-wheel==1.0 is not a file that the lock names" in last
        assert not list((project.folder / ".venv").glob("ready*"))
        assert not list((project.folder / ".venv").rglob("other_wheel.py"))
    project.require("1.0")
    project.ends_well(project.start())


@pytest.mark.slow
def test_what_a_locked_wheel_needs_and_the_lock_lacks_is_one_sentence(project):
    write_wheel(project.wheels, "one_wheel", "1.0", needs="forgotten_wheel")
    write_wheel(project.wheels, "forgotten_wheel", "1.0")
    project.require("1.0")
    refused = project.start()
    _, err = refused.communicate(timeout=240)
    assert refused.returncode == 2
    assert "the lock lacks forgotten_wheel" in err.splitlines()[-1].replace("-", "_")


def test_where_no_locked_package_fits_nothing_is_made(project):
    project.lock("requirements.lock", ["one-wheel==1.0"], pythons="3.99")
    refused = project.start(HOME=str(project.folder), PYENV_ROOT=str(project.folder))
    out, err = refused.communicate(timeout=60)
    assert refused.returncode == 2 and not out
    (line,) = err.splitlines()
    assert line.startswith("Shapeshift needs Python 3.99 to 3.99, this is 3.")
    assert not (project.folder / ".venv").exists()


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
