"""What the command thermal prints and writes: tables, a picture, CSV."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from shapeshift.app.inspection.draw_values import MeasuredScene
from shapeshift.app.inspection.inspect_view import (
    COLUMNS,
    HERE,
    InspectedView,
    csv_text,
    profile_csv,
    reading_row,
)
from shapeshift.app.inspection.length_pictures import with_lengths
from shapeshift.app.inspection.pictures import (
    ColorScale,
    alarm_picture,
    heat_picture,
    with_marks,
    with_scale_bar,
)
from shapeshift.app.paths import file_name, full
from shapeshift.app.terminal import open_console, say
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.scene.inspection.emissivity import Emission
from shapeshift.scene.inspection.marks_file import MarksFile
from shapeshift.scene.inspection.value_picture import ValuePicture

BETWEEN_PX = 8  # of pictures side by side


def print_readings(
    shown: Sequence[InspectedView], file: MarksFile, measured: MeasuredScene, origin: np.ndarray
) -> None:
    """Tables on standard output."""
    from rich.table import Table
    from rich.text import Text

    console = open_console(stderr=False)
    unit = measured.stop.unit
    for number, each in enumerate(shown):
        rows = [reading_row(reading, each.values, origin) for reading in each.readings]
        shown_columns = [n for n, name in enumerate(COLUMNS)
                         if name != HERE or any(row[n] for row in rows)]  # fmt: skip
        table = Table()
        for n in shown_columns:  # a place is to be typed again
            table.add_column(COLUMNS[n], overflow="fold" if COLUMNS[n] == "place" else "ellipsis")
        for row in rows:
            table.add_row(*(Text(row[n]) for n in shown_columns))
        if len(shown) > 1:
            console.print(Text(f"view {number}"))
        if each.readings:
            console.print(table)
        for line in summary_lines(each):
            console.print(Text(line), soft_wrap=True)
    if file.held_out is not None:
        console.print(
            Text(f"error: {file.held_out.words(unit, measured.stop.digits)}"), soft_wrap=True
        )
    else:
        say("The error of these values is not known; --capture CAPTURE measures it.")


def correction_line(values: ValuePicture, emission: Emission) -> str:
    """By what values were corrected, and what that makes of an error of the photos."""
    line = f"temperatures of surfaces: {emission.words(values.unit)}"
    before = values.photographed
    if before is None or not values.known.any():
        return line
    grown = emission.growth(float(np.mean(before[values.known])), values.unit)
    return f"{line}; an error of the photos counts {grown:.2f} times at their mean"


def summary_lines(inspected: InspectedView) -> list[str]:
    """Differences, isotherms and the hottest place of a view."""
    values = inspected.values
    lines = [f"{a} less {b}: {values.text(value)}" for a, b, value in inspected.differences]
    for each in inspected.isotherms:
        least = f"{each.least:.{values.digits}f}"
        ends = f", {least} to {values.text(each.most)}" if each.share else ""
        words = each.isotherm.words(values.unit)
        lines.append(f"{words}: {100 * each.share:.2f} % of what is seen{ends}")
    if values.known.any():
        word = "hottest" if values.is_heat else "highest"
        lines.append(f"{word}: {place_line(values, *values.hottest())}")
        if not values.is_heat:
            lines.append(f"lowest: {place_line(values, *values.lowest())}")
    else:
        lines.append("nothing is covered by a half in this view")
    if values.emission is not None:
        lines.append(correction_line(values, values.emission))
    if values.off_palette is not None:
        lines.append(
            f"looked up in a palette: 95 of 100 pixels are {values.off_palette:.3f} or less (sRGB, "
            "0 to 1.7) away from its colours"
        )
    return lines


def place_line(values: ValuePicture, pixel: tuple[float, float], value: float) -> str:
    """A pixel's value, with its emissivity where that is its own."""
    line = f"{values.text(value, values.ends_at(pixel))} at pixel {pixel[0]:g},{pixel[1]:g}"
    share, emission = values.emissivity_at(pixel), values.emission
    if share is None or emission is None or share == emission.surface.emissivity:
        return line
    return f"{line}, of emissivity {share:g}"


def three_pictures(inspected: InspectedView, scale: ColorScale) -> list[tuple[str, np.ndarray]]:
    """(title, (H, W, 3)) of the photo, the heat with marks and scale bar, and the alarms."""
    values = inspected.values
    heat = heat_picture(values, scale)
    marked = with_marks(heat, values, inspected.readings)
    unit = values.unit
    name = "Thermal" if values.is_heat else inspected.stop_name
    title = f"{name}, level {scale.level:.4g}, span {scale.span:.4g} {unit}".rstrip()
    pictures = [(title, with_scale_bar(marked, scale, unit))]
    if inspected.photo is not None:
        photo = with_lengths(np.clip(inspected.photo, 0, 1), values.view, inspected.lengths)
        pictures.insert(0, (f"Photo ({inspected.photo_name})", photo))
    if inspected.isotherms:
        below = heat if inspected.photo is None else inspected.photo
        alarms = alarm_picture(below, values, [each.isotherm for each in inspected.isotherms])
        words = ", ".join(each.isotherm.words(unit) for each in inspected.isotherms)
        pictures.append((f"Alarms: {words}", with_marks(alarms, values, inspected.readings)))
    return pictures


def write_picture(
    path: Path, shown: Sequence[InspectedView], scale: ColorScale, hear: Callable[[str], object]
) -> None:
    """The pictures of every view, a row each, as one PNG; hear: told where it is."""
    from shapeshift.app.drawing import make_folder, save_png

    make_folder(path.parent)
    rows = []
    for each in shown:
        pictures = [picture for _, picture in three_pictures(each, scale)]
        gap = np.zeros((pictures[0].shape[0], BETWEEN_PX, 3), np.float32)
        parts = [part for picture in pictures for part in (gap, picture)][1:]
        rows.append(np.concatenate(parts, axis=1))
    save_png(stacked(rows), path)
    hear(f"written to {full(path)}")


def write_tables(
    path: Path, shown: Sequence[InspectedView], origin: np.ndarray, hear: Callable[[str], object]
) -> None:
    """All readings as CSV, and the profile of every line, as the first view sees it, beside it;
    hear: told where they are.
    """
    from shapeshift.app.drawing import make_folder

    make_folder(path.parent)
    write_whole(path, csv_text(shown, origin).encode())
    for reading in shown[0].readings:
        if reading.mark.kind == "line":
            name = f"{path.stem}.{file_name(reading.mark.name)}.csv"
            text = profile_csv(reading, shown[0].values.unit, shown[0].values.digits)
            write_whole(path.with_name(name), text.encode())
    hear(f"written to {full(path)}")


def stacked(rows: Sequence[np.ndarray]) -> np.ndarray:
    """Pictures of several widths below each other."""
    width = max(row.shape[1] for row in rows)
    return np.concatenate(
        [np.pad(row, ((0, 0), (0, width - row.shape[1]), (0, 0))) for row in rows]
    )
