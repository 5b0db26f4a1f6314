"""What this program is called where it was started, and which version it is."""

import os
import shlex
from pathlib import Path

from shapeshift.app.paths import full

ROOT = Path(__file__).resolve().parents[1]


def is_installed() -> bool:
    """Whether this is an installed package; else it is a checkout, with launch.py as its door."""
    return not (ROOT / "launch.py").is_file()


def program() -> str:
    """The words that start it from where this one was started."""
    if is_installed():
        return "shapeshift"
    door, python = str(ROOT / "launch.py"), "py" if os.name == "nt" else "python3"
    if full("launch.py") == door:
        return f"{python} launch.py"
    return f'{python} "{door}"' if os.name == "nt" else f"{python} {shlex.quote(door)}"


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
