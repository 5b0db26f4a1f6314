"""A scene in blocks to a folder: blocks.json and a package a block."""

import math
from collections.abc import Mapping
from pathlib import Path

from shapeshift.runtime_models.blocks.block_model import FORMAT
from shapeshift.runtime_models.blocks.read_blocks import (
    ENDING,
    LIST,
    BlockList,
    Corner,
    has_block_list,
    read_block_list,
)
from shapeshift.runtime_models.files.plain_text import json_text
from shapeshift.runtime_models.files.whole_file import whole_folder, write_whole
from shapeshift.runtime_models.model import AnchorModel, BadFile
from shapeshift.runtime_models.package.write_package import describe_stop, package_files, zip_files


def write_blocks(listed: BlockList, models: Mapping[str, AnchorModel], folder: Path) -> int:
    """Writes the folder, whole or not at all, and returns its bytes.

    models: of every file that is listed, written so that the same numbers are read again.  Raises
    BadFile rather than replace a folder that holds anything but a scene in blocks.
    """
    refuse_foreign_folder(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with whole_folder(folder) as part:
        for name in listed.files:
            write_whole(part / name, zip_files(package_files(models[name], "exact")))
        write_whole(part / LIST, (json_text(describe_blocks(listed)) + "\n").encode())
        if read_block_list(part) != listed:
            raise BadFile(f"{folder / LIST} would not be read as it is; two bounds are one number.")
        return sum(file.stat().st_size for file in part.iterdir())


def describe_blocks(listed: BlockList) -> dict:
    """What blocks.json holds."""
    rows = [
        {"file": b.file, "low": bounds(b.box.low), "high": bounds(b.box.high)}
        for b in listed.blocks
    ]
    far = {"far": listed.far} if listed.far else {}
    return {
        "format": FORMAT, "turn_degrees": listed.turn_degrees, "blocks": rows, **far,
        "stops": [describe_stop(stop) for stop in listed.stops],
    }  # fmt: skip


def bounds(corner: Corner) -> list[float | None]:
    """Without end is null."""
    return [value if math.isfinite(value) else None for value in corner]


def refuse_foreign_folder(folder: Path) -> None:
    """BadFile where `folder` is anything but nothing, an empty folder or a scene in blocks."""
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return
    if not folder.is_dir() or not has_block_list(folder):
        raise BadFile(f"{folder} exists and is no scene in blocks; choose another name.")
    for file in folder.iterdir():
        if file.name != LIST and file.suffix != ENDING:
            raise BadFile(
                f"{folder} holds {file.name} beside a scene in blocks; move it or choose another "
                "name."
            )
