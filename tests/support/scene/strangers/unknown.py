"""Situations of heat in which some pixels hold no value: how many are unknown, and the range."""

from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.training.photo_store.open_photos import open_photos
from tests.support.scene.gaps import FORMS, LOWEST, border, warm, write_heat, write_numbers
from tests.support.scene.strangers.situations import Situation, short

COUNT = 3


def heat(ending: str, value: float, tag: str | None, said: dict):
    """Photos with a border that has no value."""

    def make(folder: Path) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        photos = [
            write_numbers(folder / f"{i}", np.where(border(), value, warm(i)), ending, tag)
            for i in range(COUNT)
        ]
        return write_heat(folder, photos, **said)

    return make


def without_one(value: float, blank: range):
    """Photos of which some have no value at all."""

    def make(folder: Path) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        photos = []
        for i in range(COUNT):
            numbers = np.full_like(warm(i), value) if i in blank else warm(i)
            photos.append(write_numbers(folder / f"{i}", numbers, ".tif", None))
        return write_heat(folder, photos)

    return make


def known(path: Path) -> str:
    """The range, and what is said of pixels without a value; or the refusal."""
    try:
        capture = read_capture(path)
        opened = open_photos(capture, 1, "auto")
    except BadFile as error:
        return f"refused: {short(str(error), path)}"
    low, high = capture.stops[0].value_range or (0, 65535)
    share = sum(p.unknown for p in (*opened.train, *opened.test)) / (COUNT * warm(0).size)
    left = COUNT - len(opened.train) - len(opened.test)
    out = f", {left} photo left out" if left else ""
    asked = ", asked about" if any("'no_data'" in doubt for doubt in capture.doubts) else ""
    return f"{low:g} to {high:g}, {share:.0%} unknown{out}{asked}"


def form(name: str, title: str, met: str, found: str) -> Situation:
    return Situation(title, met, heat(*FORMS[name]), found, known)


INSIDE = "16 to 103, 27% unknown"
SITUATIONS = [
    form("tag", "heat with no data", "GDAL's tag in a TIFF: a border of -9999", INSIDE),
    form("tag lowest", "heat with the least float", "no data -3.4e38, with the tag", INSIDE),
    form("lowest", "heat with the least float, untold", "no data -3.4e38, no tag", INSIDE),
    form("nan", "heat with NaN", "float TIFF with NaN where nothing was measured", INSIDE),
    form("csv of blanks", "a CSV with blanks", "cells without a number", INSIDE),
    form("csv of errors", "a CSV with errors", "cells with #VALUE! of a spreadsheet", INSIDE),
    form("csv of C", "a CSV of Microsoft's C", "NaN written as -1.#IND, 1.#QNAN", INSIDE),
    form("tag of counts", "counts with no data", "16-bit TIFF, 0 is no data by GDAL's tag", INSIDE),
    form("said", "no data that only you know", "'no_data': -32767 in capture.json", INSIDE),
    form(
        "above the range",
        "more than a camera measures",
        "'valid_range': [-40, 550], pixels at 550.5",
        INSIDE,
    ),
    Situation(
        "untold -9999",
        "no data of which nothing says that it is none",
        heat(".tif", -9999, None, {}),
        "-10600 to 700, 0% unknown, asked about",
        known,
    ),
    Situation(
        "a photo of NaN",
        "one of the photos was never measured",
        without_one(np.nan, range(1, 2)),
        "16 to 103, 0% unknown, 1 photo left out",
        known,
    ),
    Situation(
        "photos of NaN",
        "none was measured",
        without_one(LOWEST, range(COUNT)),
        "refused: 0.tif: no pixel of it has a value, nor of the 3 photos of Thermal (NaN, or "
        "what stands for no data)",
        known,
    ),
]
