"""A report of one view with all marks of the tool "Inspect": an HTML file, never over another."""

from pathlib import Path

from shapeshift.app.drawing import make_folder
from shapeshift.app.inspection.draw_values import MeasuredScene
from shapeshift.app.inspection.inspect_view import InspectedView, with_readings
from shapeshift.app.inspection.report import CAMERAS_ENDING, ReportHead, report_of
from shapeshift.app.inspection.report_pdf import write_report
from shapeshift.app.inspection.window.inspecting import Inspecting
from shapeshift.app.paths import file_name


def write_view_report(
    tool: Inspecting, measured: MeasuredScene, title: str, inspected: InspectedView, folder: Path
) -> Path:
    """title: of the scene.  Values are as the tool shows them: of surfaces, where it has their
    emissivity.  Raises ValueError, OSError.
    """
    report = report_of(
        ReportHead(f"{measured.stop.name}: {title}"), tool.source or Path(title), measured.stop,
        [with_readings(inspected, tool.file)], tool.file, tool.scale, tool.document.origin,
    )  # fmt: skip
    make_folder(folder)
    path = free_path(folder, file_name(title))
    write_report(report, path)
    return path


def free_path(folder: Path, name: str) -> Path:
    """A name that no report, nor its cameras, have yet."""
    number = 1
    while True:
        path = folder / f"{name} report {number}.html"
        if not path.exists() and not path.with_name(f"{path.stem}{CAMERAS_ENDING}").exists():
            return path
        number += 1
