"""Every case by name, and the table that a run writes: rows, resumed rows, pictures."""

import csv
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.app.drawing import save_png
from shapeshift.app.errors import UsageError
from shapeshift.app.stability_cases import eyes, life, motion, networks, places, popping, shapes
from shapeshift.app.stability_cases.finding import CaseFinding, Panel
from shapeshift.runtime_models.files.plain_text import one_line
from shapeshift.runtime_models.files.whole_file import write_whole

CASES = {
    "sweep": motion.sweep,
    "stale-orbit": motion.stale_orbit,
    "stale-yaw": motion.stale_yaw,
    "popping": popping.popping,
    "disparity": eyes.disparity,
    "canted": eyes.canted,
    "stereo": eyes.stereo,
    "far-origin": places.far_origin,
    "depth-range": places.depth_range,
    "inside": places.inside,
    "lenses": places.lenses,
    "random-eyes": places.random_eyes,
    "needles": shapes.needles,
    "faint-layers": shapes.faint,
    "limits": shapes.limits,
    "counts": shapes.counts,
    "crowd": shapes.crowd,
    "extrapolated-x": networks.extrapolated,
    "broken-heads": networks.broken_heads,
    "life": life.life,
}
COLUMNS = ("case", "figure", "measured", "bound", "verdict", "reason")
NAME = "stability.csv"
LONGEST_HEAD = 10_000  # letters of a line that says what was run
CAPTION = 18  # pixels
LEAST_PANEL = 320  # pixels across; smaller pictures are enlarged by whole numbers


@dataclass
class Table:
    """stability.csv in a folder: the command, what it was run on, then one row a figure."""

    folder: Path
    command: str
    subject: str  # scene, size, drawing: rows of another are not mixed with these
    rows: dict[str, list[tuple]]  # by case, in the order in which they were run

    @property
    def path(self) -> Path:
        return self.folder / NAME

    def add(self, case: str, findings: list[CaseFinding]) -> None:
        """Takes the rows of a case and writes the file anew, all or nothing."""
        self.rows[case] = [
            (case, f.figure, f"{f.measured:.5g}" if f.bound else "", f.bound, f.verdict, f.reason)
            for f in findings
        ]
        self.write()

    def failed(self, case: str) -> bool:
        return any(row[4] == "FAILS" for row in self.rows[case])

    def write(self) -> None:
        text = io.StringIO()
        print(f"# {self.command}", f"# {self.subject}", sep="\n", file=text)
        rows = csv.writer(text, lineterminator="\n")
        rows.writerow(COLUMNS)
        for case in CASES:
            rows.writerows(self.rows.get(case, []))
        write_whole(self.path, text.getvalue().encode("utf-8", "backslashreplace"))


def open_table(folder: Path, command: str, subject: str, overwrite: bool) -> Table:
    """The table of a folder with the rows of an earlier run on the same subject that held."""
    command, subject = (one_line(text, LONGEST_HEAD) for text in (command, subject))
    table = Table(folder, command, subject, {})
    if not table.path.exists() or overwrite:
        return table
    lines = table.path.read_text(encoding="utf-8", errors="replace").splitlines()
    if lines[1:2] != [f"# {subject}"] or lines[2:3] != [",".join(COLUMNS)]:
        raise UsageError(
            f"{table.path} is of another run ({lines[1].lstrip('# ') if lines[1:] else 'empty'}); "
            "choose another --out or add --overwrite."
        )
    for row in csv.reader(lines[3:]):
        if len(row) == len(COLUMNS) and row[0] in CASES:
            table.rows.setdefault(row[0], []).append(tuple(row))
    for case in [case for case in table.rows if table.failed(case)]:
        del table.rows[case]
    return table


def save_panels(panels: list[Panel], path: Path) -> None:
    """The panels side by side, each under its caption."""
    if panels:
        tallest = max(enlarged(panel.image).shape[0] for panel in panels)
        parts = [captioned(panel, tallest) for panel in panels]
        gap = np.full((len(parts[0]), 4, 3), 0.25)
        joined = [piece for part in parts for piece in (part, gap)][:-1]
        save_png(np.concatenate(joined, axis=1), path)


def enlarged(image: np.ndarray) -> np.ndarray:
    times = -(-LEAST_PANEL // image.shape[1])
    return np.repeat(np.repeat(image, times, axis=0), times, axis=1)


def captioned(panel: Panel, height: int) -> np.ndarray:
    """(height + CAPTION, W, 3) with broken pixels in magenta, which no palette holds."""
    from PIL import Image, ImageDraw

    image = np.array(enlarged(panel.image)[..., :3], np.float64)
    image[~np.isfinite(image).all(axis=2)] = (1, 0, 1)
    canvas = np.zeros((height + CAPTION, image.shape[1], 3))
    canvas[CAPTION : CAPTION + len(image)] = image
    strip = Image.new("RGB", (image.shape[1], CAPTION), (40, 40, 40))
    ImageDraw.Draw(strip).text((4, 3), one_line(panel.caption), fill=(235, 235, 235))
    canvas[:CAPTION] = np.asarray(strip) / 255
    return canvas
