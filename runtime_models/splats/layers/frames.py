"""A folder of frames, one file of splats a moment: time as x.

frame_0001.ply, frame_0002.ply, ... or files with a date in their name, scan_2026-05-04.ply.  Each
is a stop that shows this file alone, exactly; between two frames one fades out and the other in.
"""

import re
from itertools import pairwise
from pathlib import Path

from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.splats.formats import format_of
from shapeshift.runtime_models.stop_dates import (
    MOST_DATED,
    WANTED,
    places_of,
    read_date,
    seconds_of,
)
from shapeshift.runtime_models.stop_names import stems_named

FRAME = re.compile(r"(frame|time|t)[ _-]?[0-9]+", re.IGNORECASE)
DATED = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2}(T[0-9]{2}[-:]?[0-9]{2}([-:]?[0-9]{2})?Z?)?")


def frame_files(files: list[Path]) -> list[Path]:
    """The files where they are frames, in the order of time; [] where they are layers.

    files: of one ending, in the order of their numbers.  BadFile for what is neither: more frames
    than stops, frames of other formats beside them, a date that is none.
    """
    if len(files) < 2:
        return []
    dated = all(DATED.search(path.stem) for path in files)
    if not dated and not all(FRAME.fullmatch(path.stem) for path in files):
        return []
    folder = files[0].parent
    if len(files) > MOST_DATED:
        raise BadFile(
            f"{folder} has {len(files)} frames; at most {MOST_DATED} are stops of one scene; open "
            "a folder with fewer of them."
        )
    form = DATED.search if dated else FRAME.fullmatch
    others = sorted(
        path.name
        for path in folder.iterdir()
        if path.suffix.lower() != files[0].suffix.lower() and form(path.stem) and format_of(path)
    )
    if others:
        raise BadFile(
            f"{folder} has frames of two kinds, {files[0].name} and {others[0]}; keep one kind."
        )
    if not dated:
        return files
    dates = {path: date_of(path) for path in files}
    ordered = sorted(files, key=lambda path: seconds_of(dates[path]))
    for before, after in pairwise(ordered):
        if seconds_of(dates[before]) == seconds_of(dates[after]):
            raise BadFile(f"{before.name} and {after.name} are of one date; each has its own.")
    return ordered


def frame_stops(files: list[Path]) -> tuple[Stop, ...]:
    """A stop a frame: named by dates and as far apart as these are, else by files and evenly."""
    if not all(DATED.search(path.stem) for path in files):
        last, names = len(files) - 1, stems_named([path.stem for path in files])
        return tuple(Stop(name, i / last, "layer") for i, name in enumerate(names))
    dates = [date_of(path) for path in files]
    pairs = zip(dates, places_of(dates), strict=True)
    return tuple(Stop(date, x, "layer", date=date) for date, x in pairs)


def date_of(path: Path) -> str:
    """The date in a file's name, with the colons that names lack.  Raises BadFile."""
    found = DATED.search(path.stem)
    assert found is not None, "it was found before"
    day, _, clock = found[0].partition("T")
    digits = re.sub(r"[^0-9]", "", clock)
    parts = [digits[i : i + 2] for i in range(0, len(digits), 2)]
    text = f"{day}T{':'.join(parts)}{'Z' if clock.endswith('Z') else ''}" if parts else day
    try:
        read_date(text)
    except ValueError:
        raise BadFile(f"{path.name}: '{text}' is no date; {WANTED} is wanted.") from None
    return text
