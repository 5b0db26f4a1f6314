"""Reports on disk; as PDF they are A4 pages by matplotlib, letters and lines as vectors."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shapeshift.app.inspection.inspect_view import COLUMNS
from shapeshift.app.inspection.report import (
    CAMERAS_ENDING,
    InspectionReport,
    ReportView,
    html_of,
)
from shapeshift.renderer.debug.letters import drawable
from shapeshift.runtime_models.files.plain_text import one_line
from shapeshift.runtime_models.files.whole_file import whole_file, write_whole

if TYPE_CHECKING:
    from matplotlib.backends.backend_pdf import PdfPages
    from matplotlib.figure import Figure

A4 = (8.27, 11.69)  # inches
LEFT, RIGHT, TOP, BOTTOM = 0.08, 0.92, 0.955, 0.05  # of the page
LINE = 0.0155  # of the page, from one line of text to the next
LETTERS = 8.5  # points
WIDEST = 112  # letters of a line
ROWS = 44  # of marks under one head
COLUMN_STARTS = (0.0, 0.14, 0.21, 0.30, 0.39, 0.48, 0.61, 0.69, 0.78)  # of the text's width
SHORTEST = 15  # letters of a name in the table
BETWEEN = 0.02  # of the page, from one picture to the next
TALLEST = 0.24  # of the page: a picture
SMALLER = 0.14  # of the page: a mark's own photo
PHOTOS_A_ROW = 2


class ReportPages:
    """Pages that are filled from the top."""

    def __init__(self, held: "PdfPages") -> None:
        self._held = held
        self._figure: Figure | None = None
        self.y = 0.0  # of the page, where the next thing goes

    def begin(self) -> "Figure":
        """A new page; the one before is written."""
        from matplotlib.figure import Figure

        self.end()
        self._figure, self.y = Figure(figsize=A4), TOP
        return self._figure

    def end(self) -> None:
        """Writes the page."""
        held = self._held
        if self._figure is not None:
            self._figure.savefig(held, format="pdf")  # type: ignore[arg-type]  # PdfPages, too
        self._figure = None

    def room(self, part: float) -> "Figure":
        """The page that has so much left, a new one if need be."""
        if self._figure is None or self.y - part < BOTTOM:
            return self.begin()
        return self._figure

    def line(self, text: str, size: float = LETTERS, weight: str = "normal") -> None:
        """A line of text, broken where it is too long."""
        import textwrap

        for part in textwrap.wrap(drawable(text, 16), int(WIDEST * LETTERS / size)) or [""]:
            step = LINE * size / LETTERS
            figure = self.room(step)
            figure.text(LEFT, self.y, part, size=size, weight=weight, va="top")
            self.y -= step

    def gap(self, part: float = LINE) -> None:
        self.y -= part


def write_report(report: InspectionReport, path: Path) -> Path:
    """Writes a .html or a .pdf, and its cameras beside it; gives the cameras' path."""
    cameras = path.with_name(f"{path.stem}{CAMERAS_ENDING}")
    if path.suffix.lower() == ".pdf":
        write_pdf(report, cameras.name, path)
    else:
        write_whole(path, html_of(report, cameras.name).encode())
    write_whole(cameras, report.cameras.encode())
    return cameras


def write_pdf(report: InspectionReport, cameras_name: str, path: Path) -> None:
    """The report as a file, whole or not at all; the same bytes for the same report."""
    import matplotlib
    from matplotlib.backends.backend_pdf import PdfPages

    about: dict[str, Any] = {"Title": one_line(report.head.title), "CreationDate": None}
    with (
        whole_file(path) as file,
        matplotlib.rc_context(
            {"text.parse_math": False, "pdf.fonttype": 42, "font.family": ["DejaVu Sans"]}
        ),
    ):
        with PdfPages(file, metadata=about | {"Creator": "Shapeshift"}) as held:
            pages = ReportPages(held)
            for number, view in enumerate(report.views):
                pages.begin()
                if not number:
                    write_head(report, pages)
                write_view(view, pages)
            write_lengths(report, pages)
            write_end(report, cameras_name, pages)
            pages.end()


def write_head(report: InspectionReport, pages: ReportPages) -> None:
    pages.line(report.head.title, 15, "bold")
    for line in report.lines:
        pages.line(line)
    if report.head.note:
        pages.gap(LINE / 2)
        pages.line(report.head.note)
    pages.gap()


def write_view(view: ReportView, pages: ReportPages) -> None:
    """Pictures, the table over as many pages as it takes, sentences, profiles."""
    pages.line(view.title, 11, "bold")
    write_pictures(view.pictures, pages)
    if view.rows:
        pages.room(LINE * min(len(view.rows) + 4, 8))  # its heading stands on no page alone
        pages.line("Marks", 11, "bold")
    for first in range(0, len(view.rows), ROWS):
        write_table(view.rows[first : first + ROWS], pages)
    for line in (*view.lines, *view.notes):
        pages.line(line)
    pages.gap()
    for first in range(0, len(view.photos), PHOTOS_A_ROW):
        write_pictures(view.photos[first : first + PHOTOS_A_ROW], pages, SMALLER)
    for profile in view.profiles:
        height = 0.11
        figure = pages.room(height + 0.06)
        pages.line(f"Profile of {profile.name}", 9.5, "bold")
        pages.gap(0.006)
        axes = figure.add_axes((LEFT + 0.05, pages.y - height, RIGHT - LEFT - 0.05, height))
        axes.plot(profile.rows[:, 0], profile.rows[:, 1], color="#b03020", linewidth=1.0)
        axes.set_ylabel(drawable(profile.unit, 16), size=7)
        axes.set_xlabel("m", size=7)
        axes.tick_params(labelsize=7)
        axes.grid(color="#dddddd", linewidth=0.5)
        pages.y -= height + 0.045


def write_pictures(
    pictures: Sequence[tuple[str, np.ndarray]], pages: ReportPages, tallest: float = TALLEST
) -> None:
    """Two in a row, equally high; a third below."""
    for first in range(0, len(pictures), 2):
        pair = pictures[first : first + 2]
        shapes = [picture.shape[1] / picture.shape[0] for _, picture in pair]
        most = RIGHT - LEFT - BETWEEN * (len(pair) - 1)
        tall = min(most * A4[0] / sum(shapes), tallest * A4[1]) / A4[1]  # of the page
        figure = pages.room(tall + 0.03)
        left = LEFT
        for (title, picture), shape in zip(pair, shapes, strict=True):
            wide = tall * A4[1] * shape / A4[0]
            axes = figure.add_axes((left, pages.y - tall, wide, tall))
            axes.imshow(np.clip(picture, 0, 1), aspect="auto", interpolation="antialiased")
            axes.axis("off")
            text = drawable(title, 16)
            figure.text(left, pages.y - tall - 0.004, text, size=7.5, va="top", color="#444444")
            left += wide + BETWEEN
        pages.y -= tall + 0.028


def write_table(rows: Sequence[tuple[str, ...]], pages: ReportPages) -> None:
    """Marks and what they read."""
    pages.room(LINE * min(len(rows) + 2, 6))
    write_row(COLUMNS, pages, "bold")
    for row in rows:
        name = row[0] if len(row[0]) <= SHORTEST else f"{row[0][: SHORTEST - 1]}…"
        write_row((name, *row[1:]), pages)
    pages.gap()


def write_lengths(report: InspectionReport, pages: ReportPages) -> None:
    """The table of what was measured."""
    if not report.lengths:
        return
    pages.room(LINE * min(len(report.lengths) + 3, 8))
    pages.line("Lengths", 11, "bold")
    for name, kind, value, note in report.lengths:
        pages.line(f"{name} ({kind}): {value}{f'. {note}' if note else ''}")
    pages.gap()


def write_row(cells: Sequence[str], pages: ReportPages, weight: str = "normal") -> None:
    figure = pages.room(LINE)
    for start, cell in zip(COLUMN_STARTS, cells, strict=True):
        left = LEFT + start * (RIGHT - LEFT)
        figure.text(left, pages.y, drawable(cell, 16), size=7.5, va="top", weight=weight)
    pages.y -= LINE


def write_end(report: InspectionReport, cameras_name: str, pages: ReportPages) -> None:
    """How right it is, the settings, the way back into the scene."""
    pages.room(LINE * (len(report.settings) + 10))
    pages.line("How right it is", 11, "bold")
    pages.line(report.error)
    pages.gap()
    pages.line("Settings", 11, "bold")
    for name, value in report.settings:
        pages.line(f"{name}: {value}")
    pages.gap()
    pages.line("Open it there", 11, "bold")
    pages.line(f"With {cameras_name}, from the folder of the scene:")
    pages.line(report.command(cameras_name))
