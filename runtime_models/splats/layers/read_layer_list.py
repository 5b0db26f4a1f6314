"""A folder of splat files with layers.json, which says which file shows which stop."""

import json
from dataclasses import replace
from pathlib import Path
from reprlib import repr as short

from shapeshift.runtime_models.files.memory import read_json_file
from shapeshift.runtime_models.model import BadFile, SplatLayers
from shapeshift.runtime_models.package.read_manifest import Wanted, read_stops
from shapeshift.runtime_models.splats.layers.read_layers import MODES, read_layers
from shapeshift.runtime_models.splats.plain_splats import Reading

LIST = "layers.json"
FORMAT = "shapeshift-layers 1"
LARGEST_LIST = 1 << 20  # bytes


def has_layer_list(folder: Path) -> bool:
    return (folder / LIST).is_file()


def read_layer_list(folder: Path, reading: Reading) -> SplatLayers:
    """The files that the list names, each at its stop.  Raises BadFile."""
    path = folder / LIST
    if path.stat().st_size > LARGEST_LIST:
        raise BadFile(f"{path} has {path.stat().st_size:,} bytes; no list of stops is so long.")
    text = read_json_file(path)
    try:
        entries = json.loads(text)
    except (ValueError, RecursionError):
        raise BadFile(f"{path} is not JSON; train again, or delete it to open the files.") from None
    found = entries.get("format") if isinstance(entries, dict) else None
    if found != FORMAT:
        raise BadFile(f"{path} has format {short(found)}, this program reads {FORMAT!r}.")
    top = Wanted(entries, LIST)
    stops, mode = read_stops(top.get("stops"), LIST), top.get("mode")
    if mode not in MODES:
        raise BadFile(f"{path}: mode is {short(mode)}, expected one of {list(MODES)}.")
    names = [Wanted(row, f"{LIST} stop {i}").text("file") for i, row in enumerate(top.get("stops"))]
    if len(set(names)) < len(names):
        raise BadFile(f"{path} names one file twice; each stop needs its own.")
    files = [file_of(folder, name) for name in names]
    return read_layers(files, replace(reading, mode=reading.mode or mode), stops)


def file_of(folder: Path, name: str) -> Path:
    """The file of that name in the folder and nowhere else.  Raises BadFile."""
    if any(sign in name for sign in "/\\:\0") or name in (".", ".."):
        raise BadFile(f"{LIST} names {short(name)}, expected the name of a file beside it.")
    if not (folder / name).is_file():
        raise BadFile(f"{LIST} names {short(name)}, which is not in {folder}.")
    return folder / name
