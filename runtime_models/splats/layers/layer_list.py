"""Plain splats of several stops to a folder: a file a stop, and layers.json that joins them."""

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from shapeshift.runtime_models.files.json_fields import Fields, read_json, shown
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.model import BadFile, SplatLayers, Stop
from shapeshift.runtime_models.package.read_manifest import read_stops
from shapeshift.runtime_models.package.write_package import describe_stop
from shapeshift.runtime_models.splats.layers.read_layers import MODES, read_layers
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, Reading
from shapeshift.runtime_models.splats.ply.write_ply import write_ply


def layer_name(number: int, stop: Stop, ending: str = ".ply") -> str:
    """The file of a stop: its number, and what of its name any file system takes."""
    return f"{number}_{re.sub(r'[^A-Za-z0-9_-]', '_', stop.name)[:40]}{ending}"


def refuse_other_folder(folder: Path) -> None:
    """Only a folder of ours, an empty or a new one may be written into.  Raises BadFile."""
    if folder.is_dir() and ((folder / LIST).is_file() or not any(folder.iterdir())):
        return
    if folder.exists() or folder.suffix == ".shift":
        raise BadFile(
            f"{folder} cannot take plain splats: wanted is a new folder, or one with {LIST} in it."
        )


def write_layer_list(
    layers: list[tuple[Stop, PlainSplats]],
    folder: Path,
    write: Callable[[PlainSplats, Path], object] = write_ply,
    ending: str = ".ply",
) -> int:
    """Writes every stop's splats and then the list; returns their bytes.  Raises BadFile.

    Each stop shows its own splats alone.  write: makes a file with that ending.
    """
    refuse_other_folder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    names = [layer_name(number, stop, ending) for number, (stop, _) in enumerate(layers)]
    for name, (_, splats) in zip(names, layers, strict=True):
        write(splats, folder / name)
    write_list([stop for stop, _ in layers], names, folder)
    return sum((folder / name).stat().st_size for name in [*names, LIST])


def write_list(stops: Sequence[Stop], names: Sequence[str], folder: Path) -> None:
    """layers.json alone, of files that lie in the folder already: one a stop."""
    rows = [describe_stop(s) | {"file": n} for s, n in zip(stops, names, strict=True)]
    text = json.dumps({"format": FORMAT, "mode": "exclusive", "stops": rows}, indent=1)
    write_whole(folder / LIST, text.encode())


# A folder of splat files with layers.json, which says which file shows which stop.

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
