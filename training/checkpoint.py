"""The file beside the output from which an interrupted run goes on."""

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from shapeshift.runtime_models.files.whole_file import whole_file
from shapeshift.runtime_models.model import BadFile


def checkpoint_path(out: Path) -> Path:
    """Where the checkpoint of a package `out` lies."""
    return out.with_name(out.name + ".checkpoint.npz")


def write_checkpoint(path: Path, state: dict[str, np.ndarray], notes: dict) -> None:
    """All arrays and notes in one file, never half-written."""
    with whole_file(path) as file:
        arrays: dict[str, Any] = state | {"notes": np.array(json.dumps(notes))}
        np.savez(file, **arrays)


def read_checkpoint(path: Path) -> tuple[dict[str, np.ndarray], dict]:
    """(arrays, notes).  Raises BadFile."""
    if not path.exists():
        raise BadFile(f"{path}: no checkpoint to resume from; train once without --resume.")
    try:
        with np.load(path, allow_pickle=False) as file:
            state = {name: file[name] for name in file.files}
        return state, json.loads(str(state.pop("notes")))
    except (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise BadFile(f"{path}: not a readable checkpoint ({error}); delete it.") from error
