"""XGrids' LCC2: meta.lcc2 with a tree whose nodes name SOG or spz files, one or more a level.

A node at depth d (the root's children have 1) is of level totalLevels - d; level 0 is the finest.
Splats of `env` belong to every level.  +Z is up.  Facts: splat-transform's reading of the format,
with the names of fields before and after its change.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from shapeshift.runtime_models.files.json_fields import Fields, parse_json
from shapeshift.runtime_models.files.memory import JSON_A_BYTE, Account
from shapeshift.runtime_models.model import BadFile, SplatLayers
from shapeshift.runtime_models.splats.lcc.read_lcc import (
    MOST_LEVELS,
    UP,
    find_meta,
    level_as_layers,
    open_meta,
)
from shapeshift.runtime_models.splats.plain_splats import RawSplats, Reading
from shapeshift.runtime_models.splats.sog.read_sog import open_sog, read_raw_sog
from shapeshift.runtime_models.splats.sog.read_streamed import finest_within
from shapeshift.runtime_models.splats.sog.sog_files import EXPORT_AGAIN, LARGEST_META, file_inside
from shapeshift.runtime_models.splats.spz.read_spz import read_raw_spz
from shapeshift.runtime_models.splats.spz.spz_axes import FORMAT_AXES
from shapeshift.runtime_models.splats.spz.spz_file import count_in

ENDING = ".lcc2"
# An spz says y up, z back of what is x, z, -y here: half a turn about x from LCC's; one that says
# y down, z forward has LCC's own.
SPZ_UPS = {"+Y": "-Z", "-Y": "+Z"}
LOOSE = re.compile(r'"(?:\\.|[^"\\])*"|,(?=\s*[}\]])')  # texts; commas before a closing bracket


@dataclass(frozen=True)
class Lcc2:
    """What a meta.lcc2 says."""

    file: Path
    levels: tuple[tuple[Path, ...], ...]  # the files of each level, in their order
    counts: tuple[int, ...]  # splats of each level
    environment: Path | None


def is_lcc2(path: Path) -> bool:
    """A file that ends in .lcc2, or a folder with one."""
    return find_meta(path, ENDING) is not None


def read_lcc2(path: Path, reading: Reading) -> SplatLayers:
    """The finest level within reading.most_splats, else the coarsest.  Raises BadFile."""
    file, reading = open_meta(path, ENDING, reading)
    lcc = read_meta(file, reading.account)
    number = finest_within(lcc.counts, reading.most_splats)
    files = list(lcc.levels[number]) + ([lcc.environment] if lcc.environment else [])
    parts = []
    for i, each in enumerate(files):
        reading.report(f"reading level {number} of {file.name}", i / len(files))
        parts.append(read_chunk(each, replace(reading, progress=None)))
    names = [file.name, *(each.relative_to(file.parent).as_posix() for each in files)]
    return level_as_layers(parts, number, lcc.counts, file, reading, names)


def read_chunk(path: Path, reading: Reading) -> RawSplats:
    """One file of a level, in LCC's axes."""
    if path.suffix.lower() == ".spz":
        raw = read_raw_spz(path, reading, FORMAT_AXES)
        up = SPZ_UPS.get(raw.up, raw.up)
        return replace(raw, up=up, axes="", format=f"LCC2 of {raw.format}")
    raw = read_raw_sog(path, reading)
    return replace(raw, up=UP, format=f"LCC2 of {raw.format}")


def read_meta(file: Path, memory: Account) -> Lcc2:
    """What a meta.lcc2 says, checked; no splat is read yet.  Raises BadFile."""
    if (size := file.stat().st_size) > LARGEST_META:
        raise BadFile(f"{file.name} has {size:,} bytes; at most {LARGEST_META:,} are read.")
    memory.charge(JSON_A_BYTE * size, "its JSON")
    try:
        said = parse_json(file.read_bytes(), file.name)
    except BadFile:  # some writers leave commas behind the last entry
        text = file.read_bytes().decode("utf-8", "replace")
        strict = LOOSE.sub(lambda found: found[0] if found[0] != "," else "", text)
        said = parse_json(strict.encode(), file.name)
    meta = Fields(said, file.name, EXPORT_AGAIN)
    tree, old_levels = meta.object("root"), "totalLevels" not in meta.data
    levels = meta.count("lod_level" if old_levels else "totalLevels", 1, MOST_LEVELS)
    ending = meta.line("splatType", ".sog", known=(".sog", ".spz"))
    root, old = tree.data, "splatFiles" not in tree.data
    names = [name.lstrip("/") for name in tree.texts("files" if old else "splatFiles")]
    names = [n if n.endswith(ending) or not old else n + ending for n in names]
    far = number_of(root.get("data"), "env", len(names), file.name)
    numbers: list[set[int]] = [set() for _ in range(levels)]
    for node, depth in nodes_of(root, file.name):
        found = number_of(node.get("data"), "3dgs", len(names), file.name)
        if found is not None and found != far and depth <= levels:
            numbers[levels - depth].add(found)
    if not any(numbers):
        raise BadFile(f"{file.name} names no splats; export it again.")
    paths = {i: found_file(file.parent, names[i], file.name) for level in numbers for i in level}
    counts = {i: chunk_count(path, memory) for i, path in paths.items()}
    return Lcc2(
        file,
        tuple(tuple(paths[i] for i in sorted(level)) for level in numbers),
        tuple(sum(counts[i] for i in level) for level in numbers),
        found_file(file.parent, names[far], file.name) if far is not None else None,
    )


def nodes_of(root: Mapping, name: str) -> Iterator[tuple[Mapping, int]]:
    """Every node below the root with its depth; children are a list, or an object of them."""
    waiting = [(root, 0)]
    while waiting:
        node, depth = waiting.pop()
        children = node.get("child") or []
        children = list(children.values()) if isinstance(children, dict) else children
        if not isinstance(children, list) or not all(isinstance(c, dict) for c in children):
            raise BadFile(f"{name} holds a node that is none; export it again.")
        for child in reversed(children):
            waiting.append((child, depth + 1))
        if depth:
            yield node, depth


def number_of(data: object, kind: str, files: int, name: str) -> int | None:
    """Which file a node's data of a kind are in; None where it has none."""
    entry = data.get(kind) if isinstance(data, dict) else None
    if entry is None:
        return None
    number = entry.get("name") if isinstance(entry, dict) else None
    if type(number) is not int or not 0 <= number < files:
        raise BadFile(f"{name} names file {str(number)[:20]}, it lists {files}.")
    return number


def found_file(folder: Path, name: str, said_by: str) -> Path:
    """The file of that name below the folder, or in it under the last part of the name."""
    last = name.rpartition("/")[2]
    if not (folder / name).is_file() and last and (folder / last).is_file():
        name = last
    return file_inside(folder, name, said_by)


def chunk_count(path: Path, memory: Account) -> int:
    """How many splats a file has, by its header."""
    if path.suffix.lower() == ".spz":
        with path.open("rb") as file:
            return count_in(file.read(1 << 16), path.name)
    return open_sog(path, memory).count
