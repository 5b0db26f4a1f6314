"""What the command change prints and writes: a table, JSON, CSV, marks, pictures, layers."""

import csv
import io
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.change.draw_pairs import Progress
from shapeshift.app.change.find_change import FoundChange, SceneChange
from shapeshift.app.change.layers import write_layers
from shapeshift.app.change.pictures import pictures_of, words
from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.files.plain_text import json_text
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.scene.change.places import ChangedPlace
from shapeshift.scene.inspection.marks import box_around
from shapeshift.scene.inspection.marks_file import MarksFile, marks_path, write_marks_file

if TYPE_CHECKING:
    from shapeshift.renderer.renderer import Renderer

LAYERS, CSV, JSON = "layers", "places.csv", "places.json"
MOST_PICTURES = 100  # of the largest places
COLUMNS = ("number", "kind", "x", "y", "z", "size_x", "size_y", "size_z", "area_cm2", "amount",
           "unit", "now", "from_x", "from_y", "from_z")  # fmt: skip


def place_row(place: ChangedPlace, origin: np.ndarray) -> dict[str, float | int | str | None]:
    """A place in metres of A's file; None: it has no such number."""
    values = [*(place.centre + origin), *place.size]
    row: dict[str, float | int | str | None] = {"number": place.number, "kind": place.kind}
    row |= {k: round(float(v), 4) for k, v in zip(COLUMNS[2:8], values, strict=True)}
    row |= {"area_cm2": round(1e4 * place.area_m2, 1), "unit": place.unit}
    row["amount"] = finite(place.amount, 4)
    row["now"] = finite(place.level, 2)
    came = place.centre - place.shift + origin
    row |= {key: finite(v, 4) for key, v in zip(COLUMNS[12:], came, strict=True)}
    return {key: row[key] for key in COLUMNS}


def finite(value: float, digits: int) -> float | None:
    return round(float(value), digits) if np.isfinite(value) else None


def change_rows(change: SceneChange, names: tuple[str, str], origin: np.ndarray) -> dict:
    """All as JSON has it."""
    found = change.registration
    a_from_b = np.eye(4)
    a_from_b[:3, :3] = found.a_from_b.scale * found.a_from_b.rotation
    a_from_b[:3, 3] = found.a_from_b.shift
    return {
        "before": names[0],
        "after": names[1],
        "compared": list(change.compared),
        "registration": {
            "how": found.how,
            "residual_cm": finite(100 * found.residual_m, 3),
            "shared": round(found.shared, 3),
            "a_from_b": a_from_b.round(6).tolist(),
        },
        "settings": {k: finite(v, 5) for k, v in vars(change.settings).items()},
        "overall": finite(change.overall, 2),
        "unit": change.unit,
        "places": [place_row(place, origin) for place in change.places],
    }


def csv_text(change: SceneChange, origin: np.ndarray) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(place_row(place, origin) for place in change.places)
    return text.getvalue()


def registration_words(change: SceneChange) -> str:
    """One sentence."""
    found = change.registration
    how = {
        "common": "Both lie in one world",
        "icp": f"B was moved by {100 * np.linalg.norm(found.a_from_b.shift):.1f} cm and turned by "
        f"{found.a_from_b.degrees:.2f} degrees",
        "features": f"B's world was found: scale {found.a_from_b.scale:.4g}, turn "
        f"{found.a_from_b.degrees:.1f} degrees",
    }[found.how]
    return (
        f"{how}; surfaces lie {100 * found.residual_m:.2f} cm apart (median), "
        f"{100 * found.shared:.0f} % of them together."
    )


def print_places(change: SceneChange, origin: np.ndarray) -> None:
    """The table on standard output."""
    from rich.table import Table
    from rich.text import Text

    from shapeshift.app.terminal import open_console

    console = open_console(stderr=False)
    console.print(Text(registration_words(change)), soft_wrap=True)
    if np.isfinite(change.overall):
        text = f"Overall {change.overall:+.1f} {change.unit} (median)."
        console.print(Text(text), soft_wrap=True)
    if not change.places:
        console.print(Text("No place changed."))
        return
    table = Table("", "place", "cm²", "size cm", "at m")
    for place in change.places:
        number, _, said = words(place).partition(" ")
        size = " x ".join(f"{100 * side:.0f}" for side in place.size)
        at = ", ".join(f"{c:.2f}" for c in place.centre + origin)
        table.add_row(*map(Text, (number, said, f"{1e4 * place.area_m2:.0f}", size, at)))
    console.print(table)


def check_folder(folder: Path, overwrite: bool) -> None:
    """Before any work.  Raises UsageError."""
    if folder.suffix.lower() in (".shift", ".ply", ".json", ".csv"):
        raise UsageError(
            f"--out is {folder}; a folder is written, with layers, lists and pictures in it: leave "
            f"the ending {folder.suffix} out."
        )
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"--out {folder} is a file; name a folder.")
    if folder.is_dir() and any(folder.iterdir()):
        if not (folder / JSON).is_file():
            raise UsageError(f"--out {folder} has other files in it; name a new folder.")
        if not overwrite:
            raise UsageError(f"--out {folder} exists; --overwrite replaces what it holds.")


def write_change(
    renderer: "Renderer",
    found: FoundChange,
    names: tuple[str, str],
    folder: Path,
    progress: Progress,
) -> None:
    """The folder: layers for the viewer with marks beside them, lists, a picture a place."""
    from shapeshift.app.drawing import make_folder, save_png

    origin = np.asarray(found.before.document.origin)
    make_folder(folder)
    for old in folder.glob("place_*.png"):
        old.unlink()
    places = found.change.places
    for i, place in enumerate(places[:MOST_PICTURES]):
        progress("drawing the places", i / len(places))
        picture = pictures_of(renderer, found, place)
        save_png(picture, folder / f"place_{place.number:03}_{place.kind}.png")
    progress("writing the layers", 0.0)
    write_layers(found, folder / LAYERS)
    write_marks_file(marks_of(found.change, origin), marks_path(folder / LAYERS))
    write_whole(folder / CSV, csv_text(found.change, origin).encode())
    text = json_text(change_rows(found.change, names, origin)) + "\n"
    write_whole(folder / JSON, text.encode())


def marks_of(change: SceneChange, origin: np.ndarray) -> MarksFile:
    """A box a place, in the world of A's file."""
    room = change.settings.cell_m
    marks = []
    for place in change.places[:MOST_PICTURES]:
        half = place.size / 2 + room
        mark = box_around(f"{place.number} {place.kind}", place.centre + origin, half)
        marks.append(replace(mark, note=words(place)))
    return MarksFile(marks=tuple(marks))
