"""What this program is called where it was started, which version it is, and its optional parts."""

import os
import shlex
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

started_in: Path | None = None  # where relative paths begin; None: in the current folder


def is_installed() -> bool:
    """Whether this is an installed package; else it is a checkout, with launch.py as its door."""
    return not (ROOT / "launch.py").is_file()


def program() -> str:
    """The words that start it from where this one was started."""
    if is_installed():
        return "shapeshift"
    door, python = str(ROOT / "launch.py"), "py" if os.name == "nt" else "python3"
    if os.path.abspath((started_in or Path()) / "launch.py") == door:
        return f"{python} launch.py"
    return f'{python} "{door}"' if os.name == "nt" else f"{python} {shlex.quote(door)}"


def portable_program() -> str:
    """The same for files that are read on other machines: no path of this one."""
    return "shapeshift" if is_installed() else "python3 launch.py"


def version() -> str:
    """As pyproject.toml says; installed, as the package's metadata does."""
    project = ROOT / "pyproject.toml"
    if project.is_file():
        import tomllib

        return tomllib.loads(project.read_text(encoding="utf-8"))["project"]["version"]
    from importlib.metadata import PackageNotFoundError
    from importlib.metadata import version as installed

    try:
        return installed("shapeshift")
    except PackageNotFoundError:  # the folders alone were copied
        return "of an unknown version"


@dataclass(frozen=True)
class Extra:
    """An optional part: packages of others that most people do without."""

    packages: tuple[str, ...]  # NAME==VERSION, as the tests run with
    modules: tuple[str, ...]  # that load once it is installed
    megabytes: int  # on disk, with what it brings along
    use: str


EXTRAS = {
    "film": Extra(("av==18.1.0",), ("av",), 104, "videos, read and written (PyAV)"),
    "thermal": Extra(("flyr==5.1.0",), ("flyr",), 1, "temperatures of FLIR's radiometric JPEG"),
    "usd": Extra(("usd-core==26.11",), ("pxr.Usd",), 157, "USD scenes, read and written"),
    "cluster": Extra(
        ("distributed==2026.8.0", "cryptography==50.0.2"), ("distributed", "cryptography"), 30,
        "work on several processes or machines (Dask)",
    ),
    "slurm": Extra(
        ("dask-jobqueue==0.9.0", "distributed==2026.8.0", "cryptography==50.0.2"),
        ("dask_jobqueue", "distributed", "cryptography"), 31, "the same as jobs of SLURM",
    ),
}  # fmt: skip


def install_words(extra: str) -> str:
    """The command that installs an optional part, as this program was started: for sentences."""
    assert extra in EXTRAS
    return f"`{program()} extras {extra}`"


def package_words(package: str) -> str:
    """The command that installs a package into the environment that this runs in."""
    for name, extra in EXTRAS.items():
        if any(package == each.partition("==")[0] for each in extra.packages):
            return install_words(name)
    python = f'"{sys.executable}"' if os.name == "nt" else shlex.quote(sys.executable)
    return f"`{python} -m pip install {package}`"
