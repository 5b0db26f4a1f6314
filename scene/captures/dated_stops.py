"""Captures of several days: modalities with dates become stops as far apart as their dates."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from shapeshift.runtime_models.files.json_fields import Fields, own_keys
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.splats.layers.frames import DATED, date_of
from shapeshift.runtime_models.stop_dates import (
    MOST_DATED,
    WANTED,
    check_dates,
    places_of,
    read_date,
    seconds_of,
)

NO_PLACE = -1.0  # x of a modality that says when, but not where on the slider


def date_in_entry(entry: Fields) -> str:
    """'date' of a modality or a frame; "" without.  Raises BadFile."""
    text = entry.text("date", "").strip()
    try:
        if text:
            read_date(text)
    except ValueError:
        raise entry.error("date", WANTED) from None
    return text


def day_of_frame(entry: Mapping, where: str) -> str:
    """The modality of a frame that names none: its day, where it has a date of its own; "" without.

    A date that a file has for all of its frames is of the file.
    """
    return date_in_entry(Fields(own_keys(entry), where))[: len("2026-05-04")]


def named_by_date(names: Sequence[str]) -> tuple[Stop, ...]:
    """Stops of visible light where all names, two or more, are dates; else ()."""
    if len(names) < 2 or not all(DATED.fullmatch(name) for name in names):
        return ()
    dates = {name: date_of(Path(name)) for name in names}
    return placed_by_date([Stop(name, NO_PLACE, date=dates[name]) for name in names], "the names")


def placed_by_date(stops: Sequence[Stop], where: str) -> tuple[Stop, ...]:
    """The stops by their dates, where none says its x; all as they are where all do.

    Raises BadFile for some of each, for dates that do not rise with x, and for too many.
    """
    bare = [stop for stop in stops if stop.x == NO_PLACE]
    if bare and not (len(bare) == len(stops) and all(stop.date for stop in stops)):
        raise BadFile(
            f"{where}: modality '{bare[0].name}' has no 'x'; all have one, or all have a 'date' "
            "and none an x."
        )
    if len(bare) > MOST_DATED:
        raise BadFile(f"{where}: {len(bare)} dates; at most {MOST_DATED} stops fit a slider.")
    found = tuple(stops)
    if bare:
        ordered = sorted(stops, key=lambda stop: seconds_of(stop.date))
        for one, other in pairwise(ordered):
            if seconds_of(one.date) == seconds_of(other.date):
                raise BadFile(f"{where}: '{one.name}' and '{other.name}' are of one date.")
        xs = places_of([stop.date for stop in ordered])
        found = tuple(replace(stop, x=x) for stop, x in zip(ordered, xs, strict=True))
    try:
        check_dates(found)
    except ValueError as error:
        raise BadFile(f"{where}: {error}") from None
    return found
