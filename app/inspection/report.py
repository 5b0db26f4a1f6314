"""A report of an inspection: what is in it, and as one HTML file that loads nothing."""

import base64
import html
import io
import math
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path

import numpy as np

from shapeshift.app.inspection.inspect_view import COLUMNS, InspectedView, reading_row
from shapeshift.app.inspection.length_pictures import (
    LENGTH_COLUMNS,
    LENGTHS_WORDS,
    length_rows,
)
from shapeshift.app.inspection.outputs import summary_lines, three_pictures
from shapeshift.app.inspection.pictures import ColorScale, scale_ticks
from shapeshift.runtime_models.files.plain_text import json_text, one_line
from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.program import portable_program
from shapeshift.scene.cameras.camera_list import CameraList, moved
from shapeshift.scene.cameras.own_cameras import own_rows
from shapeshift.scene.inspection.mark_photos import photo_pixels
from shapeshift.scene.inspection.marks import Mark
from shapeshift.scene.inspection.marks_file import MarksFile
from shapeshift.scene.pose import View

CAMERAS_ENDING = ".camera.json"
THERMAL_TITLE = "Thermal inspection"
AS_PHOTOGRAPHED = "Values are apparent temperatures as the photos gave them"
CORRECTED = "Values are temperatures of surfaces, corrected as the settings say"
AS_IN_PHOTOS = "Values are as the photos gave them"
VALUES_WORDS = (
    ", read before the palette; -- where less than half of a pixel is covered; < and > at the ends "
    "of the range."
)
NO_ERROR = "The error of these values was not measured; --capture CAPTURE measures it."
TEXT_COLUMNS = ("mark", "length", "kind", "note", "this view")  # of tables; the others are figures
SMALL_PX = 480  # a mark's own photo is no wider
JUMP = 8.0  # times the usual step along a line: it goes from one surface to another
PROFILE_SIZE, PROFILE_EDGES = (640, 170), (56, 10, 10, 28)  # px; left, right, top, bottom
STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 1400px; padding: 0 1em;
  color: #1a1a1a; background: #fff; }
h1 { font-size: 1.6em; margin: 0 0 .2em; } h2 { font-size: 1.15em; margin: 1.6em 0 .5em; }
.row { display: flex; flex-wrap: wrap; gap: 10px; } figure { margin: 0; }
img { width: 100%; height: auto; display: block; } figcaption { font-size: .85em; color: #444; }
table { border-collapse: collapse; font-size: .9em; } td, th { padding: .25em .7em;
  border-bottom: 1px solid #ddd; text-align: left; } th { border-bottom: 2px solid #888; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
code { background: #f2f2f2; padding: .1em .3em; overflow-wrap: anywhere; }
svg { max-width: 100%; height: auto; } @media print { h2 { break-after: avoid; }
  figure, table, svg { break-inside: avoid; } }
"""


@dataclass(frozen=True)
class ReportHead:
    """What a person says about an inspection; "" is left out."""

    title: str
    date: str = ""  # "": today
    client: str = ""
    inspector: str = ""
    note: str = ""


@dataclass(frozen=True, eq=False)
class Profile:
    """A line's values along it."""

    name: str
    unit: str
    rows: np.ndarray  # (n, 2) metres, value; NaN where nothing is seen


@dataclass(frozen=True, eq=False)
class ReportView:
    """One view of a report."""

    title: str
    pictures: list[tuple[str, np.ndarray]]  # (title, (H, W, 3) display sRGB)
    rows: list[tuple[str, ...]]  # cells of COLUMNS
    notes: list[str]
    lines: list[str]
    profiles: list[Profile]
    photos: list[tuple[str, np.ndarray]] = field(default_factory=list)  # of marks, as pictures


@dataclass(frozen=True, eq=False)
class InspectionReport:
    """All that both forms of a report say."""

    head: ReportHead
    views: list[ReportView]
    settings: list[tuple[str, str]]
    error: str
    scene: str  # name of its file; a report goes to others, whose folders are their own
    stop: str  # or an x; "": as the scene opens
    cameras: str  # JSON, our own form, in the world of the scene's file
    lengths: list[tuple[str, ...]] = field(default_factory=list)  # cells of LENGTH_COLUMNS

    @property
    def lines(self) -> list[str]:
        """Under the title."""
        who = [("Client", self.head.client), ("Inspector", self.head.inspector)]
        day = self.head.date or date.today().isoformat()
        said = [f"Date: {day}", *(f"{name}: {text}" for name, text in who if text)]
        return [one_line(text) for text in (*said, f"Scene: {self.scene}")]

    def command(self, cameras_name: str) -> str:
        """What opens the scene where the first view is, in the folder where both files lie."""
        program = portable_program()
        scene, stop, cameras = map(shlex.quote, (self.scene, self.stop, cameras_name))
        at = f" --x {stop}" if self.stop else ""
        return f"{program} view {scene}{at} --camera {cameras}"


def report_of(
    head: ReportHead,
    scene: Path,
    stop: Stop,
    shown: Sequence[InspectedView],
    file: MarksFile,
    scale: ColorScale,
    origin: np.ndarray,
) -> InspectionReport:
    """The report of some views with their readings."""
    unit = stop.unit
    views = []
    for number, each in enumerate(shown):
        rows = [reading_row(reading, each.values, origin) for reading in each.readings]
        marks = [reading.mark for reading in each.readings]
        profiles = [
            Profile(reading.mark.name, unit, with_gaps(reading.profile))
            for reading in each.readings
            if reading.mark.kind == "line" and reading.samples
        ]
        title = f"View {number + 1}" if len(shown) > 1 else "View"
        notes = [f"{mark.name}: {mark.note}" for mark in marks if mark.note]
        own = [mark for mark in marks if mark.emissivity is not None]
        notes += [f"{mark.name}: emissivity {mark.emissivity:g}" for mark in own]
        notes += [
            f"{mark.name}: read {mark.laid.words()}, {camera_words(mark.laid.view, origin)}"
            for mark in marks
            if mark.laid is not None
        ]
        pictures = three_pictures(each, scale)
        photos = mark_photos(marks) if not number else []  # once, they are of no view
        lines = summary_lines(each)
        views.append(ReportView(title, pictures, rows, notes, lines, profiles, photos))
    error = NO_ERROR
    corrected = any(each.values.emission is not None for each in shown)
    if file.held_out is not None:
        of = "photographed values" if corrected else "values"
        error = f"Error of the {of} {file.held_out.words(unit, stop.digits)}."
    photographed = AS_IN_PHOTOS if stop.kind == "values" else AS_PHOTOGRAPHED
    error += f" {CORRECTED if corrected else photographed}{VALUES_WORDS}"
    names = tuple(view.title for view in views)
    cameras = cameras_text([each.values.view for each in shown], names, origin)
    settings = settings_rows(stop, scale, shown, origin)
    measured = shown[0].lengths if shown else ()
    if measured:
        error += f" {LENGTHS_WORDS}"
    return InspectionReport(
        head, views, settings, error, scene.name, stop.name, cameras, length_rows(measured)
    )


def usual_title(stop: Stop) -> str:
    """What a report of a stop is called where nobody says."""
    return f"{stop.name} inspection" if stop.kind == "values" else THERMAL_TITLE


def mark_photos(marks: Sequence[Mark]) -> list[tuple[str, np.ndarray]]:
    """(title, (H, W, 3)) of the marks' own photos that can be read."""
    found = [(mark, photo_pixels(mark.photo)) for mark in marks if mark.photo]
    return [
        (f"{mark.name}: {mark.note}" if mark.note else mark.name, pixels)
        for mark, pixels in found
        if pixels is not None
    ]


def settings_rows(
    stop: Stop, scale: ColorScale, shown: Sequence[InspectedView], origin: np.ndarray
) -> list[tuple[str, str]]:
    """(what, value) of everything that the figures depend on."""
    assert stop.value_range is not None  # measured_scene has seen to it
    low, high = stop.value_range
    unit = stop.unit
    level, span = (round(value, stop.digits) for value in (scale.level, scale.span))
    rows = [
        ("stop", stop.name),
        ("range of the photos", f"{low:g} to {high:g} {unit}".rstrip()),
        ("palette", scale.palette),
        ("level, span", f"{level:g}, {span:g} {unit}".rstrip()),
    ]
    emission = shown[0].values.emission
    if emission is not None:
        rows.append(("corrected for", emission.words(unit)))
    for name, share in shown[0].values.by_object.items():
        rows.append((f"emissivity of {name}", f"{share:g}"))
    for number, each in enumerate(shown):
        name = f"camera {number + 1}" if len(shown) > 1 else "camera"
        rows.append((name, camera_words(each.values.view, origin)))
    return rows


def camera_words(view: View, origin: np.ndarray) -> str:
    """Where a picture was taken, in the world of the scene's file."""
    eye = ", ".join(f"{c + 0.0:.3f}" for c in np.round(view.world_from_eye.position + origin, 3))
    down, up = view.tangents[2:]
    angle = math.degrees(math.atan(up) - math.atan(down))
    width, height = view.size
    return f"at {eye} m, {angle:.1f}° high, {width}x{height} pixels"


def cameras_text(seen: Sequence[View], names: tuple[str, ...], origin: np.ndarray) -> str:
    """Views as a file of cameras, in the world of the scene's file."""
    there = moved(list(seen), origin.tolist())
    return json_text(own_rows(CameraList(tuple(there), names, "report"))) + "\n"


def html_of(report: InspectionReport, cameras_name: str) -> str:
    """The whole file: no scripts, and a policy that lets nothing be loaded."""
    title = text_of(report.head.title)
    policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
    parts = [
        '<!doctype html><html lang="en"><head><meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{title}</title><style>{STYLE}</style></head><body><h1>{title}</h1>",
        "<p>" + "<br>".join(map(text_of, report.lines)) + "</p>",
    ]
    if report.head.note:
        parts.append(f"<p>{text_of(report.head.note)}</p>")
    for view in report.views:
        parts += html_of_view(view)
    if report.lengths:
        parts += html_table("Lengths", LENGTH_COLUMNS, report.lengths)
    parts.append("<h2>How right it is</h2>")
    parts.append(f"<p>{text_of(report.error)}</p>")
    parts.append("<h2>Settings</h2><table>")
    parts += [f"<tr><th>{text_of(a)}</th><td>{text_of(b)}</td></tr>" for a, b in report.settings]
    data = base64.b64encode(report.cameras.encode()).decode()
    link = f'<a download="{text_of(cameras_name)}" href="data:application/json;base64,{data}">'
    parts += [
        "</table><h2>Open it there</h2>",
        f"<p>With {link}{text_of(cameras_name)}</a>, from the folder of the scene:</p>",
        f"<p><code>{text_of(report.command(cameras_name))}</code></p></body></html>\n",
    ]
    return "\n".join(parts)


def html_of_view(view: ReportView) -> list[str]:
    """One view: pictures, table, sentences, profiles."""
    parts = [f"<h2>{text_of(view.title)}</h2>", *html_figures(view.pictures)]
    if view.rows:
        parts += html_table("Marks", COLUMNS, view.rows)
    parts += [f"<p>{text_of(note)}</p>" for note in view.notes]
    if view.photos:
        parts += html_figures(view.photos, SMALL_PX)
    parts.append("<p>" + "<br>".join(map(text_of, view.lines)) + "</p>")
    for profile in view.profiles:
        parts.append(f"<h2>Profile of {text_of(profile.name)}</h2>{profile_svg(profile)}")
    return parts


def html_figures(pictures: Sequence[tuple[str, np.ndarray]], most_px: int = 10_000) -> list[str]:
    """Pictures in a row, equally high, each with its title; most_px: none becomes wider."""
    parts = ['<div class="row">']
    for title, picture in pictures:
        data = base64.b64encode(png_bytes(picture)).decode()
        name = text_of(title)
        source = f'<img alt="{name}" src="data:image/png;base64,{data}">'
        wide = picture.shape[1] / picture.shape[0]
        flex = f"flex: {wide:.3f} 1 {240 * wide:.0f}px; max-width: {most_px}px"
        caption = f"<figcaption>{name}</figcaption>"
        parts.append(f'<figure style="{flex}">{source}{caption}</figure>')
    return [*parts, "</div>"]


def html_table(title: str, columns: Sequence[str], rows: Sequence[tuple[str, ...]]) -> list[str]:
    """A heading and a table; all but TEXT_COLUMNS are figures."""
    kinds = ["" if column in TEXT_COLUMNS else ' class="number"' for column in columns]
    head = "".join(f"<th{kind}>{name}</th>" for kind, name in zip(kinds, columns, strict=True))
    parts = [f"<h2>{title}</h2><table><tr>{head}</tr>"]
    for row in rows:
        cells = (f"<td{k}>{text_of(cell)}</td>" for k, cell in zip(kinds, row, strict=True))
        parts.append(f"<tr>{''.join(cells)}</tr>")
    return [*parts, "</table>"]


def text_of(text: str) -> str:
    """A text in HTML, whatever it holds."""
    return html.escape(one_line(text))


def png_bytes(picture: np.ndarray) -> bytes:
    """(H, W, 3) display sRGB as a PNG file."""
    from PIL import Image

    held = io.BytesIO()
    pixels = (np.clip(np.nan_to_num(picture), 0, 1) * 255 + 0.5).astype(np.uint8)
    Image.fromarray(pixels).save(held, format="PNG", optimize=True)
    return held.getvalue()


def profile_svg(profile: Profile) -> str:
    """The values along a line as a small drawing; gaps where nothing is seen."""
    (width, height), (left, right, top, bottom) = PROFILE_SIZE, PROFILE_EDGES
    way, values = profile.rows.T
    known = np.isfinite(values)
    low, high = float(values[known].min()), float(values[known].max())
    low, high = (low - 0.5, high + 0.5) if high - low < 1e-6 else (low, high)
    last = float(way[-1]) or 1.0
    x = left + way / last * (width - left - right)
    y = top + (high - values) / (high - low) * (height - top - bottom)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}" role="img" font-size="11" font-family="sans-serif">'
    ]
    for tick in scale_ticks(low, high, 5):
        at = top + (high - tick) / (high - low) * (height - top - bottom)
        parts.append(f'<path d="M{left} {at:.1f}H{width - right}" stroke="#ddd"/>')
        label = text_of(f"{tick:g} {profile.unit}".rstrip())
        parts.append(f'<text x="{left - 5}" y="{at + 4:.1f}" text-anchor="end">{label}</text>')
    for tick in scale_ticks(0.0, last, 8):
        at = left + tick / last * (width - left - right)
        parts.append(f'<text x="{at:.1f}" y="{height - 10}" text-anchor="middle">{tick:g} m</text>')
    for run in runs_of(known):
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x[run], y[run], strict=True))
        parts.append(
            f'<polyline points="{points}" fill="none" stroke="#b03020" stroke-width="1.5"/>'
        )
    return "".join([*parts, "</svg>"])


def with_gaps(profile: np.ndarray) -> np.ndarray:
    """A profile (n, 2) with a row of NaN wherever its line jumps from one surface to another."""
    steps = np.diff(profile[:, 0])
    jumps = np.flatnonzero(steps > JUMP * np.median(steps)) + 1
    between = (profile[jumps - 1, 0] + profile[jumps, 0]) / 2
    rows = np.stack([between, np.full(len(jumps), np.nan)], axis=1)
    return np.insert(profile, jumps, rows, axis=0)


def runs_of(known: np.ndarray) -> list[slice]:
    """Where a row (n,) of bool is True without a gap."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(int)))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
