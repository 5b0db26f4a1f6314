"""Levels of detail of a package: averaged anchors that learn to look like it, from afar."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.app.errors import UsageError
from shapeshift.app.streaming.level_errors import LevelErrors, LevelMeter
from shapeshift.runtime_models.blocks.block_model import BlockModel
from shapeshift.runtime_models.lod.average_anchors import average_anchors, cell_for
from shapeshift.runtime_models.lod.level_files import (
    is_levels,
    level_table,
    read_level,
    write_levels,
)
from shapeshift.runtime_models.model import HEADS, AnchorModel, BadFile, CoarserAnchors, Model
from shapeshift.runtime_models.package.package_files import ANCHORS, MANIFEST, open_package
from shapeshift.runtime_models.package.read_manifest import read_manifest
from shapeshift.runtime_models.package.write_package import zip_files
from shapeshift.runtime_models.program import program
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.scene.cameras.framing import orbit_path
from shapeshift.scene.pose import View

SHARES = (0.25, 0.08)  # of the anchors, that the coarser levels have
SIZES_PX = (200.0, 90.0)  # at which they are meant to be good, and learn to be
NEARER_AND_FARTHER = (1.25, 1.0, 0.5)  # times that size, in turns
LARGER = 1.26  # times that size: from there on it is tried
APART = 1.3  # times a level's size is the one before it: beyond what hysteresis keeps apart
SECONDS = (0.65, 0.35)  # of the time that each may learn
VIEWS = 12  # that it learns from
LEAST_ANCHORS = 24  # of a level
GOLDEN = 0.618034  # of a turn between two views: any number of them is spread evenly
LOW, HIGH = -0.2, 0.9  # sines of the elevations
MARGIN = 1.15  # of a picture's side, about the model
MEASURING = 0.3  # of the time

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class MadeLevel:
    """A coarser level as it is stored, and what it is like."""

    table: bytes
    anchors: CoarserAnchors
    errors: LevelErrors  # at the largest size where it is good, or at the smallest of all
    steps: int  # that it has learned


@dataclass(frozen=True)
class MadeLevels:
    """A package with its coarser levels."""

    model: AnchorModel
    levels: tuple[MadeLevel, ...]  # that are good somewhere
    left_out: tuple[MadeLevel, ...]  # that are not


def make_levels(model: AnchorModel, seconds: float, progress: Progress) -> MadeLevels:
    """The levels of a package, which learn for so many processor seconds.  Raises BadFile."""
    with LevelMeter(model) as meter:
        made: list[MadeLevel] = []
        for number, share in enumerate(SHARES):
            if share * len(model.anchors) >= LEAST_ANCHORS:
                good = [each for each in made if each.errors.good]
                made.append(make_level(meter, number, good[-1:], seconds, progress))
    good = [each for each in made if each.errors.good]
    left_out = tuple(each for each in made if not each.errors.good)
    return MadeLevels(
        model.with_coarser(tuple(each.anchors for each in good)), tuple(good), left_out
    )


def make_level(
    meter: LevelMeter, number: int, before: list[MadeLevel], seconds: float, progress: Progress
) -> MadeLevel:
    """Level `number` + 1; before: the last good one, where there is any."""
    done, own = sum(SECONDS[:number]), SECONDS[number]

    def report(part: float) -> None:
        progress(f"level {number + 1} learns", (1 - MEASURING) * (done + own * part))

    cell = cell_for(meter.model, SHARES[number])
    coarse = average_anchors(meter.model, cell)
    level, steps = learned(meter, coarse, SIZES_PX[number], (seconds * own, report))
    table = level_table(level)
    stored = read_level(table, meter.model, f"level {number + 1}")
    progress(f"level {number + 1} is measured", 1 - MEASURING + MEASURING * done)
    last, first_size = meter.model, LARGER * SIZES_PX[number]
    for one in before:
        last = standing(meter.model, one.anchors)
        first_size = min(first_size, one.anchors.from_pixels / APART)
    errors = meter.largest_good(standing(meter.model, stored), last, first_size)
    if errors.good:
        stored = replace(stored, from_pixels=errors.pixels, error_db=errors.db)
    return MadeLevel(table, replace(stored, cell_m=cell), errors, steps)


def learned(
    meter: LevelMeter, coarse: AnchorModel, pixels: float,
    how: tuple[float, Callable[[float], None]],
) -> tuple[AnchorModel, int]:  # fmt: skip
    """A level that is meant for that size, after so many processor seconds, and its steps."""
    from shapeshift.rasterizer.device import open_device
    from shapeshift.training.distill import distill

    seconds, progress = how
    views = learning_views(meter, pixels)
    return distill(open_device(), meter.model, coarse, views, seconds, progress)


def learning_views(meter: LevelMeter, pixels: float) -> list[View]:
    """All about the model, as large as it is seen, in pictures that it fills."""
    views = []
    for i in range(VIEWS):
        size = pixels * NEARER_AND_FARTHER[i % len(NEARER_AND_FARTHER)]
        side = max(8 * int(np.ceil(MARGIN * size / 8)), 16)
        height = LOW + (HIGH - LOW) * ((i + 0.5) * 2**0.5 % 1)
        # The bounds' diameter is `size` pixels of the picture's side.
        (probe,) = orbit_path(1, meter.centre, meter.radius, (side, side), distance=1.0)
        views += orbit_path(
            1, meter.centre, meter.radius, (side, side),
            distance=side / (probe.tangents[1] - probe.tangents[0]) * 2 * meter.radius / size,
            elevation=float(np.arcsin(height)), start=2 * np.pi * (GOLDEN * i % 1),
        )  # fmt: skip
    return views


def standing(model: AnchorModel, level: CoarserAnchors) -> AnchorModel:
    """A level as a model of its own."""
    return model.with_coarser((level,)).levels[1]


def refuse_other(model: Model, path: Path) -> AnchorModel:
    """The package that a scene is, without levels.  Raises UsageError."""
    if is_levels(path):
        raise UsageError(f"{path} has levels already; name the package that they were made of.")
    if isinstance(model, BlockModel):
        raise UsageError(
            f"{path} is a scene in blocks, which has no levels; make one package of it with "
            f"`{program()} export`, and levels of that."
        )
    if not isinstance(model, AnchorModel):
        raise UsageError(
            f"{path} is no package of anchors; leave the ending of --out away to write its levels "
            "as streamed SOG."
        )
    return model


def refuse_foreign_folder(out: Path) -> None:
    """UsageError where a folder that is not of levels, and not empty, would be lost."""
    if out.is_dir() and not is_levels(out) and any(out.iterdir()):
        raise UsageError(f"--out {out} is no folder of levels; choose another name.")


def package_bytes(path: Path) -> bytes:
    """The package as one file: as it is, or a folder's files zipped.  Raises BadFile."""
    if path.is_file() and path.name != MANIFEST:
        return path.read_bytes()
    folder = path if path.is_dir() else path.parent
    read = open_package(folder, Reading().within(folder).account)
    files = {MANIFEST: read(MANIFEST), ANCHORS: read(ANCHORS)}
    heads = read_manifest(files[MANIFEST], str(folder)).heads
    files |= {heads[name].file: read(heads[name].file) for name in HEADS}
    return zip_files(files)


def write_made(made: MadeLevels, source: Path, out: Path) -> int:
    """The folder, all or nothing; its bytes.  Raises BadFile, also where no level is good."""
    if not made.model.coarser:
        counts = " and ".join(f"{len(each.anchors.anchors):,}" for each in made.left_out) or "none"
        raise BadFile(
            f"{source}: no coarser level is good enough at any size (tried: {counts} anchors); let "
            "them learn longer with --distill, or show the package as it is."
        )
    tables = [each.table for each in made.levels]
    return write_levels(out, package_bytes(source), made.model, tables)
