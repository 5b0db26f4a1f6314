"""The wheel, built, installed in an environment of its own, and used from another folder."""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import venv
from email.parser import HeaderParser
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
FOLDERS = ("app", "web", "renderer", "runtime_models", "scene", "vr", "rasterizer", "training",
           "decomposition", "assets", "shapeshift")  # fmt: skip
LEAST_SETUPTOOLS = 77  # as pyproject.toml says
pytestmark = pytest.mark.slow


def run(*words: str | Path, folder: Path, **more) -> subprocess.CompletedProcess:
    """In a folder that is not the checkout, with nothing of it on the path."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    return subprocess.run(
        [str(word) for word in words], cwd=folder, capture_output=True, text=True, timeout=600,
        env=kept, **more,
    )  # fmt: skip


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """Built from a copy, by the setuptools of the tests' own environment: no index is asked."""
    if int(version("setuptools").split(".")[0]) < LEAST_SETUPTOOLS:
        pytest.skip(f"setuptools {version('setuptools')} is older than {LEAST_SETUPTOOLS}")
    source = tmp_path_factory.mktemp("source")
    for name in FOLDERS:
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(ROOT / name, source)
    words = ("pip", "wheel", "--no-deps", "--no-build-isolation", "--quiet", "-w", "dist", ".")
    done = run(sys.executable, "-m", *words, folder=source)
    assert done.returncode == 0, done.stderr[-3000:]
    (made,) = (source / "dist").glob("*.whl")
    return made


@pytest.fixture(scope="module")
def clean(wheel, tmp_path_factory) -> Path:
    """The folder of an environment with this wheel; what it depends on is the tests' own."""
    folder = tmp_path_factory.mktemp("clean")
    venv.create(folder, with_pip=False, symlinks=os.name != "nt")
    words = ("--python", python_of(folder), "install", "--no-deps", "--no-index", "--quiet", wheel)
    done = run(sys.executable, "-m", "pip", *words, folder=folder)
    assert done.returncode == 0, done.stderr[-3000:]
    (site_of(folder) / "dependencies.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")
    return folder


def python_of(folder: Path) -> Path:
    return folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def site_of(folder: Path) -> Path:
    names = {"base": str(folder), "platbase": str(folder)}
    return Path(sysconfig.get_path("purelib", "venv", names))


@pytest.fixture
def elsewhere(tmp_path) -> Path:
    """A person's folder, with modules that have the names of our folders."""
    for name in ("scene", "app", "renderer", "vr", "assets"):
        (tmp_path / f"{name}.py").write_text("OWN = True\n")
    return tmp_path


def test_site_packages_has_one_name_of_ours(clean):
    names = {path.name for path in site_of(clean).iterdir()}
    number = PROJECT["version"]
    assert names == {"shapeshift", f"shapeshift-{number}.dist-info", "dependencies.pth"}
    files = {p.relative_to(site_of(clean) / "shapeshift") for p in site_of(clean).rglob("*.cl")}
    assert Path("rasterizer/kernels/raster_cpu.cl") in files
    for name in ("py.typed", "__init__.pyi", "assets/workshop.shift", "assets/demo.scene.json"):
        assert (site_of(clean) / "shapeshift" / name).is_file(), name


def test_everything_is_shipped_and_nothing_else(clean):
    """File by file as the checkout has it, but for what only a checkout needs."""
    installed = {
        p.relative_to(site_of(clean) / "shapeshift")
        for p in (site_of(clean) / "shapeshift").rglob("*")
        if p.is_file() and "__pycache__" not in p.parts
    }
    named = [p for f in FOLDERS for p in (ROOT / f).rglob("*") if p.is_file()]
    ours = {
        p.relative_to(ROOT / "shapeshift" if "shapeshift" == p.relative_to(ROOT).parts[0] else ROOT)
        for p in named
        if "__pycache__" not in p.parts and not p.name.endswith((".md", ".d.ts"))  # for readers
    }
    assert installed == ours


def test_each_module_exists_once_and_shadows_nothing(clean, elsewhere):
    code = """
import importlib, importlib.util, os, pkgutil, sys
import shapeshift, scene, app
assert scene.OWN and app.OWN, "a person's own modules are theirs"
before = list(sys.path)
skipped = {"shapeshift.__main__"}  # starts the program
names = [m.name for m in pkgutil.walk_packages(shapeshift.__path__, "shapeshift.")]
for name in names:
    if name not in skipped and not name.endswith("_run"):  # a child process each
        importlib.import_module(name)
assert sys.path == before, "nothing is put on the path"
files, root = {}, os.path.dirname(shapeshift.__file__)
for name, module in list(sys.modules.items()):
    file = getattr(module, "__file__", None)
    if file and file.startswith(root):
        files.setdefault(file, set()).add(name)
twice = {file: found for file, found in files.items() if len(found) > 1}
assert not twice, twice
assert all(n.split(".")[0] == "shapeshift" for found in files.values() for n in found)
assert len(files) > 400
for name in ("rasterizer", "runtime_models", "training"):
    assert importlib.util.find_spec(name) is None, name
print(len(names))
"""
    done = run(python_of(clean), "-c", code, folder=elsewhere)
    assert done.returncode == 0, done.stderr[-3000:]
    assert int(done.stdout) > 400


def test_the_import_is_lazy_when_installed(clean, elsewhere):
    code = "import time; t = time.process_time(); import shapeshift; print(time.process_time() - t)"
    assert float(run(python_of(clean), "-c", code, folder=elsewhere).stdout) < 0.1


@pytest.mark.parametrize("name", ["01_load_and_render.py", "02_slide.py", "03_regions.py"])
def test_the_first_examples_run(clean, elsewhere, name):
    done = run(python_of(clean), ROOT / "examples" / name, folder=elsewhere)
    assert done.returncode == 0 and not done.stderr, done.stderr[-3000:]
    assert list((elsewhere / "out").glob("*.png"))


def test_the_program_answers(clean, elsewhere):
    program = python_of(clean).with_name("shapeshift")
    told = run(program, "--version", folder=elsewhere)
    assert told.stdout == f"shapeshift {PROJECT['version']}\n" and not told.stderr
    scene = site_of(clean) / "shapeshift/assets/workshop.shift"
    told = run(program, "info", scene, folder=elsewhere)
    assert told.returncode == 0 and "Thermal" in told.stdout and not told.stderr
    told = run(python_of(clean), "-m", "shapeshift", "--version", folder=elsewhere)
    assert told.returncode == 0 and told.stdout.startswith("shapeshift ")


@pytest.mark.skipif(os.name == "nt", reason="head is of POSIX")
def test_nobody_has_to_read_the_help_to_its_end(clean, elsewhere):
    line = f"set -o pipefail; '{python_of(clean).with_name('shapeshift')}' --help | head -1"
    told = run("bash", "-c", line, folder=elsewhere)
    assert told.stdout == "usage: shapeshift [command] [options]\n"
    assert told.returncode == 0 and not told.stderr


def test_what_an_index_is_told(clean):
    (folder,) = site_of(clean).glob("*.dist-info")
    told = HeaderParser().parsestr((folder / "METADATA").read_text())
    assert told["Name"] == "shapeshift" and told["Version"] == PROJECT["version"]
    ends = told["Requires-Python"].split(",")  # setuptools puts them into its own order
    assert sorted(ends) == sorted(PROJECT["requires-python"].split(","))
    assert "Shapeshift" in told["Author"] and told["Summary"] == PROJECT["description"]
    assert told["Description-Content-Type"] == "text/markdown"
    assert told.get_payload().startswith("# Shapeshift")
    assert set(told.get_all("Classifier")) == set(PROJECT["classifiers"])
    plain = {n for n in told.get_all("Requires-Dist") if "extra" not in n}
    bare = lambda names: {re.sub(r"\s", "", name) for name in names}  # noqa: E731
    assert bare(plain) == bare(PROJECT["dependencies"])
    assert set(told.get_all("Provides-Extra")) == set(PROJECT["optional-dependencies"])
    assert "console_scripts" in (folder / "entry_points.txt").read_text()
