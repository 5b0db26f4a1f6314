"""A folder of splat files with layers.json, which says which file shows which stop."""

from dataclasses import replace
from pathlib import Path

from shapeshift.runtime_models.files.json_fields import Fields, read_json, shown
from shapeshift.runtime_models.model import BadFile, SplatLayers
from shapeshift.runtime_models.package.read_manifest import read_stops
from shapeshift.runtime_models.splats.layers.read_layers import MODES, read_layers
from shapeshift.runtime_models.splats.plain_splats import Reading

LIST = "layers.json"
FORMAT = "shapeshift-layers 1"
LARGEST_LIST = 1 << 20  # bytes
ADVICE = "train again, or delete the list to open its files"


def has_layer_list(folder: Path) -> bool:
    return (folder / LIST).is_file()


def read_layer_list(folder: Path, reading: Reading) -> SplatLayers:
    """The files that the list names, each at its stop.  Raises BadFile."""
    path = folder / LIST
    top = Fields(read_json(path, most_bytes=LARGEST_LIST), LIST, ADVICE)
    if (found := top.data.get("format")) != FORMAT:
        raise BadFile(f"{path} has format {shown(found)}, this program reads '{FORMAT}'.")
    stops, mode = read_stops(top), top.line("mode", known=MODES)
    names = [row.text("file") for row in top.rows("stops", len(stops), "stop", first=0)]
    if len(set(names)) < len(names):
        raise BadFile(f"{path} names one file twice; each stop needs its own.")
    files = [file_of(folder, name) for name in names]
    return read_layers(files, replace(reading, mode=reading.mode or mode), stops)


def file_of(folder: Path, name: str) -> Path:
    """The file of that name in the folder and nowhere else.  Raises BadFile."""
    if any(sign in name for sign in "/\\:\0") or name in (".", ".."):
        raise BadFile(f"{LIST} names {shown(name)}, expected the name of a file beside it.")
    if not (folder / name).is_file():
        raise BadFile(f"{LIST} names {shown(name)}, which is not in {folder}.")
    return folder / name
