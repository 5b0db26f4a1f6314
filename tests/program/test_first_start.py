"""The set-up of .venv: what it calls, what it says where that fails, and what is mended."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

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

    def end(words, lock, log):
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
     ("ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE. If you have\n"
      "    numpy==2.4.6 from https://index/numpy.whl (from -r requirements.lock (line 9)):\n"
      "        Expected sha256 aa\n             Got        bb\n",
      "what came as numpy==2.4.6 is not a file that the lock names"),
     ("ERROR: In --require-hashes mode, all requirements must have their versions pinned with ==."
      " These do not:\n    other from https://index/other.whl (from one==1)\n",
      "the lock lacks other; tools/packaging/lock.py makes it anew"),
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


# What editors see


@pytest.fixture
def stubs(tmp_path, monkeypatch) -> Path:
    """Where the stubs of an environment go."""
    monkeypatch.setattr(first_start, "VENV", tmp_path)
    site = tmp_path / ("Lib/site-packages" if os.name == "nt" else "lib/python3.11/site-packages")
    site.mkdir(parents=True)
    return site / "shapeshift-stubs"


def test_every_module_of_the_package_leads_into_the_checkout(stubs):
    first_start.write_stubs()
    table = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    folders = [name.split(".")[1:] for name in table["packages"]]
    modules = {path.relative_to(ROOT).with_suffix(".pyi") for parts in folders
               if parts and (ROOT / parts[0]).is_dir()
               for path in ROOT.joinpath(*parts).glob("*.py")}  # fmt: skip
    written = {path.relative_to(stubs) for path in stubs.rglob("*.*")}
    assert len(modules) > 400 and written == modules | {Path("__init__.pyi"), Path("py.typed")}
    assert (
        (stubs / "renderer/renderer.pyi")
        .read_text()
        .startswith("from renderer.renderer import *\n")
    )
    face = ROOT / "shapeshift/__init__.pyi"
    assert (stubs / "__init__.pyi").read_text() == face.read_text()


@pytest.fixture
def checkout(tmp_path, monkeypatch) -> Path:
    """A small one, in place of this."""
    root = tmp_path / "checkout"
    for name, text in {
        "pyproject.toml": '[tool.setuptools.package-dir]\n"shapeshift" = "shapeshift"\n'
                          '"shapeshift.room" = "room"\n',
        "shapeshift/__init__.pyi": "",
        "room/__init__.py": "",
        "room/deep/wall.py": "import _io\n_A = 1\n_b: int = 2\nC = 3\n_d == 4\nclass _E:\n"
                             "    _f = 5\ndef _g(): ...\nasync def _h(): ...\n__all__ = []\n",
        "tools/hammer.py": "",
    }.items():  # fmt: skip
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    monkeypatch.setattr(first_start, "ROOT", root)
    return root


def test_stubs_follow_the_files_and_nothing_else_is_written(stubs, checkout):
    first_start.write_stubs()
    found = {path.relative_to(stubs).as_posix(): path for path in stubs.rglob("*.pyi")}
    assert sorted(found) == ["__init__.pyi", "room/__init__.pyi", "room/deep/wall.pyi"]
    assert found["room/__init__.pyi"].read_text() == "from room import *\n"
    first, *others = found["room/deep/wall.pyi"].read_text().splitlines()
    assert first == "from room.deep.wall import *"
    assert others == [f"from room.deep.wall import {n} as {n}" for n in ("_A", "_E", "_b", "_g",
                                                                         "_h")]  # fmt: skip
    before = found["room/__init__.pyi"].stat().st_mtime_ns
    (checkout / "room/deep/wall.py").rename(checkout / "room/deep/floor.py")
    first_start.write_stubs()
    assert not found["room/deep/wall.pyi"].exists() and (stubs / "room/deep/floor.pyi").exists()
    assert found["room/__init__.pyi"].stat().st_mtime_ns == before


SPOILT = {
    "a file where the folder would be": lambda root, stubs: stubs.write_text(""),
    "no table of folders": lambda root, stubs: (root / "pyproject.toml").unlink(),
    "a table that is none": lambda root, stubs: (root / "pyproject.toml").write_text("[tool"),
    "a table without folders": lambda root, stubs: (root / "pyproject.toml").write_text(""),
    "a source in Latin-1": lambda root, stubs: (root / "room/a.py").write_bytes(b"# \xfc\n"),
}


@pytest.mark.parametrize("spoil", SPOILT.values(), ids=SPOILT)
def test_without_stubs_the_program_starts_all_the_same(stubs, checkout, capsys, spoil):
    spoil(checkout, stubs)
    first_start.write_stubs()
    said = capsys.readouterr().err
    assert said.startswith("Editors will not follow imports: ") and said.count("\n") == 1


def test_the_tests_bring_the_stubs_to_the_files(calls, monkeypatch):
    written = []
    monkeypatch.setattr(first_start, "write_stubs", lambda: written.append(True))
    for testing, times in ((False, 1), (False, 1), (True, 2), (True, 3)):
        first_start.make_environment(testing)
        assert len(written) == times
