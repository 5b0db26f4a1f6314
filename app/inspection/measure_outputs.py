"""What the command measure leaves: lengths in the file of marks, and reports."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.errors import UsageError
from shapeshift.app.inspection.inspect_view import length_words
from shapeshift.app.inspection.length_report import SeenLengths, length_report
from shapeshift.app.inspection.report_pdf import write_report
from shapeshift.app.paths import full, is_bundled
from shapeshift.app.terminal import say
from shapeshift.scene.inspection.length_marks import LengthMark, free_length_name, length_of
from shapeshift.scene.inspection.lengths import Point, Scale
from shapeshift.scene.inspection.marks_file import (
    MarksFile,
    marks_path,
    moved_marks,
    read_marks_file,
    write_marks_file,
)
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from shapeshift.app.document import Document
    from shapeshift.renderer.renderer import Renderer

ENDINGS = (".html", ".pdf")
LEAST_SCALE, MOST_SCALE = 1e-6, 1e6


def check_reports(paths: tuple[Path, ...], overwrite: bool) -> None:
    """Before the scene is read.  Raises UsageError, one sentence."""
    for path in paths:
        if path.suffix.lower() not in ENDINGS:
            raise UsageError(f"--report is {path}; a file {' or '.join(ENDINGS)} is wanted.")
        if path.exists() and not overwrite:
            raise UsageError(f"{path} exists; name another file or add --overwrite.")


def kept_lengths(scene: Path, origin: np.ndarray) -> MarksFile:
    """The marks beside a scene, in the world of the document.  Raises BadFile."""
    path = marks_path(scene)
    file = read_marks_file(path) if path.exists() else MarksFile()
    return moved_marks(file, -origin)


def with_lengths_of(
    file: MarksFile, laid: list[tuple[str, list[Point]]], scale: Scale
) -> MarksFile:
    """The file with what was measured now, (kind, points) each, under names of its own."""
    lengths: list[LengthMark] = list(file.lengths)
    for kind, points in laid:
        name = free_length_name(kind, [each.name for each in lengths])
        lengths.append(length_of(name, kind, points))
    error = min(scale.error, 1.0)
    return replace(file, lengths=tuple(lengths), metres_per_unit=scale.factor, scale_error=error)


def keep_file(
    scene: Path, file: MarksFile, origin: np.ndarray, hear: Callable[[str], object] = say
) -> None:
    """Writes it beside the scene; hear: told where.  Raises UsageError."""
    path, scale = marks_path(scene), file.metres_per_unit
    if is_bundled(path):
        raise UsageError(f"{scene.name} came with the program; copy it into a folder of yours.")
    if not LEAST_SCALE <= scale <= MOST_SCALE:
        raise UsageError(f"the scale is {scale:g}, expected 1e-6 to 1e6; check --known.")
    write_marks_file(moved_marks(file, origin), path)
    more = f", scale {scale:.6g}" if scale != 1 else ""
    hear(f"{len(file.lengths)} lengths{more} kept in {full(path)}")


def picture_of(renderer: "Renderer", document: "Document", view: View) -> np.ndarray:
    """(H, W, 3) display sRGB of a view before the document's background."""
    renderer.settings = replace(renderer.settings, background=document.background)
    renderer.update(document.scene)
    renderer.draw([view])
    return renderer.resolved(0).copy()


def write_length_reports(
    paths: tuple[Path, ...], scene: Path, picture: np.ndarray, view: View, file: MarksFile,
    unit: str, origin: np.ndarray, x: str, hear: Callable[[str], object] = say,
) -> None:  # fmt: skip
    """All lengths of a file in one view, as HTML or PDF; hear: told where.  Raises UsageError."""
    from shapeshift.app.drawing import make_folder

    seen = SeenLengths(picture, view, length_words(file, unit), file.scale)
    try:
        report = length_report(scene.stem, scene.name, seen, origin, x)
    except ValueError as error:
        raise UsageError(str(error)) from None
    for path in paths:
        make_folder(path.parent)
        write_report(report, path)
        hear(f"written to {full(path)}")
