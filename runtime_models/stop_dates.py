"""Stops with dates: time as x.  Dates are ISO 8601, without a zone in UTC.

Between two dated neighbours x goes evenly in time, so a date in between has a place on the slider,
too, and so have the days, months and years of a calendar.
"""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from itertools import pairwise

import numpy as np

from shapeshift.runtime_models.stop import Stop

MOST_DATED = 64  # stops: what a control encoding tells apart, LEAST_GAP of x between two
LEAST_GAP = 1 / (MOST_DATED - 1)
WANTED = "a date such as 2026-05-04 or 2026-05-04T12:30"
# What a calendar is divided by, from fine to coarse: seconds, or months below 0.
STEPS = (60, 600, 3600, 6 * 3600, 86400, 7 * 86400, -1, -3, -12, -60, -120, -600)


def read_date(text: str) -> datetime:
    """ValueError, one sentence, for what is none."""
    try:
        found = datetime.fromisoformat(text.strip())
    except ValueError:
        raise ValueError(f"'{text[:60]}' is no date; {WANTED} is wanted.") from None
    return found if found.tzinfo else found.replace(tzinfo=UTC)


def seconds_of(text: str) -> float:
    """Of a date, since 1970."""
    return read_date(text).timestamp()


def check_dates(stops: Sequence[Stop]) -> None:
    """ValueError, one sentence, where dates are none, do not rise with x, or are too many."""
    dated = sorted((stop for stop in stops if stop.date), key=lambda stop: stop.x)
    if len(dated) > MOST_DATED:
        raise ValueError(f"{len(dated)} stops have dates; at most {MOST_DATED} fit a slider.")
    for stop in dated:
        try:
            read_date(stop.date)
        except ValueError as error:
            raise ValueError(f"stop '{stop.name}': {error}") from None
    for before, after in pairwise(dated):
        if not seconds_of(before.date) < seconds_of(after.date):
            raise ValueError(
                f"stop '{after.name}' of {after.date} comes after '{before.name}' of "
                f"{before.date}; dates must rise with x."
            )


def timeline(stops: Sequence[Stop]) -> tuple[np.ndarray, np.ndarray]:
    """Seconds and x of the dated stops, both rising; empty without any."""
    rows = sorted((seconds_of(stop.date), stop.x) for stop in stops if stop.date)
    table = np.array(rows, np.float64).reshape(-1, 2)
    return table[:, 0], table[:, 1]


def x_of_date(text: str, stops: Sequence[Stop]) -> float:
    """Where a date lies on the slider.  ValueError for none, or one outside of all stops'.

    A date without a time of day means the stop of that day, where there is one.
    """
    when = seconds_of(text)
    seconds, xs = timeline(stops)
    if len(text.strip()) == len("2026-05-04"):
        that_day = [s.x for s in stops if s.date and 0 <= seconds_of(s.date) - when < 86400]
        if that_day:
            return that_day[0]
    if not (len(seconds) and seconds[0] <= when <= seconds[-1]):
        ends = sorted((stop.date for stop in stops if stop.date), key=seconds_of)
        raise ValueError(f"{text.strip()[:60]} is outside of {ends[0]} to {ends[-1]}.")
    return float(np.interp(when, seconds, xs))


def places_of(dates: Sequence[str]) -> list[float]:
    """x of stops with rising dates, 0 to 1: as their dates are apart, and never nearer than
    LEAST_GAP, which takes from the wider gaps.
    """
    gaps = np.diff([seconds_of(date) for date in dates])
    if not len(gaps):
        return [0.0]
    shares = gaps / gaps.sum()
    for _ in range(len(shares)):
        narrow = shares <= LEAST_GAP
        if not (shares < LEAST_GAP).any():
            break
        room = 1 - LEAST_GAP * narrow.sum()
        shares = np.where(narrow, LEAST_GAP, shares)
        if not narrow.all():
            shares[~narrow] *= room / shares[~narrow].sum()
    xs = np.concatenate([[0.0], np.cumsum(shares)])
    return [float(x) for x in np.append(xs[:-1], 1.0)]


def calendar_ticks(stops: Sequence[Stop], most: int) -> list[tuple[float, str]]:
    """(x, words) of even steps of the calendar between the first and the last dated stop, the
    finest of STEPS of which there are at most so many; [] without dates.
    """
    seconds, xs = timeline(stops)
    if len(seconds) < 2 or most < 1:
        return []
    first, last = (datetime.fromtimestamp(s, UTC) for s in (seconds[0], seconds[-1]))
    for step in STEPS:
        if step > 0 and (seconds[-1] - seconds[0]) / step > most + 1:
            continue
        found = [at for at in _calendar(first, last, step) if first <= at <= last]
        if 1 <= len(found) <= most:
            form = "%Y" if step <= -12 else "%Y-%m" if step < 0 else "%m-%d"
            form = "%H:%M" if 0 < step < 86400 else form
            places = np.interp([at.timestamp() for at in found], seconds, xs)
            return [(float(x), at.strftime(form)) for x, at in zip(places, found, strict=True)]
    return []


def _calendar(first: datetime, last: datetime, step: int) -> list[datetime]:
    """Whole steps from at or before the first to the last."""
    if step > 0:
        start = datetime.fromtimestamp(first.timestamp() // step * step, UTC)
        count = int((last - start).total_seconds() // step) + 1
        return [start + timedelta(seconds=step * n) for n in range(count)]
    months = (first.year * 12 + first.month - 1) // -step * -step
    end = last.year * 12 + last.month - 1
    return [datetime(m // 12, m % 12 + 1, 1, tzinfo=UTC)
            for m in range(max(months, 12), min(end, 9999 * 12) + 1, -step)]  # fmt: skip
