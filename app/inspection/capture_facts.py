"""What a command says of a capture: its stops, and what of its files was found, used, left out."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from shapeshift.app.terminal import open_console, print_text

if TYPE_CHECKING:
    from shapeshift.scene.captures.capture import Capture, FoundFiles


def capture_facts(path: Path) -> dict | None:
    """Of the capture at `path`; None where nothing there is posed photos.  Raises BadFile."""
    from shapeshift.scene.captures.foreign.read_foreign import blank_beside, read_foreign
    from shapeshift.scene.captures.read_capture import (
        has_frames,
        has_photos,
        has_poses,
        read_capture,
    )

    if path.is_dir():
        posed = has_poses(path) or read_foreign(path) is not None
    else:
        posed = path.is_file() and (has_frames(path) or read_foreign(path) is not None)
    if not posed and not (path.is_dir() and has_photos(path) and blank_beside(path)):
        return None
    capture = read_capture(path)
    return {
        "capture": str(path),
        "stops": [
            {
                "name": stop.name, "x": stop.x, "kind": stop.kind, "unit": stop.unit,
                "value_range": stop.value_range, "formula": stop.formula,
                "train": photos_of(capture, stop.name, "train"),
                "test": photos_of(capture, stop.name, "test"),
            }
            for stop in sorted((*capture.stops, *capture.formulas), key=lambda stop: stop.x)
        ],
        "points": 0 if capture.points is None else len(capture.points),
        "files": [asdict(row) for row in capture.files],
        "metres": capture.metres or None,
        "up": [
            {"by": way.source, "degrees": round(way.off(), 2), "sure": way.sure}
            for way in capture.ups
        ],
        "doubts": list(capture.doubts),
    }  # fmt: skip


def photos_of(capture: "Capture", stop: str, split: str) -> int:
    """Of a panorama all faces are one."""
    return len({photo.path for photo in capture.of(stop, split)})


def print_capture(facts: dict) -> None:
    """On standard output: a line a stop, the table of files, what a person should know."""
    from shapeshift.scene.captures.capture import FoundFiles

    for stop in facts["stops"]:
        photos = f"{stop['train']} photos to train on, {stop['test']} held out"
        what = f"by formula, {stop['formula']}" if stop["formula"] else photos
        print_text(f"{stop['x']:.3f}  {stop['name']} ({stop['kind']}): {what}")
    print_files([FoundFiles(**row) for row in facts["files"]], stderr=False)
    ways = ", ".join(f"{way['by']} {way['degrees']:.1f}" for way in facts["up"])
    print_text(f"Up, degrees from what is taken: {ways}.")
    print_text(f"Metres: {facts['metres'] or 'nobody says how long one is'}.")
    for doubt in facts["doubts"]:
        print_text(doubt)


def print_files(rows: "Sequence[FoundFiles]", stderr: bool = True) -> None:
    """The table of what was found, used, left out and why."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in ("files", "found", "used", "left out", "why, for example"):
        table.add_column(name, justify="right" if name in ("found", "used", "left out") else "left")
    before = ""
    for row in rows:
        kind = "" if row.kind == before else row.kind
        counts = (f"{count:,}" for count in (row.found, row.used, row.left_out))
        table.add_row(kind, *counts, Text(", ".join(filter(None, (row.why, row.example)))))
        before = row.kind
    open_console(stderr=stderr).print(table)
