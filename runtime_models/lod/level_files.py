"""Levels of detail of a package on disk: lod.json, the package as it is, a table a level."""

import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import channels_of
from shapeshift.runtime_models.files.json_fields import Fields, read_json, shown
from shapeshift.runtime_models.files.memory import Account, unlimited
from shapeshift.runtime_models.files.npy import write_arrays
from shapeshift.runtime_models.files.plain_text import json_text
from shapeshift.runtime_models.files.whole_file import whole_folder
from shapeshift.runtime_models.model import AnchorModel, BadFile, CoarserAnchors
from shapeshift.runtime_models.package.feature_codes import encode_features, encode_light
from shapeshift.runtime_models.package.package_files import LABELS
from shapeshift.runtime_models.package.read_package import (
    SHOWN,
    read_anchors,
    read_labels,
    read_package,
)
from shapeshift.runtime_models.splats.plain_splats import Reading

LEVELS = "lod.json"
ENDING = ".lod"  # of the folder
FORMAT = "shapeshift-lod 1"
PACKAGE = "scene.shift"  # what `write_levels` calls the package
LARGEST_LIST = 1 << 20  # bytes
LARGEST_LEVEL = 4 << 30  # bytes, of one table
MOST_LEVELS = 16
MOST_COUNT = 1 << 31  # anchors or splats
MOST_PIXELS = 1e6
MOST_DB = 1000.0
ADVICE = "write it again with the command lod"
STORED = "float16"


@dataclass(frozen=True)
class LevelRow:
    """What lod.json says of one level."""

    file: Path
    anchors: int
    splats: int
    cell_m: float = 0.0
    from_pixels: float = 0.0
    error_db: dict[str, float] | None = None


def is_levels(path: Path) -> bool:
    """Whether it is a folder with levels of detail of a package, or the list in it."""
    return (path / LEVELS).is_file() or (path.name == LEVELS and path.is_file())


def read_levels(path: Path, reading: Reading | None = None) -> AnchorModel:
    """The package with its coarser levels.  Raises BadFile."""
    folder = path if path.is_dir() else path.parent
    rows, reading = read_rows(folder), (reading or Reading()).begun()
    model = read_package(rows[0].file, reading)
    where = f"{folder.name}/{LEVELS}"
    refuse_miscounted(where, rows[0], len(model.anchors), model)
    coarser = []
    for row in rows[1:]:
        size = row.file.stat().st_size
        if size > LARGEST_LEVEL:
            raise BadFile(f"{row.file} has {size:,} bytes, at most {LARGEST_LEVEL:,} are read.")
        memory = reading.within(row.file).account
        memory.charge(size, row.file.name)
        level = read_level(row.file.read_bytes(), model, f"{folder.name}/{row.file.name}", memory)
        memory.release(size)
        refuse_miscounted(where, row, len(level.anchors), model)
        coarser.append(
            replace(
                level, cell_m=row.cell_m, from_pixels=row.from_pixels, error_db=row.error_db or {}
            )
        )
    return model.with_coarser(tuple(coarser))


def refuse_miscounted(where: str, row: LevelRow, anchors: int, model: AnchorModel) -> None:
    """BadFile where a level has other anchors or splats than the list says."""
    splats = anchors * model.splats_per_anchor
    if (row.anchors, row.splats) != (anchors, splats):
        raise BadFile(
            f"{where} says that {row.file.name} has {row.anchors:,} anchors and {row.splats:,} "
            f"splats, but it holds {anchors:,} and {splats:,}; {ADVICE}."
        )


def read_rows(folder: Path) -> list[LevelRow]:
    """The levels that the list names, the package first; all of its numbers are checked."""
    path = folder / LEVELS
    top = Fields(read_json(path, most_bytes=LARGEST_LIST), f"{folder.name}/{LEVELS}", ADVICE)
    if (found := top.data.get("format")) != FORMAT:
        raise BadFile(f"{path} has format {shown(found)}, this program reads '{FORMAT}'.")
    rows: list[LevelRow] = []
    for number, fields in enumerate(top.rows("levels", MOST_LEVELS, "level", first=0)):
        file = level_file(folder, fields)
        anchors = fields.count("anchors", 1, MOST_COUNT)
        splats = fields.count("splats", 1, MOST_COUNT)
        if not number:
            rows.append(LevelRow(file, anchors, splats))
            continue
        least = "a number above 0"
        cell = fields.number("voxel", wanted=least, low=1e-30)
        pixels = fields.number("from_pixels", wanted=least, low=1e-6, high=MOST_PIXELS)
        before = rows[-1]
        if number > 1 and not pixels < before.from_pixels:
            raise fields.error(
                "from_pixels", f"a number below {before.from_pixels:g}, as before it"
            )
        rows.append(LevelRow(file, anchors, splats, cell, pixels, read_errors(fields)))
    if not rows:
        raise top.error("levels", "a list of the package and its coarser levels")
    if len({row.file for row in rows}) < len(rows):
        raise BadFile(f"{path} names one file twice; each level needs its own; {ADVICE}.")
    return rows


def level_file(folder: Path, fields: Fields) -> Path:
    """A file in the folder itself; nothing outside of it is opened, by links neither."""
    name = fields.text("file")
    if any(sign in name for sign in "/\\:\0") or name in (".", ".."):
        raise fields.error("file", "the name of a file beside it")
    file = folder / name
    if not file.is_file() or file.resolve().parent != folder.resolve():
        raise BadFile(
            f"{fields.where} names {shown(name)}, which is no file in {folder}; {ADVICE}."
        )
    return file


def read_errors(fields: Fields) -> dict[str, float]:
    """dB by where x stood; {} where it says none."""
    errors = fields.optional_object("error_db")
    if errors is None:
        return {}
    return {
        name: errors.number(name, wanted="dB", low=0, high=MOST_DB)
        for name in ("stops", "between")
        if errors.has(name)
    }


def read_level(
    data: bytes, model: AnchorModel, where: str, memory: Account | None = None
) -> CoarserAnchors:
    """The anchors of one level of a model, as its own table has them.  Raises BadFile."""
    memory = memory or unlimited()
    width = model.features.shape[1]
    channels = 0 if model.light is None else channels_of(model.light)
    anchors, features, frames, light = read_anchors(data, width, where, True, memory, channels)
    labelled = model.objects if model.labels is not None else None
    labels = read_labels(data, labelled, len(anchors), where, memory)
    shown_splats = len(anchors) * model.splats_per_anchor
    memory.charge(SHOWN * shown_splats, f"{shown_splats:,} splats")
    return CoarserAnchors(anchors, features, frames, labels, light, 0.0, 0.0)


def level_table(level: AnchorModel) -> bytes:
    """The table of one level, as read_level takes it: anchors that have frames."""
    assert level.frames is not None, "a coarser anchor reaches farther, by its frame"
    tables = encode_features(level.features, STORED)
    logs = np.log(level.frames.scales)
    tables |= encode_features(logs, STORED, "frame_log_scales")
    tables |= encode_features(level.frames.wxyz, STORED, "frame_rotations")
    if level.light is not None:
        tables |= encode_light(level.light, STORED)
    if level.labels is not None:
        tables[LABELS] = level.labels
    out = io.BytesIO()
    write_arrays(out, {"positions": level.anchors, **tables})
    return out.getvalue()


def write_levels(folder: Path, package: bytes, model: AnchorModel, tables: Sequence[bytes]) -> int:
    """lod.json, the package as it is and the tables of `model.coarser`; bytes on disk.

    All or nothing; what cannot be read back is not written.
    """
    k = model.splats_per_anchor
    levels: list[dict[str, object]] = [
        {"file": PACKAGE, "anchors": len(model.anchors), "splats": model.splat_count}
    ]
    for number, level in enumerate(model.coarser, 1):
        levels.append(
            {
                "file": f"level{number}.npz",
                "anchors": len(level.anchors),
                "splats": len(level.anchors) * k,
                "voxel": level.cell_m,
                "from_pixels": level.from_pixels,
                "error_db": level.error_db,
            }
        )
    files = {LEVELS: json_text({"format": FORMAT, "levels": levels}).encode(), PACKAGE: package}
    files |= {f"level{number}.npz": table for number, table in enumerate(tables, 1)}
    folder.parent.mkdir(parents=True, exist_ok=True)
    with whole_folder(folder) as part:
        for name, data in files.items():
            (part / name).write_bytes(data)
        read_levels(part)
    return sum(map(len, files.values()))


def files_of_levels(path: Path) -> list[Path]:
    """What belongs to it."""
    folder = path if path.is_dir() else path.parent
    return [folder / LEVELS, *(row.file for row in read_rows(folder))]
