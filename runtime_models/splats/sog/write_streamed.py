"""Levels of detail to PlayCanvas's streamed SOG: the inverse of read_streamed, with errors."""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.model import BadFile, SplatLayers, Stop
from shapeshift.runtime_models.rotation import covariance
from shapeshift.runtime_models.splats.operations.merge_pairs import merging_losses, pair_groups
from shapeshift.runtime_models.splats.operations.moment_matching import merge_groups, shown_area
from shapeshift.runtime_models.splats.operations.rotate_splats import rotate_half_turn
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.sog.read_streamed import LARGEST_TREE, TREE
from shapeshift.runtime_models.splats.sog.write_sog import write_sog

# A scene cut into leaves of few splats each, under a tree: what levels of detail are chosen by.

Tree = int | tuple["Tree", "Tree"]  # a leaf's number, or two halves


@dataclass(frozen=True)
class Leaves:
    """Splats by leaf; leaves are numbered in the order of the tree."""

    of_splat: np.ndarray  # (N,) int32
    count: int
    tree: Tree


def cut_leaves(means: np.ndarray, most: int) -> Leaves:
    """Leaves of at most `most` splats at places (N, 3), N > 0: halves along the longest side of
    their box, again and again (a k-d tree).  The same places give the same leaves.
    """
    of_splat, count = np.empty(len(means), np.int32), 0

    def cut(rows: np.ndarray) -> Tree:
        nonlocal count
        if len(rows) <= most:
            of_splat[rows] = count
            count += 1
            return count - 1
        places = means[rows]
        with np.errstate(over="ignore"):
            axis = int(np.argmax(places.max(axis=0) - places.min(axis=0)))
        order = np.argpartition(places[:, axis], len(rows) // 2)
        # In their order: which of two equal places comes first must not hang on the sorting.
        return tuple(
            cut(np.sort(rows[half])) for half in (order[: len(rows) // 2], order[len(rows) // 2 :])
        )  # type: ignore[return-value]

    tree = cut(np.arange(len(means)))
    return Leaves(of_splat, count, tree)


# Levels of detail of plain splats: each with half of the splats of the one before, by merging.

LEAST = 32  # splats of a leaf on average; coarser levels would only add to the files
MOST_LEVELS = 10
PAIRING = 0.7  # of the time that a level takes; the rest is for its moments and errors
LEAST_WEIGHT = 1e-300  # m^2: of a leaf that shows nothing, whose errors are 0


@dataclass(frozen=True)
class Level:
    """All leaves at one level of detail, leaf after leaf."""

    number: int  # 0 is the finest
    splats: SplatLayers  # (N,) of one stop
    leaf: np.ndarray  # (N,) int32, rising
    errors: np.ndarray  # (leaves,) what merging costs beside all that the leaf shows; level 0: 0


def count_levels(splats: int, leaves: int) -> int:
    """How many levels are worth it."""
    number = 1
    while number < MOST_LEVELS and splats >> number >= LEAST * leaves:
        number += 1
    return number


def make_levels(
    splats: SplatLayers, leaves: Leaves, count: int, merged: Callable[[int, float], None]
) -> Iterator[Level]:
    """`count` levels, the finest first.  merged(level, part 0..1): how far each coarser one is.

    Merging does not cross leaves, and chooses over all of them at once: a smooth leaf gets coarse
    sooner than one of fine detail.  The error of a leaf is the loss of merge_pairs from level 0 on,
    by the weight of its splats; it never falls from level to level.
    """
    order = np.argsort(leaves.of_splat, kind="stable")
    splats, leaf = splats.with_rows(order), leaves.of_splat[order]
    finest, row_of = splats, np.arange(len(order))
    first_leaf = leaf
    weight = np.bincount(leaf, shown_area(splats.scales, splats.opacity), leaves.count)
    errors = np.zeros(leaves.count)
    yield Level(0, splats, leaf, errors)
    for number in range(1, count):

        def paired(part: float, number: int = number) -> None:
            merged(number, PAIRING * part)

        group = pair_groups(splats, len(leaf) // 2, paired, kinds=leaf)
        splats, into = merge_groups(splats, group)
        rows = np.empty(splats.splat_count, np.int32)
        rows[into] = leaf
        leaf, row_of = rows, into[row_of]
        losses = np.bincount(first_leaf, merging_losses(finest, splats, row_of), leaves.count)
        errors = np.maximum(errors, losses / np.maximum(weight, LEAST_WEIGHT))
        merged(number, 1.0)
        yield Level(number, splats, leaf, errors)


# Splats.  A reader decodes a file whole: views of 2 million splats of a garden decode 20 million of
# files of 2^19, as the format's own writer has it by default, 10.7 and 12.7 of 2^16, 7.8 and 9.7 of
# 2^15, in 167, 198 and 250, 309 files.  A file costs half a millisecond, a million splats 92.
MOST_OF_A_FILE = 1 << 15
REACH = 3.0  # sigmas of a splat that its leaf's box holds
DIGITS = 6  # of a bound and an error
# Processor seconds a million splats, of which progress is told.
CUTTING, MERGING, WRITING = 0.6, 3.5, 0.9
HARMONICS = 0.27  # more for WRITING, each coefficient
Box = tuple[np.ndarray, np.ndarray]  # (3,) least and most, metres
OfLevel = Callable[[int, float], None]


@dataclass(frozen=True)
class StreamedSizes:
    """What was written."""

    leaves: int
    levels: tuple[int, ...]  # splats of each


def write_streamed(
    splats: PlainSplats,
    folder: Path,
    leaf_splats: int,
    generator: str,
    progress: Callable[[float], None],
) -> StreamedSizes:
    """lod-meta.json and its files into an existing folder, of at least one splat.

    Leaves have at most leaf_splats splats at the finest level; all of them have every level, with
    an error that readers spend their budget by.  progress(part 0..1) is of the time that it takes.
    Raises BadFile where the tree gets too large.
    """
    progress(0.0)
    turned = rotate_half_turn(splats)
    flat = SplatLayers(
        turned.means, turned.scales, turned.wxyz, turned.opacity,
        turned.sh, np.zeros(len(turned.means), np.int32),
        (Stop("all", 0.0),), origin=turned.origin, antialiased=turned.antialiased,
    )  # fmt: skip
    leaves = cut_leaves(flat.means, leaf_splats)
    count = count_levels(flat.splat_count, leaves.count)
    nodes: list[dict] = [{"lods": {}, "errors": []} for _ in range(leaves.count)]
    boxes: list[Box] = [(np.full(3, np.inf), np.full(3, -np.inf))] * leaves.count
    names: list[str] = []
    sizes = []
    merged, written = parts_of(count, turned.sh.shape[1], progress)
    merged(0, 1.0)
    for level in make_levels(flat, leaves, count, merged):
        sizes.append(level.splats.splat_count)
        names += write_level(level, folder, nodes, len(names), generator, written)
        boxes = [around(box, other) for box, other in zip(boxes, boxes_of(level), strict=True)]
    meta = {
        "version": 1,
        "asset": {"generator": generator},
        "lodLevels": count,
        "lodErrors": True,
        "filenames": names,
        "tree": described(leaves.tree, nodes, boxes)[0],
    }
    data = json.dumps(meta, separators=(",", ":")).encode()
    if len(data) > LARGEST_TREE:
        raise BadFile(
            f"{leaves.count:,} leaves make a {TREE} of {len(data):,} bytes, readers take "
            f"{LARGEST_TREE:,} at most; give leaves more splats, --leaf {4 * leaf_splats}."
        )
    write_whole(folder / TREE, data)
    progress(1.0)
    return StreamedSizes(leaves.count, tuple(sizes))


def parts_of(
    count: int, coefficients: int, progress: Callable[[float], None]
) -> tuple[OfLevel, OfLevel]:
    """(merged, written): (level, part of it 0..1), told as a part of the time of `count` levels.

    Level 0 is cut instead of merged.
    """
    writing = WRITING + HARMONICS * (coefficients - 1)
    pieces = [CUTTING, writing]
    for level in range(1, count):
        pieces += [MERGING * 0.5 ** (level - 1), writing * 0.5**level]
    ends = np.r_[0.0, np.cumsum(pieces)] / sum(pieces)

    def report(piece: int, part: float) -> None:
        progress(float(ends[piece] + (ends[piece + 1] - ends[piece]) * part))

    return (
        lambda level, part: report(2 * level, part),
        lambda level, part: report(2 * level + 1, part),
    )


def write_level(
    level: Level, folder: Path, nodes: list[dict], first_file: int, generator: str,
    written: OfLevel,
) -> list[str]:  # fmt: skip
    """Writes a level, leaf after leaf, and notes where each run lies; gives the files' names."""
    ends = np.cumsum(np.bincount(level.leaf, minlength=len(nodes)))
    names: list[str] = []
    start = leaf = 0
    while leaf < len(nodes):
        fitting = int(np.searchsorted(ends, start + MOST_OF_A_FILE, side="right"))
        last = max(fitting, leaf + 1)
        stop, begin = int(ends[last - 1]), start
        for i in range(leaf, last):
            run = {"file": first_file + len(names), "offset": begin - start}
            nodes[i]["lods"][str(level.number)] = run | {"count": int(ends[i]) - begin}
            nodes[i]["errors"].append(round(float(level.errors[i]), DIGITS))
            begin = int(ends[i])
        name = f"{level.number}_{len(names)}"
        (folder / name).mkdir()
        write_sog(plain_rows(level.splats, slice(start, stop)), folder / name, generator)
        names.append(f"{name}/meta.json")
        start, leaf = stop, last
        written(level.number, stop / ends[-1])
    return names


def plain_rows(layers: SplatLayers, rows: slice) -> PlainSplats:
    """Some splats of layers of one stop."""
    return PlainSplats(
        layers.means[rows], layers.scales[rows], layers.wxyz[rows], layers.opacity[rows],
        layers.sh[rows], layers.origin, layers.antialiased,
    )  # fmt: skip


def boxes_of(level: Level) -> list[Box]:
    """Each leaf's box, metres in the file, REACH sigmas around its splats."""
    splats = level.splats
    starts = np.searchsorted(level.leaf, np.arange(level.leaf[-1] + 1))
    middle = splats.means.astype(np.float64) + splats.origin
    spread = covariance(splats.scales.astype(np.float64), splats.wxyz)[:, [0, 3, 5]]
    away = REACH * np.sqrt(np.maximum(spread, 0))
    low = np.minimum.reduceat(middle - away, starts)
    high = np.maximum.reduceat(middle + away, starts)
    return list(zip(low, high, strict=True))


def around(one: Box, other: Box) -> Box:
    return np.minimum(one[0], other[0]), np.maximum(one[1], other[1])


def described(tree: Tree, nodes: list[dict], boxes: list[Box]) -> tuple[dict, Box]:
    """A node of the file for a part of the tree, and its box."""
    if isinstance(tree, int):
        return bound(boxes[tree]) | nodes[tree], boxes[tree]
    parts = [described(half, nodes, boxes) for half in tree]
    box = around(parts[0][1], parts[1][1])
    return bound(box) | {"children": [part for part, _ in parts]}, box


def bound(box: Box) -> dict:
    low, high = (np.round(end, DIGITS).tolist() for end in box)
    return {"bound": {"min": low, "max": high}}
