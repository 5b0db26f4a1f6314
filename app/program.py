"""What this program is called where it was started, and which version it is."""

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def is_installed() -> bool:
    """Whether this is an installed package; else it is a checkout, with launch.py as its door."""
    return not (ROOT / "launch.py").is_file()


def program() -> str:
    """The words that start it."""
    if is_installed():
        return "shapeshift"
    return "py launch.py" if os.name == "nt" else "python3 launch.py"


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
