"""What the command change prints and writes: a table, JSON, CSV, marks, pictures, layers."""

import csv
import io
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.change.draw_visits import Progress, see
from shapeshift.app.change.find_change import FoundChange, SceneChange
from shapeshift.app.change.layers import write_layers
from shapeshift.app.commands.compared import written
from shapeshift.app.errors import UsageError
from shapeshift.app.inspection.pictures import ColorScale, with_scale_bar
from shapeshift.renderer.colors.palette import LUMINANCE, palette_values
from shapeshift.runtime_models.files.plain_text import json_text
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.scene.cameras.framing import view_from
from shapeshift.scene.change.places import HEAT_WORDS, VALUE_WORDS, ChangedPlace
from shapeshift.scene.change.seen import SeenVisit
from shapeshift.scene.inspection.marks import box_around
from shapeshift.scene.inspection.marks_file import MarksFile, marks_path, write_marks_file
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.pose import View

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
        "judged": [round(part, 3) for part in change.judged],
        "overall": finite(change.overall, 2),
        "unit": change.unit,
        "places": [place_row(place, origin) for place in change.places],
    }


def csv_text(change: SceneChange, origin: np.ndarray) -> str:
    text = io.StringIO()
    writer: csv.DictWriter[str] = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(place_row(place, origin) for place in change.places)
    return text.getvalue()


def registration_words(change: SceneChange) -> str:
    """One sentence."""
    found = change.registration
    first, second = (100 * part for part in change.judged)
    how = {
        "common": "Both lie in one world",
        "icp": f"B was moved by {100 * np.linalg.norm(found.a_from_b.shift):.1f} cm and turned by "
        f"{found.a_from_b.degrees:.2f} degrees",
        "features": f"B's world was found: scale {found.a_from_b.scale:.4g}, turn "
        f"{found.a_from_b.degrees:.1f} degrees",
    }[found.how]
    return (
        f"{how}; surfaces lie {100 * found.residual_m:.2f} cm apart (median), "
        f"{100 * found.shared:.0f} % of them together. Photos of both show {first:.0f} % of A's "
        f"surface and {second:.0f} % of B's; the rest is not judged."
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


# Pictures of places that changed: before, after, and what of it changed.

COLORS = {"moved": (1.0, 0.85, 0.1), "appeared": (0.2, 0.85, 0.3), "vanished": (1.0, 0.2, 0.5),
          "hotter": (1.0, 0.45, 0.05), "colder": (0.15, 0.5, 1.0),
          "higher": (1.0, 0.45, 0.05), "lower": (0.15, 0.5, 1.0),
          "recoloured": (0.75, 0.4, 1.0)}  # fmt: skip
FIELD = 3.0  # times the place's own size that a picture shows
LEAST_FIELD = 0.35  # of the scene's radius
FOV_Y = 0.6  # radians
SIZE = (320, 240)
SHARE = 0.65  # of the kind's colour over the picture
NOTHING = 0.16  # grey where nothing is known


def words(place: ChangedPlace) -> str:
    """Such as "3 hotter by 17.2 °C, now 58.3"."""
    said = f"{place.number} {place.kind}"
    if place.kind == "moved":
        return f"{said} by {100 * place.amount:.1f} cm"
    if place.kind in HEAT_WORDS:
        return f"{said} by {abs(place.amount):.1f} {place.unit}, now {place.level:.1f}"
    if place.kind in VALUE_WORDS:
        amount = f"{abs(place.amount):.3g} {place.unit}".rstrip()
        return f"{said} by {amount}, now {place.level:.3g}"
    if place.kind == "recoloured":
        return f"{said} by {place.amount:.0f} (Lab)"
    return said


def pictures_of(renderer: "Renderer", found: FoundChange, place: ChangedPlace) -> np.ndarray:
    """(H, 3 W, 3) before, after and the place marked, from the side that shows most of it."""
    view = best_view(found, place)
    both = draw_both(renderer, found, view)
    heat = place.kind in (*HEAT_WORDS, *VALUE_WORDS)
    sides = [visit.sides[0] for visit in both]
    pictures = [np.where(s.coverage[..., None] >= 0.5, s.color, NOTHING) for s in sides]
    scale = None
    if heat and found.before.measured is not None:
        values = [side.value for side in sides if side.value is not None]
        low, high = np.nanpercentile(np.concatenate([v.ravel() for v in values]), (1, 99.5))
        least = 1 if place.kind in HEAT_WORDS else found.change.settings.least_value
        stop = found.before.measured.stop
        scale = ColorScale(float(low), float(max(high, low + least)), stop.palette)
        pictures = [heat_colors(value, scale) for value in values]
    last = marked(both, place, found.change.settings.cell_m)
    pictures = [written(pictures[0], "before"), written(pictures[1], "after")]
    if scale is not None:
        pictures[1] = with_scale_bar(pictures[1], scale, place.unit)
    return np.concatenate([*pictures, written(last, words(place))], axis=1)


def draw_both(renderer: "Renderer", found: FoundChange, view: View) -> tuple[SeenVisit, SeenVisit]:
    """Both visits in one view of A's world."""
    silent: Progress = lambda what, part: None  # noqa: E731
    before, after = (
        see(renderer, visit, ([a.view_in_b(view)], False), a, True, "", silent)
        for visit, a in zip((found.before, found.after), (s.a_from_own for s in found.seen),
                            strict=True)
    )  # fmt: skip
    return before, after


def heat_colors(value: np.ndarray, scale: ColorScale) -> np.ndarray:
    """(H, W, 3) of values (H, W)."""
    share = (value - scale.low) / scale.span
    colors = palette_values(np.nan_to_num(share), scale.palette)
    return np.where(np.isfinite(value)[..., None], colors, NOTHING)


def best_view(found: FoundChange, place: ChangedPlace) -> View:
    """A close look at a place from the direction that shows most of it."""
    shows = [
        (int(part.sum()), number, i)
        for number, points in enumerate(shown_by(place))
        for i, part in enumerate(sees(found.seen[number], points))
    ]
    _, number, best = max(shows, key=lambda one: one[0])
    visit = found.seen[number]
    seen_from = visit.a_from_own.inverse.view_in_b(visit.views[best])
    every = np.concatenate([place.points, place.before])
    low, high = every.min(axis=0), every.max(axis=0)
    radius = found.before.document.bounds()[1]
    field = max(FIELD * float(np.linalg.norm(high - low)) / 2, LEAST_FIELD * radius / 2)
    way = seen_from.world_from_eye.position - (low + high) / 2
    distance = min(field / np.tan(FOV_Y / 2), float(np.linalg.norm(way)))
    eye = (low + high) / 2 + way / np.linalg.norm(way) * distance
    return view_from(eye, (low + high) / 2, radius, SIZE, FOV_Y)


def shown_by(place: ChangedPlace) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) and (m, 3): what of a place the earlier visit shows, and the later one."""
    if place.kind == "vanished":
        return place.points, np.zeros((0, 3))
    return place.before, place.points


def sees(visit: SeenVisit, points: np.ndarray) -> list[np.ndarray]:
    """(n,) bool of each view: which points (n, 3), A's metres, it shows."""
    own = visit.a_from_own.inverse.apply(points)
    pairs = zip(visit.views, visit.sides, strict=True)
    return [ValuePicture(view, s.depth_m, s.depth_m, "m").sees(own) for view, s in pairs]


def marked(both: tuple[SeenVisit, SeenVisit], place: ChangedPlace, cell_m: float) -> np.ndarray:
    """(H, W, 3) the later visit in grey with the place in its kind's colour; where something
    was, that stands in it too.  both: visits that have one view.
    """
    from scipy.spatial import cKDTree

    after = both[1].sides[0]
    later = after.color @ LUMINANCE
    out = np.where(after.coverage >= 0.5, 0.75 * later, NOTHING)[..., None].repeat(3, axis=2)
    color = np.array(COLORS[place.kind])
    for visit, points, strength in zip(both, shown_by(place), (0.5, 1.0), strict=True):
        if not len(points):
            continue
        side, flat = visit.sides[0], visit.a_from_own.apply(visit.points(0))
        known = np.isfinite(flat).all(axis=2)
        inside = np.zeros(known.shape, bool)
        inside[known] = cKDTree(points).query(flat[known])[0] <= 1.2 * cell_m
        below = (side.color @ LUMINANCE)[..., None]
        mixed = SHARE * color * strength + (1 - SHARE) * below
        out = np.where(inside[..., None], mixed, out)
    return out
