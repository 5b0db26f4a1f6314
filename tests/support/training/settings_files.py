"""Files for --settings."""

from pathlib import Path
from typing import Any


def settings_file(folder: Path, **lines: Any) -> Path:
    """NAME = number, a line each."""
    path = folder / "settings.toml"
    path.write_text("".join(f"{name} = {value}\n" for name, value in lines.items()))
    return path
