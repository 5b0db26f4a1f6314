"""PlayCanvas's streamed SOG: a tree whose nodes name runs of splats at several levels of detail."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, is_count, parse_json, shown
from shapeshift.runtime_models.files.memory import JSON_A_BYTE, Account, Memory
from shapeshift.runtime_models.lint.lint import judge
from shapeshift.runtime_models.model import BadFile, Finding, SplatLayers, Stop
from shapeshift.runtime_models.splats.layers.read_layers import check_mode, join_layers
from shapeshift.runtime_models.splats.operations.decimate import within_most_splats
from shapeshift.runtime_models.splats.plain_splats import ARRAYS, RawSplats, Reading
from shapeshift.runtime_models.splats.sog.read_sog import open_sog, read_raw_sog
from shapeshift.runtime_models.splats.sog.sog_files import (
    EXPORT_AGAIN,
    META,
    file_inside,
)

TREE = "lod-meta.json"
MOST_LEVELS = 64
LARGEST_FILE = 1 << 40  # splats: a number beyond is wrong
LARGEST_TREE = 64 << 20  # bytes: 100,000 leaves of 7 levels, some 300 million splats
GROWTH = 4  # while a scene is refined, the next level that is read has so many times the splats


@dataclass(frozen=True)
class SplatRun:
    """Neighbouring splats of one of the files."""

    file: int  # index
    first: int
    count: int


@dataclass(frozen=True)
class Streamed:
    """What a lod-meta.json says; level 0 is the finest."""

    folder: Path
    files: tuple[Path, ...]  # meta.json of a folder or a .sog each
    levels: tuple[tuple[SplatRun, ...], ...]
    environment: Path | None  # splats that belong to every level
    leaves: tuple[tuple[dict, dict[int, SplatRun]], ...] = ()  # nodes of the tree, their runs

    @property
    def counts(self) -> tuple[int, ...]:
        """Splats of each level, without the environment."""
        return tuple(sum(run.count for run in runs) for runs in self.levels)

    @property
    def filled(self) -> int:
        """Leaves that have splats."""
        return sum(any(run.count for run in runs.values()) for _, runs in self.leaves)


def is_streamed(path: Path) -> bool:
    """Whether it is a folder with a lod-meta.json, or that file itself."""
    return path.name == TREE or (path / TREE).is_file()


def folder_of(path: Path) -> Path:
    return path.parent if path.name == TREE else path


def read_streamed(path: Path, reading: Reading) -> SplatLayers:
    """The finest level within reading.most_splats, else the coarsest.  Raises BadFile."""
    reading = reading.within(folder_of(path))
    streamed = read_tree(path, reading.account)
    return read_level(streamed, finest_within(streamed.counts, reading.most_splats), reading)


def read_sog_folder(path: Path, reading: Reading) -> SplatLayers:
    """A folder that holds one SOG, of one level.  Raises BadFile."""
    check_mode(reading.mode)
    reading = reading.within(path)
    plain = judge(read_raw_sog(path, reading), reading)
    names = [META, *open_sog(path, reading.account).file_names()]
    return join_layers([plain], (Stop(path.resolve().name, 0.0, "layer"),), reading.mode, names)


def levels(path: Path, reading: Reading) -> Iterator[SplatLayers]:
    """Levels of detail, coarsest first, up to what read_streamed reads; all of one origin.

    Some between are left out: each has at least GROWTH times the splats of the one before, or is
    the last.  Raises BadFile.
    """
    reading = replace(reading, memory=None)  # of each level anew: the one before goes
    streamed = read_tree(path, reading.within(folder_of(path)).account)
    origin = None
    for number in steps(streamed.counts, reading.most_splats):
        level = within_most_splats(read_level(streamed, number, reading), path, reading)
        if origin is None:
            origin = level.origin
        shift = np.subtract(level.origin, origin)
        if shift.any():
            means = (level.means + shift).astype(np.float32)
            level = replace(level, means=means, origin=origin)
        yield level


def finest_within(counts: tuple[int, ...], most: int) -> int:
    """The first level that is not empty and has at most that many splats (0: no limit)."""
    filled = [number for number, count in enumerate(counts) if count]
    return next((n for n in filled if not most or counts[n] <= most), filled[-1])


def steps(counts: tuple[int, ...], most: int) -> list[int]:
    """The levels to show one after the other, the coarsest first."""
    last = finest_within(counts, most)
    out: list[int] = []
    for number in range(len(counts) - 1, last, -1):
        if counts[number] and (not out or counts[number] >= GROWTH * counts[out[-1]]):
            out.append(number)
    return [*out, last]


def read_tree(path: Path, memory: Account | None = None) -> Streamed:
    """What a lod-meta.json says, checked, no splat read yet.  Raises BadFile."""
    file = path if path.name == TREE else path / TREE
    if file.stat().st_size > LARGEST_TREE:
        raise BadFile(f"{file.name} has over {LARGEST_TREE:,} bytes; it is no {TREE} of a scene.")
    memory = memory or Memory().of(path)
    with memory.lend(JSON_A_BYTE * file.stat().st_size, f"its {file.name}"):
        tree = Fields(parse_json(file.read_bytes(), file.name), file.name, EXPORT_AGAIN)
    if (version := tree.value("version", 1)) != 1:
        raise BadFile(f"{file.name} is of version {shown(version)}, known is 1.")
    names, environment = tree.texts("filenames"), tree.text("environment", "")
    count = tree.count("lodLevels", 1, MOST_LEVELS)
    leaves = tuple(tree_nodes(tree.value("tree", None), count, len(names), file.name))
    runs = runs_of(leaves, count)
    if not any(run.count for level in runs for run in level):
        raise BadFile(f"{file.name} names no splats; export it again.")
    folder = file.parent
    return Streamed(
        folder,
        tuple(file_inside(folder, name, file.name) for name in names),
        runs,
        file_inside(folder, environment, file.name) if environment else None,
        leaves,
    )


def tree_nodes(
    tree: object, levels: int, files: int, name: str
) -> Iterator[tuple[dict, dict[int, SplatRun]]]:
    """Every node that has runs, with its runs by level, in the tree's order.  Raises BadFile."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        lods: object = {}
        children: object = None
        if isinstance(node, dict):
            lods, children = node.get("lods") or {}, node.get("children") or []
        if not isinstance(lods, dict) or not isinstance(children, list):
            raise BadFile(f"{name} holds a node that is none; export it again.")
        waiting += reversed(children)
        runs = {}
        for level, run in lods.items():
            entries = run if isinstance(run, dict) else {}
            file, first, count = (entries.get(key) for key in ("file", "offset", "count"))
            if not (is_count(file) and is_count(first) and is_count(count)):
                raise BadFile(f"{name} holds a level without file, offset and count.")
            if not (level.isdecimal() and level.isascii() and int(level) < levels):
                raise BadFile(f"{name} holds a level {level[:20]!r}, it states {levels} levels.")
            if first + count > LARGEST_FILE:
                raise BadFile(f"{name} names row {first + count:,} of a file; export it again.")
            if file >= files:
                raise BadFile(f"{name} names file {file}, it lists {files}.")
            runs[int(level)] = SplatRun(file, first, count)
        if runs and isinstance(node, dict):
            yield node, runs


def runs_of(
    leaves: Sequence[tuple[dict, dict[int, SplatRun]]], levels: int
) -> tuple[tuple[SplatRun, ...], ...]:
    """The runs of each level, in the tree's order."""
    out: list[list[SplatRun]] = [[] for _ in range(levels)]
    for _, runs in leaves:
        for level, run in runs.items():
            out[level].append(run)
    return tuple(map(tuple, out))


def read_level(streamed: Streamed, number: int, reading: Reading) -> SplatLayers:
    """One level as a scene of one stop.  Raises BadFile."""
    check_mode(reading.mode)
    reading = reading.within(streamed.folder)
    runs_of_file: dict[int, list[SplatRun]] = {}
    for run in streamed.levels[number]:
        if run.count:
            runs_of_file.setdefault(run.file, []).append(run)
    parts, used = [], [streamed.folder / TREE]
    within = replace(reading, progress=None)
    for i, (file, runs) in enumerate(sorted(runs_of_file.items())):
        reading.report(f"reading level {number} of {streamed.folder.name}", i / len(runs_of_file))
        parts.append(picked(read_raw_sog(streamed.files[file], within), runs))
        used += files_of_sog(streamed.files[file], reading)
    if streamed.environment is not None:
        parts.append(read_raw_sog(streamed.environment, reading))
        used += files_of_sog(streamed.environment, reading)
    name = streamed.folder.resolve().name
    plain = judge(joined(parts, name), reading)
    kept = [file.relative_to(streamed.folder).as_posix() for file in used]
    layers = join_layers([plain], (Stop(name, 0.0, "layer"),), reading.mode, kept)
    shown = {"level": number, "level_splats": list(streamed.counts), "leaves": streamed.filled}
    return replace(
        layers,
        provenance=layers.provenance | shown,
        findings=(*layers.findings, *level_findings(streamed, number)),
    )


def level_findings(streamed: Streamed, number: int) -> tuple[Finding, ...]:
    """A word on which level it is, where it is not the finest."""
    finest = finest_within(streamed.counts, 0)
    if number == finest:
        return ()
    what = f"the finest of {len(streamed.levels)} levels has {streamed.counts[finest]:,} splats"
    done = f"level {number} with {streamed.counts[number]:,} is read"
    return (Finding(what, 0, done, file=streamed.folder.resolve().name, repaired=False),)


def files_of_sog(path: Path, reading: Reading) -> list[Path]:
    """A .sog, or a meta.json with the pictures that it names."""
    if path.name != META:
        return [path]
    sog = open_sog(path, reading.account)
    return [path, *(path.parent / name for name in sog.file_names())]


def picked(raw: RawSplats, runs: list[SplatRun]) -> RawSplats:
    """The splats of the runs.  Raises BadFile where they are not all there, or named twice."""
    count = len(raw.means)
    outside = any(run.first + run.count > count for run in runs)
    if outside or sum(run.count for run in runs) > count:
        raise BadFile(f"{raw.file} has {count:,} splats, {TREE} names others or some twice.")
    if runs == [SplatRun(runs[0].file, 0, count)]:
        return raw
    rows = np.concatenate([np.arange(r.first, r.first + r.count) for r in runs])
    if len(rows) == count and (np.diff(rows) == 1).all():
        return raw
    with raw.memory.lend(len(rows) * raw.bytes_a_splat, f"{len(rows):,} splats"):
        arrays = [getattr(raw, name)[rows] for name in ARRAYS]
    raw.memory.release((count - len(rows)) * raw.bytes_a_splat)
    return raw.with_arrays(arrays)


def joined(parts: list[RawSplats], name: str) -> RawSplats:
    """All splats of several SOG files as of one; takes the parts over.

    Raises BadFile where their versions differ.
    """
    if len(parts) == 1:
        return replace(parts[0], file=name)
    if len({part.format for part in parts}) > 1:
        raise BadFile(f"{name} mixes versions of SOG; export it again.")
    most = max(part.sh.shape[1] for part in parts)
    count = sum(len(part.means) for part in parts)
    memory = parts[0].memory
    memory.charge(sum(12 * (most - p.sh.shape[1]) * len(p.means) for p in parts), "harmonics")
    for part in parts:
        part.sh = np.pad(part.sh, ((0, 0), (0, most - part.sh.shape[1]), (0, 0)))
    arrays = []
    with memory.lend(12 * most * count, f"{count:,} splats in one"):
        for key in ARRAYS:
            arrays.append(np.concatenate([getattr(part, key) for part in parts]))
            for part in parts:
                setattr(part, key, None)  # each goes once it is copied
    findings = tuple(found for part in parts for found in part.findings)
    mip = any(part.antialiased for part in parts)
    return parts[0].with_arrays(arrays, file=name, findings=findings, antialiased=mip)
