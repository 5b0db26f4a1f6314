"""A folder NAME.blocks: blocks.json and the packages that it names, as one model."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.blocks.block_model import FORMAT, MOST_BLOCKS, BlockModel, joined
from shapeshift.runtime_models.files.json_fields import Fields, is_number, read_json, shown
from shapeshift.runtime_models.model import AnchorModel, BadFile, Finding, Stop
from shapeshift.runtime_models.package.read_manifest import read_stops
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.splats.plain_splats import Reading

# Where a block lies: a half-open box in a frame that is turned about the vertical axis.

Corner = tuple[float, float, float]  # metres in the turned frame; infinite: no bound


@dataclass(frozen=True)
class BlockBox:
    """low <= p < high: of boxes side by side, a place lies in one alone."""

    low: Corner
    high: Corner

    def __post_init__(self) -> None:
        """ValueError, one sentence; NaN is below nothing."""
        if not all(a < b for a, b in zip(self.low, self.high, strict=True)):
            raise ValueError(f"a block reaches from {self.low} to {self.high}, which is no box")

    def holds(self, places: np.ndarray, margin: float = 0.0) -> np.ndarray:
        """(N,) bool of places (N, 3) in the turned frame; margin: metres it is enlarged by."""
        low, high = np.array(self.low) - margin, np.array(self.high) + margin
        return np.asarray(((places >= low) & (places < high)).all(axis=1))


def turned(places: np.ndarray, degrees: float) -> np.ndarray:
    """(N, 3) float64 places in a frame whose x axis lies so many degrees from +X towards -Z.

    That is the frame's +Y turn; no turn gives the very same numbers.
    """
    wide = np.asarray(places, np.float64)
    if degrees == 0:
        return wide
    angle = math.radians(degrees)
    cosine, sine = math.cos(angle), math.sin(angle)
    x, z = wide[:, 0], wide[:, 2]
    return np.stack([cosine * x - sine * z, wide[:, 1], sine * x + cosine * z], axis=1)


LIST = "blocks.json"
LARGEST_LIST = 4 << 20  # bytes
ENDING = ".shift"
FARTHEST = 1e9  # metres of a bound
ADVICE = "train again with --blocks"


@dataclass(frozen=True)
class ListedBlock:
    """One package of the folder, and where its anchors stand."""

    file: str
    box: BlockBox


@dataclass(frozen=True)
class BlockList:
    """What blocks.json says."""

    turn_degrees: float
    blocks: tuple[ListedBlock, ...]
    far: str | None  # the package of what lies far outside; None: there is none
    stops: tuple[Stop, ...]

    @property
    def files(self) -> tuple[str, ...]:
        return *(block.file for block in self.blocks), *([self.far] if self.far else [])


def has_block_list(folder: Path) -> bool:
    return (folder / LIST).is_file()


def read_block_list(folder: Path) -> BlockList:
    """Everything of blocks.json, checked; its packages are not opened.  Raises BadFile."""
    path = folder / LIST
    top = Fields(read_json(path, most_bytes=LARGEST_LIST, unique=True), LIST, ADVICE)
    if (found := top.value("format")) != FORMAT:
        raise BadFile(f"{path} has format {shown(found)}, this program reads '{FORMAT}'.")
    turn = top.number("turn_degrees", 0.0, "a number from -90 to 90", -90, 90)
    rows = top.rows("blocks", MOST_BLOCKS, "block", first=0)
    if not rows:
        raise BadFile(f"{path}: 'blocks' is empty; a list of at least one block is wanted.")
    blocks = tuple(read_block(row) for row in rows)
    far = file_name(top, "far") if top.has("far") else None
    top.value("far", None)
    listed = BlockList(turn, blocks, far, read_stops(top))
    top.refuse_unknown_keys()
    if len(set(listed.files)) < len(listed.files):
        raise BadFile(f"{path} names one package twice; each block needs its own.")
    refuse_overlaps(blocks, path)
    return listed


def read_block(row: Fields) -> ListedBlock:
    file, low, high = file_name(row, "file"), corner(row, "low", -1), corner(row, "high", 1)
    row.refuse_unknown_keys()
    try:
        return ListedBlock(file, BlockBox(low, high))
    except ValueError as error:
        raise BadFile(f"{row.where}: {error}; {ADVICE}.") from None


def corner(row: Fields, key: str, side: int) -> Corner:
    """Three bounds; null is without end on that side."""
    value = row.value(key)
    wanted = f"a list of 3 numbers up to {FARTHEST:g}, or null for no bound,"
    if not (isinstance(value, list) and len(value) == 3):
        raise row.error(key, wanted)
    if not all(v is None or (is_number(v) and abs(v) <= FARTHEST) for v in value):
        raise row.error(key, wanted)
    x, y, z = (side * math.inf if v is None else float(v) for v in value)
    return x, y, z


def file_name(row: Fields, key: str) -> str:
    """The name of a package in the folder, and nowhere else.  Raises BadFile."""
    name = row.line(key)
    inside = not any(sign in name for sign in "/\\:\0") and not name.startswith(".")
    if not (inside and name.endswith(ENDING)):
        raise row.error(key, f"the name of a {ENDING} file in the same folder")
    return name


def refuse_overlaps(blocks: tuple[ListedBlock, ...], path: Path) -> None:
    """BadFile where a place lies in two blocks: its anchors would be drawn twice."""
    lows, highs = (np.array([getattr(b.box, end) for b in blocks]) for end in ("low", "high"))
    for i, block in enumerate(blocks[:-1]):
        least = np.minimum(highs[i + 1 :], highs[i])
        both = (np.maximum(lows[i + 1 :], lows[i]) < least).all(axis=1)
        if both.any():
            other = blocks[i + 1 + int(both.argmax())]
            raise BadFile(
                f"{path}: the boxes of {block.file} and {other.file} overlap; half-open boxes side "
                "by side are wanted."
            )


def read_blocks(folder: str | Path, reading: Reading | None = None) -> BlockModel:
    """The scene of the folder, charged as one file.  Raises BadFile."""
    folder = Path(folder)
    within = (reading or Reading()).within(folder)
    listed = read_block_list(folder)
    models = [read_part(folder, name, within) for name in listed.files]
    if strange := [n for m, n in zip(models, listed.files, strict=True) if m.stops != listed.stops]:
        raise BadFile(
            f"{folder / LIST} has other stops than {strange[0]}; the stops of all blocks are one "
            f"list: {ADVICE}."
        )
    names = [f"{folder.name}/{name}" for name in listed.files]
    size = sum(anchor_bytes(model) for model in models)
    with within.account.lend(size, "all blocks as one"):
        model = joined(models, names)
    pairs = zip(models, listed.blocks, strict=False)
    strays = (outside(part, block, listed, folder) for part, block in pairs)
    findings = (*model.findings, *(each for each in strays if each is not None))
    files = {"files": [LIST, *listed.files]}
    return replace(model, findings=findings, provenance=model.provenance | files)


def read_part(folder: Path, name: str, reading: Reading) -> AnchorModel:
    """One package of the folder; a link that leads out of it is refused."""
    path = folder / name
    if not path.is_file():
        raise BadFile(f"{folder / LIST} names {shown(name)}, which is not in {folder}.")
    if not path.resolve().is_relative_to(folder.resolve()):
        raise BadFile(f"{path} is a link that leads out of {folder}; put the file itself there.")
    return read_package(path, reading)


def anchor_bytes(model: AnchorModel) -> int:
    """Of all tables of its anchors."""
    tables = [model.anchors, model.features, model.light]
    if model.frames is not None:
        tables += [model.frames.scales, model.frames.wxyz]
    return sum(table.nbytes for table in tables if table is not None)


def outside(
    model: AnchorModel, block: ListedBlock, listed: BlockList, folder: Path
) -> Finding | None:
    """A finding where anchors of a block stand outside its box: others may stand there, too."""
    rows = np.flatnonzero(~block.box.holds(turned(model.anchors, listed.turn_degrees)))
    if not len(rows):
        return None
    what = f"{len(rows):,} anchors of {block.file} stand outside the box of their block"
    first = tuple(rows[:3].tolist())
    return Finding(what, len(rows), "kept", first, f"{folder.name}/{LIST}", repaired=False)
