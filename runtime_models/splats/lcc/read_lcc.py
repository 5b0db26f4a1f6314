"""XGrids' LCC: meta.lcc, index.bin, data.bin, shcoef.bin and environment.bin in one folder.

index.bin: of each cell of a grid its x, y, then for each level of detail how many splats it has and
where they lie in data.bin, 32 bytes each; their harmonics lie in shcoef.bin at twice that place, 64
bytes each.  Level 0 is the finest.  +Z is up.  Facts: XGrids' LCC white paper; splat-transform
reads it in the same way.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.files.blocks import BLOCK, each_block
from shapeshift.runtime_models.files.json_fields import Fields, parse_json
from shapeshift.runtime_models.files.memory import JSON_A_BYTE, Account
from shapeshift.runtime_models.lint.lint import judge
from shapeshift.runtime_models.model import BadFile, Finding, SplatLayers, Stop
from shapeshift.runtime_models.splats.layers.read_layers import check_mode, join_layers
from shapeshift.runtime_models.splats.plain_splats import RawSplats, Reading, empty_splats
from shapeshift.runtime_models.splats.ply.read_compressed_ply import from_smallest_three
from shapeshift.runtime_models.splats.sog.read_streamed import finest_within, joined
from shapeshift.runtime_models.splats.sog.sog_files import EXPORT_AGAIN, LARGEST_META

ENDING, INDEX, DATA, HARMONICS = ".lcc", "index.bin", "data.bin", "shcoef.bin"
ENVIRONMENT = "environment.bin"  # splats far away, which belong to every level
UP = "+Z"
MOST_LEVELS = 64
MOST_ATTRIBUTES = 1000
ROW = np.dtype(
    [
        ("mean", "<f4", 3),
        ("rgba", "u1", 4),
        ("scale", "<u2", 3),
        ("wxyz", "<u2", 2),
        ("n", "<u2", 3),
    ]
)  # 32 bytes; n: a normal, of which nothing is drawn
REST = 15  # words of harmonics, each with 11, 10 and 11 bits of red, green and blue
REST_ROW = np.dtype([("words", "<u4", REST), ("none", "<u4")])  # 64 bytes
SPLAT_AND_REST = np.dtype([("splat", ROW), ("words", "<u4", REST), ("none", "<u4")])
BITS = ((0, 2047), (11, 1023), (21, 2047))  # (shift, largest code) of the three channels


@dataclass(frozen=True)
class Coding:
    """Between which numbers the codes of scales and harmonics lie."""

    scales: tuple[np.ndarray, np.ndarray]  # (3,) metres
    rest: tuple[np.ndarray, np.ndarray]  # (3,) red, green, blue


@dataclass(frozen=True)
class Lcc:
    """What a meta.lcc and its index say."""

    folder: Path
    file: Path
    coding: Coding
    environment: Coding
    harmonics: bool
    units: np.ndarray  # (cells, levels) of points, offset

    @property
    def counts(self) -> tuple[int, ...]:
        """Splats of each level."""
        return tuple(int(n) for n in self.units["points"].sum(axis=0, dtype=np.int64))


def find_meta(path: Path, ending: str) -> Path | None:
    """The one file of that ending in a folder, or the file itself."""
    if path.is_dir():
        found = sorted(path.glob(f"*{ending}"))
        return found[0] if len(found) == 1 and found[0].is_file() else None
    return path if path.name.lower().endswith(ending) and path.is_file() else None


def open_meta(path: Path, ending: str, reading: Reading) -> tuple[Path, Reading]:
    """That file, and the reading of its folder.  Raises BadFile where there is none, or several."""
    check_mode(reading.mode)
    if (file := find_meta(path, ending)) is None:
        raise BadFile(f"{path} is no {ending} and no folder with one; copy the whole folder.")
    return file, reading.within(file.parent)


def is_lcc(path: Path) -> bool:
    """A file that ends in .lcc, or a folder with one."""
    return find_meta(path, ENDING) is not None


def read_lcc(path: Path, reading: Reading) -> SplatLayers:
    """The finest level within reading.most_splats, else the coarsest.  Raises BadFile."""
    file, reading = open_meta(path, ENDING, reading)
    lcc = read_meta(file, reading.account)
    number = finest_within(lcc.counts, reading.most_splats)
    parts = [read_level(lcc, number, reading)]
    environment = lcc.folder / ENVIRONMENT
    if environment.is_file() and environment.stat().st_size:
        parts.append(read_environment(lcc, environment, reading.account))
    return level_as_layers(parts, number, lcc.counts, file, reading, files_of(lcc))


def level_as_layers(
    parts: list[RawSplats],
    number: int,
    counts: tuple[int, ...],
    file: Path,
    reading: Reading,
    files: list[str],
) -> SplatLayers:
    """A scene of one stop out of a level's splats, which says of which level it is."""
    name = file.parent.resolve().name if file.stem == "meta" else file.stem
    layers = join_layers(
        [judge(joined(parts, file.name), reading)], (Stop(name, 0.0, "layer"),), reading.mode, files
    )
    findings, finest = layers.findings, finest_within(counts, 0)
    if number != finest:
        what = f"the finest of {len(counts)} levels has {counts[finest]:,} splats"
        done = f"level {number} with {counts[number]:,} is read"
        findings += (Finding(what, 0, done, file=file.name, repaired=False),)
    shown = {"level": number, "level_splats": list(counts)}
    return replace(layers, provenance=layers.provenance | shown, findings=findings)


def files_of(lcc: Lcc) -> list[str]:
    names = (lcc.file.name, INDEX, DATA, HARMONICS, ENVIRONMENT)
    return [name for name in names if (lcc.folder / name).is_file()]


def read_meta(file: Path, memory: Account) -> Lcc:
    """What a meta.lcc says, with the index beside it; no splat is read yet.  Raises BadFile."""
    if (size := file.stat().st_size) > LARGEST_META:
        raise BadFile(f"{file.name} has {size:,} bytes; at most {LARGEST_META:,} are read.")
    with memory.lend(JSON_A_BYTE * size, "its JSON"):
        meta = Fields(parse_json(file.read_bytes(), file.name), file.name, EXPORT_AGAIN)
    ranges = {
        row.data["name"]: row
        for row in meta.rows("attributes", MOST_ATTRIBUTES, "attribute")
        if isinstance(row.data.get("name"), str)
    }
    levels, kind = meta.count("totalLevel", 1, MOST_LEVELS), meta.value("fileType", None)
    harmonics = kind != "Portable" and (kind == "Quality" or "shcoef" in ranges)
    return Lcc(
        file.parent,
        file,
        coding_of(ranges, "", harmonics, file.name),
        coding_of(ranges, "env", harmonics, file.name),
        harmonics,
        read_index(file.parent, levels, memory),
    )


def coding_of(ranges: dict[str, Fields], prefix: str, harmonics: bool, file: str) -> Coding:
    """The ranges of one kind of splats; those of the environment may be those of all."""

    def ends(name: str) -> tuple[np.ndarray, np.ndarray]:
        row = ranges.get(prefix + name) or ranges.get(name)
        if row is None:
            raise BadFile(f"{file}: 'attributes' has no '{name}'; {EXPORT_AGAIN}.")
        low, high = (np.array(row.numbers(key, 3, most=1e30), np.float32) for key in ("min", "max"))
        return low, high

    nothing = (np.zeros(3, np.float32), np.zeros(3, np.float32))
    return Coding(ends("scale"), ends("shcoef") if harmonics else nothing)


def read_index(folder: Path, levels: int, memory: Account) -> np.ndarray:
    """(cells, levels) of points and offset, all of it inside data.bin.  Raises BadFile."""
    path, data = folder / INDEX, folder / DATA
    for needed in (path, data):
        if not needed.is_file():
            raise BadFile(f"{folder} lacks {needed.name}; copy the whole folder of the .lcc.")
    level = np.dtype([("points", "<i4"), ("offset", "<i8"), ("size", "<i4")])
    cell = np.dtype([("x", "<i2"), ("y", "<i2"), ("levels", level, (levels,))])
    size = path.stat().st_size
    if not size or size % cell.itemsize:
        raise BadFile(
            f"{path.name} has {size:,} bytes, expected a multiple of {cell.itemsize} for {levels} "
            "levels; it is cut off."
        )
    memory.charge(4 * size, path.name)
    units = np.fromfile(path, cell)["levels"]
    points, offset = units["points"].astype(np.int64), units["offset"]
    used = points != 0
    inside = (points >= 0) & (offset >= 0) & (offset <= data.stat().st_size)
    inside &= offset.clip(0, 1 << 62) + points * ROW.itemsize <= data.stat().st_size
    if not inside[used].all():
        raise BadFile(f"{path.name} names splats beyond the end of {DATA}; copy the whole folder.")
    if not used.any():
        raise BadFile(f"{path.name} names no splats; export it again.")
    return units


def read_level(lcc: Lcc, number: int, reading: Reading) -> RawSplats:
    """The splats of all cells at one level."""
    memory, units = reading.account, lcc.units[:, number]
    units = units[units["points"] > 0]
    count = lcc.counts[number]
    raw = raw_of(count, lcc.harmonics, lcc.file.name, memory)
    data = np.memmap(lcc.folder / DATA, np.uint8, "r")
    rest = mapped_harmonics(lcc, len(data)) if lcc.harmonics else None
    first = 0
    for done, unit in enumerate(units):
        rows = slice(first, first + int(unit["points"]))
        at, end = int(unit["offset"]), int(unit["offset"]) + int(unit["points"]) * ROW.itemsize
        table = data[at:end].view(ROW)
        words = rest[2 * at : 2 * end].view(REST_ROW)["words"] if rest is not None else None
        decode(table, words, lcc.coding, raw, rows)
        first = rows.stop
        if done % 64 == 0:
            reading.report(f"reading {lcc.file.name}", first / count)
    return raw


def mapped_harmonics(lcc: Lcc, size: int) -> np.ndarray:
    path = lcc.folder / HARMONICS
    there = path.stat().st_size if path.is_file() else 0
    if there < 2 * size:
        raise BadFile(
            f"{HARMONICS} has {there:,} bytes, {DATA} needs {2 * size:,}; copy the whole folder."
        )
    return np.memmap(path, np.uint8, "r")


def read_environment(lcc: Lcc, path: Path, memory: Account) -> RawSplats:
    row = SPLAT_AND_REST if lcc.harmonics else ROW
    size = path.stat().st_size
    if size % row.itemsize:
        raise BadFile(f"{path.name} has {size:,} bytes, no multiple of {row.itemsize}; copy it.")
    table = np.memmap(path, row, "r")
    raw = raw_of(len(table), lcc.harmonics, lcc.file.name, memory)
    splats = table["splat"] if lcc.harmonics else table
    words = table["words"] if lcc.harmonics else None
    decode(splats, words, lcc.environment, raw, slice(0, len(table)))
    return raw


def raw_of(count: int, harmonics: bool, file: str, memory: Account) -> RawSplats:
    return RawSplats(
        **empty_splats(count, 1 + REST if harmonics else 1, memory),
        file=file,
        format="LCC",
        log_scales=False,
        logits=False,
        up=UP,
        memory=memory,
    )


def decode(
    table: np.ndarray, words: np.ndarray | None, coding: Coding, raw: RawSplats, rows: slice
) -> None:
    """Puts the splats of a table (ROW) and their harmonics, words (n, 15), into some rows."""
    out = {n: getattr(raw, n)[rows] for n in ("means", "scales", "wxyz", "opacity", "sh")}

    def fill(part: slice, _: object) -> None:
        codes = table[part]
        out["means"][part] = codes["mean"]
        rgba = codes["rgba"] / np.float32(255)
        out["opacity"][part] = rgba[:, 3]
        out["sh"][part, 0] = (rgba[:, :3] - np.float32(0.5)) / np.float32(C0)
        out["scales"][part] = between(coding.scales, codes["scale"] / np.float32(65535))
        packed = codes["wxyz"][:, 0].astype(np.uint32) | codes["wxyz"][:, 1].astype(np.uint32) << 16
        unpack_quaternions(packed, out["wxyz"][part])
        if words is not None:
            for channel, (shift, most) in enumerate(BITS):
                share = ((words[part] >> shift) & most) / np.float32(most)
                low, high = (end[channel] for end in coding.rest)
                out["sh"][part, 1:, channel] = (1 - share) * low + share * high

    each_block(len(table), fill, block=BLOCK)


def between(ends: tuple[np.ndarray, np.ndarray], share: np.ndarray) -> np.ndarray:
    low, high = ends
    return (1 - share) * low + share * high


def unpack_quaternions(packed: np.ndarray, out: np.ndarray) -> None:
    """out (n, 4) wxyz: 10 bits each of three entries of x y z w, and which one is left out."""
    small = [
        (((packed >> shift) & 1023) / np.float32(1023) - np.float32(0.5)) * np.float32(2**0.5)
        for shift in (0, 10, 20)
    ]
    xyzw = np.empty_like(out)
    from_smallest_three(small, packed >> 30, xyzw)
    out[:] = xyzw[:, (3, 0, 1, 2)]
