"""extras: what it installs, into which environment, and every way in which it cannot."""

import re
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

from shapeshift.app import cli, first_start
from shapeshift.app.commands import extras
from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.program import EXTRAS, install_words, package_words, program

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def absent(monkeypatch):
    """Nothing optional is installed, and pip is not started: `said` is what it would say."""
    said = {"code": 1, "text": "", "words": []}

    def run_pip(words, lock, log, python, temporary, hear, every_s):
        said["words"] = words
        said["kept"] = Path(words[2]).read_text()
        said["temporary"] = Path(temporary)
        log.write_text(said["text"])
        return said["code"]

    monkeypatch.setattr(extras, "loads", lambda extra: "No module named 'it'")
    monkeypatch.setattr(extras, "refuse_environment", lambda: None)
    monkeypatch.setattr(first_start, "run_pip", run_pip)
    return said


def refused(capsys, *words) -> str:
    assert cli.main(["extras", *words]) == 2
    told = capsys.readouterr()
    assert told.err.count("\n") == 1, told.err
    return told.err


def test_the_table_says_what_the_project_offers():
    offered = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    offered = offered["optional-dependencies"]
    assert EXTRAS.keys() == offered.keys() - {"dev"}
    for name, extra in EXTRAS.items():
        pins = {each.partition("==")[0]: each.partition("==")[2] for each in extra.packages}
        lowest = {each.partition(">=")[0]: each.partition(">=")[2] for each in offered[name]}
        assert pins.keys() == lowest.keys(), name
        for package, version in pins.items():
            numbers = [list(map(int, text.split("."))) for text in (version, lowest[package])]
            assert numbers[0] >= numbers[1], package
    tested = (ROOT / "requirements-test.txt").read_text()
    assert all(pin in tested for pin in ("av==", "usd-core=="))
    for name in ("film", "usd"):
        assert EXTRAS[name].packages[0] in tested  # the version that the tests run with


def test_without_names_they_are_listed(capsys):
    assert cli.main(["extras"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[:-1]] == list(EXTRAS)
    assert lines[-1] == f"`{program()} extras NAME` installs one."
    assert all(re.search(r" (\d+ MB|installed)  \S", line) for line in lines[:-1])


def test_a_misspelt_name_installs_nothing(absent, capsys):
    said = refused(capsys, "film", "thermall")
    assert "no extra 'thermall'; give some of film, thermal, usd, cluster, slurm." in said
    assert not absent["words"]


def test_what_is_there_is_not_installed_again(absent, monkeypatch, capsys):
    monkeypatch.setattr(extras, "loads", lambda extra: "")
    assert cli.main(["extras", "film", "film"]) == 0
    assert capsys.readouterr().out == "film: installed already.\n" and not absent["words"]


def test_pip_gets_the_pins_and_leaves_the_rest_as_it_is(absent, monkeypatch, capsys):
    answers = iter(["absent", "absent", "", ""])  # before, and after
    monkeypatch.setattr(extras, "loads", lambda extra: next(answers))
    absent["code"] = 0
    assert cli.main(["extras", "slurm", "film"]) == 0
    assert capsys.readouterr().out == "slurm: installed.\nfilm: installed.\n"
    assert absent["words"][:2] == ["install", "--constraint"]
    assert absent["words"][3:] == sorted(EXTRAS["slurm"].packages + EXTRAS["film"].packages)
    assert re.search(r"^numpy==\d", absent["kept"], re.M)
    assert not absent["temporary"].exists()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("NewConnectionError('refused')", "the package index cannot be reached"),
        ("ERROR: No matching distribution found for usd-core==26.11",
         "the package index has no usd-core==26.11 for Python 3."),
        ("  error: subprocess-exited-with-error\nERROR: Failed building wheel for flyr",
         "flyr has to be built here, and that failed"),
        ("error: metadata-generation-failed", "a package has to be built here, and that failed"),
        ("ERROR: ResolutionImpossible: for help", "it wants other versions of packages"),
        ("OSError: [Errno 28] No space left on device", "the disk is full"),
        ("", "pip has said nothing yet"),
    ],
)  # fmt: skip
def test_a_failure_is_one_sentence(absent, capsys, text, why):
    absent["text"] = text
    said = refused(capsys, "usd")
    assert said.startswith(f"shapeshift extras: usd could not be installed: {why}")
    assert "extras.log)" in said and not absent["temporary"].exists()


def test_what_loads_not_after_all_is_said(absent, capsys):
    absent["code"] = 0
    assert "usd is installed and does not load (No module named 'it')" in refused(capsys, "usd")


def test_environments_that_are_not_ours_are_left_alone(monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "prefix", sys.base_prefix)
    site, lib = tmp_path / "site", tmp_path / "lib"
    paths = {"purelib": str(site), "stdlib": str(lib)}
    monkeypatch.setattr(sysconfig, "get_path", paths.__getitem__)
    with pytest.raises(UsageError, match="may not be written by you"):
        extras.refuse_environment()  # there is none
    site.mkdir()
    extras.refuse_environment()
    lib.mkdir()
    (lib / "EXTERNALLY-MANAGED").touch()
    with pytest.raises(UsageError, match="managed by the system"):
        extras.refuse_environment()
    monkeypatch.setattr(sys, "prefix", str(tmp_path))  # a virtual environment of such a Python
    extras.refuse_environment()
    monkeypatch.setattr(extras.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(UsageError, match="has no pip"):
        extras.refuse_environment()


def test_sentences_name_the_door_that_was_used(monkeypatch):
    assert re.fullmatch(r"`\S+ \S*launch\.py extras film`", install_words("film"))
    assert package_words("av") == install_words("film")
    assert package_words("dask-jobqueue") == install_words("slurm")
    assert sys.executable in package_words("coacd")
    monkeypatch.setattr("shapeshift.runtime_models.program.is_installed", lambda: True)
    assert install_words("usd") == "`shapeshift extras usd`"


def test_no_sentence_names_another_pip():
    """A bare pip belongs to another Python than the one that the program runs in."""
    bare = re.compile(r"(?<!-m )pip install|python -m pip")
    ours = [
        path
        for top in (
            "app",
            "scene",
            "renderer",
            "runtime_models",
            "training",
            "vr",
            "decomposition",
            "rasterizer",
        )
        for path in (ROOT / top).rglob("*.py")
    ]
    found = [path.name for path in ours if bare.search(path.read_text(encoding="utf-8"))]
    assert found == ["extras.py"]  # uv's, where an environment has no pip


@pytest.mark.slow
def test_a_real_environment_gets_it(tmp_path, monkeypatch, capsys):
    """A wheel made here in place of av's: pip, its constraints and the check are real."""
    wheel = tmp_path / "wheels" / "av-18.1.0-py3-none-any.whl"
    wheel.parent.mkdir()
    info = "av-18.1.0.dist-info"
    with zipfile.ZipFile(wheel, "w") as file:
        file.writestr("av/__init__.py", "")
        file.writestr(f"{info}/METADATA", "Metadata-Version: 2.1\nName: av\nVersion: 18.1.0\n")
        file.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nTag: py3-none-any\n")
        file.writestr(f"{info}/RECORD", "")
    venv.create(tmp_path / "env", with_pip=True)
    python = tmp_path / "env" / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    monkeypatch.setattr(sys, "executable", str(python))
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(wheel.parent))
    assert cli.main(["extras", "film"]) == 0
    assert capsys.readouterr().out == "film: installed.\n"
    subprocess.run([python, "-I", "-c", "import av"], check=True)
    monkeypatch.setattr(extras, "installed_versions", list)  # those of this Python, not of that
    assert "no flyr==5.1.0" in refused(capsys, "thermal")
