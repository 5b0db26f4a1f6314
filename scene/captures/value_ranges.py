"""The range of photos that are numbers, where the capture states none: from themselves."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import shown
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.stop import USUAL_PALETTE
from shapeshift.scene.captures.capture import Photo
from shapeshift.scene.captures.photo import decoded, numbers_of, open_image
from shapeshift.scene.captures.radiometric.no_value import FLOATS, GREY_16
from shapeshift.scene.captures.radiometric.number_photos import (
    cannot_read_radiometric,
    is_radiometric,
)

LOOKED_AT = 24  # photos of a modality
PERCENTILES = (0.1, 99.9)  # between which the range begins; a dead pixel is beyond
GREY_STEPS = 2  # of 255: JPEG makes of a grey saved in three channels no more
BYTES = (0.0, 255.0)  # of photos of 8 bits, whose counts are all that is known
LARGEST = 1e9  # of a value that anybody measures
FEW, SHARE = 10, 1e-4  # of the numbers looked at: so many alike may stand for no value
MARGIN = 0.05  # of what lies between, added at each end: the hottest spot is not cut off


def with_own_ranges(
    stops: Sequence[Stop], photos: list[Photo]
) -> tuple[tuple[Stop, ...], list[Photo], tuple[str, ...]]:
    """Stops with ranges, photos with counts, and what a person should know.

    Of modalities of values, heat or others, without 'counts'.  Photos of floating-point numbers
    and radiometric ones are values: a stated range is in their unit.  16 bits with a range are read
    over all of it.
    """
    out, doubts = [], []
    for stop in stops:
        mine = [photo for photo in photos if photo.modality == stop.name]
        kind = _kind(mine) if stop.is_measured else ""
        if stop.kind == "values" and mine:
            if kind == "bytes":
                refuse_colors(mine[0])
            usual = BYTES if kind == "bytes" else mine[0].counts
            palette = stop.palette or USUAL_PALETTE["values"]
            stop = replace(stop, palette=palette, value_range=stop.value_range or usual)
        kind = "" if kind == "bytes" else kind
        missing = cannot_read_radiometric(mine[0].path) if kind == "radiometric" else ""
        if missing:
            doubts.append(
                f"The photos of {stop.name} hold temperatures, but only their colours are read; "
                f"{missing}."
            )
            kind = ""
        if not kind or (kind == "counts" and stop.value_range is not None):
            out.append(stop)
            continue
        ends = stop.value_range
        if ends is None:
            every = _some_values(mine)
            ends = _own_range(every, mine[0].path)
            doubts += untold_no_data(stop.name, every)
        lack = kind == "radiometric"
        photos = [
            replace(p, counts=ends, may_lack_values=lack or p.may_lack_values)
            if p.modality == stop.name
            else p
            for p in photos
        ]
        unit = stop.unit or ("°C" if kind == "radiometric" else "")
        palette = stop.palette or USUAL_PALETTE[stop.kind]  # without one values are no scale
        out.append(replace(stop, value_range=ends, unit=unit, palette=palette))
    return tuple(out), photos, tuple(doubts)


def _kind(photos: list[Photo]) -> str:
    """radiometric, values (floating-point numbers), counts (16 bits) or bytes, by the first photo;
    "": its range is stated by its counts.
    """
    if not photos or any(photo.counts is not None for photo in photos):
        return ""
    path = photos[0].path
    if not photos[0].band and is_radiometric(path):
        return "radiometric"
    with open_image(path, photos[0].band) as image:
        return "values" if image.mode == FLOATS else "counts" if image.mode in GREY_16 else "bytes"


def refuse_colors(photo: Photo) -> None:
    """BadFile where a photo holds colours: a value is one number a pixel."""
    image = decoded(photo.path, photo.counts, band=photo.band).image
    pixels = np.asarray(image.convert("RGB"))
    if np.ptp(pixels, axis=2).max(initial=0) > GREY_STEPS:
        raise BadFile(
            f"{photo.path}: a photo of colours in {shown(photo.modality)}, which is of "
            "kind values; photos of one number a pixel are wanted, or say with 'band' which of "
            "its channels counts"
        )


def _some_values(photos: list[Photo]) -> np.ndarray:
    """(N,) what some of the photos of a modality hold.  Raises BadFile where none has a value."""
    step = -(-len(photos) // LOOKED_AT)
    some, others = photos[::step], [p for i, p in enumerate(photos) if i % step]
    every = np.concatenate([_sample(photo) for photo in some])
    while not len(every) and others:  # of those, no pixel has a value
        every = _sample(others.pop())
    if not len(every):
        raise BadFile(
            f"{photos[0].path}: no pixel of it has a value, nor of the {len(photos)} photos of "
            f"{photos[0].modality} (NaN, or what stands for no data); copy them again"
        )
    return every


def untold_no_data(name: str, values: np.ndarray) -> list[str]:
    """A sentence where many of the values (N,) of a modality are one number far from all others, as
    programs write for no data; nothing else tells it from a value.
    """
    for end in (values.min(), values.max()):
        alone = values == end
        others = values[~alone]
        if not alone.sum() >= max(FEW, SHARE * len(values)) or not len(others):
            continue
        low, high = float(others.min()), float(others.max())
        if min(abs(end - low), abs(end - high)) > high - low > 0:
            return [
                f"{name}: {alone.mean():.2%} of the numbers are {end:g}, far from all others "
                f"({low:g} to {high:g}); if that stands for no value, say 'no_data': {end:g} of "
                "the modality in capture.json (docs/capture.md)."
            ]
    return []


def _own_range(every: np.ndarray, path: Path) -> tuple[float, float]:
    """Of values (N,), the first of which lie in a photo.  Raises BadFile."""
    low, high = np.percentile(every.astype(np.float64), PERCENTILES)
    if not max(abs(low), abs(high)) <= LARGEST:
        end, way = (low, "down") if abs(low) > abs(high) else (high, "up")
        raise BadFile(
            f"{path}: numbers {way} to {end:.3g}; say with 'value_range' what counts, or "
            f"with 'no_data' that {end:.3g} is no value"
        )
    more = MARGIN * (high - low) or 0.5
    digits = 2 - math.floor(math.log10(high - low + 2 * more))  # three of the range, outwards
    step = 10.0**-digits
    ends = (math.floor((low - more) / step) * step, math.ceil((high + more) / step) * step)
    return round(ends[0], digits), round(ends[1], digits)


def _sample(photo: Photo) -> np.ndarray:
    """(N,) some of the values in it."""
    numbers = numbers_of(photo)
    known = numbers[np.isfinite(numbers)]
    return known[:: max(1, len(known) // 100_000)]
