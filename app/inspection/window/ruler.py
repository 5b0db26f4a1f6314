"""The tool "Measure": lengths, angles and areas between points on surfaces; no GL, no imgui.

What is measured lies with the marks of the tool "Inspect", in the same file, and is undone with it.
"""

from dataclasses import replace

import numpy as np

from shapeshift.app.editor.texts.table import said
from shapeshift.app.inspection.window.inspecting import Inspecting
from shapeshift.runtime_models.files.plain_text import name_line
from shapeshift.scene.inspection.length_marks import (
    MOST_CORNERS,
    MOST_LENGTHS,
    LengthMark,
    free_length_name,
    length_of,
)
from shapeshift.scene.inspection.lengths import KINDS, UNITS, Measurement, Point, Scale, measure
from shapeshift.scene.inspection.marks_file import MarksFile
from shapeshift.scene.inspection.value_picture import ValuePicture

SCALES = (1e-6, 1e6)  # what lengths may be multiplied by


class Ruler:
    """What is being measured, and what was.  `picture` has the depths of the view."""

    def __init__(self, inspecting: Inspecting) -> None:
        self._inspecting = inspecting
        self.on = False
        self.kind = "distance"  # that clicks lay, of lengths.KINDS
        self.points: list[Point] = []  # of what is being laid
        self.chosen = ""  # name; "": none
        self.picture: ValuePicture | None = None
        self.pointed: np.ndarray | None = None  # (3,) metres under the mouse; None: nothing is
        self._measured: tuple[MarksFile | None, dict[str, Measurement]] = (None, {})

    def opened(self) -> None:
        """Another scene."""
        self.on, self.points, self.chosen = False, [], ""
        self.picture = self.pointed = None

    @property
    def lengths(self) -> tuple[LengthMark, ...]:
        return self._inspecting.file.lengths

    @property
    def scale(self) -> Scale:
        return self._inspecting.file.scale

    def toggle(self) -> None:
        self.on, self.points = not self.on, []

    def choose_kind(self, kind: str) -> None:
        self.kind, self.points = kind, []

    def pick(self, pixel: tuple[float, float]) -> None:
        """A point on the surface under a pixel (column, row) of the picture."""
        if self.picture is None:
            return
        point = self.picture.picked(pixel)
        if not np.isfinite(point.metres).all():
            self._inspecting.note(said("Nothing is there that covers half of the ray."))
            return
        if len(self.points) < MOST_CORNERS:
            self.points.append(point)
        if len(self.points) == KINDS[self.kind][2]:
            self.finish()

    def finish(self) -> None:
        """What was laid is kept, if it has points enough; else nothing is."""
        points, self.points = self.points, []
        if len(points) < KINDS[self.kind][1]:
            return
        names = [each.name for each in self.lengths]
        if len(names) >= MOST_LENGTHS:
            words = said("{count} lengths are the most that fit one file.", count=MOST_LENGTHS)
            self._inspecting.note(words)
            return
        made = length_of(free_length_name(self.kind, names), self.kind, points)
        self.chosen = made.name
        self._keep((*self.lengths, made), f"add {made.name}")

    def undo(self) -> bool:
        """The last point; False: there is none, and the last edit of all is meant."""
        if not self.points:
            return False
        self.points.pop()
        return True

    def delete(self, name: str) -> None:
        self.chosen = ""
        self._keep(tuple(each for each in self.lengths if each.name != name), f"delete {name}")

    def name_length(self, name: str, text: str) -> bool:
        """False where the text is no name, or another one's."""
        text = text.strip()
        if not text or text != name_line(text) or text in (each.name for each in self.lengths):
            return False
        self.chosen = text
        found = self._named(name)
        self._change(found, text, found.note)
        return True

    def write_note(self, name: str, text: str) -> None:
        self._change(self._named(name), name, name_line(text.strip()) if text.strip() else "")

    def know(self, name: str, metres: float) -> bool:
        """All lengths are scaled so that this distance is what it is known to be; False: it cannot
        be, and the person has been told.
        """
        found = self._named(name)
        pairs = zip(found.points, found.covariances, strict=True)
        try:
            scale = Scale.of_known([Point(p, spread) for p, spread in pairs], metres)
        except ValueError as error:
            self._inspecting.note(str(error))
            return False
        if not SCALES[0] <= scale.factor <= SCALES[1]:
            self._inspecting.note(said("No scene is that large, or that small."))
            return False
        self._rescale(scale)
        return True

    def forget_scale(self) -> None:
        """Lengths are the scene's own again."""
        self._rescale(Scale())

    def measured(self, each: LengthMark) -> Measurement:
        """Its value, reckoned once: the overlay asks in every frame."""
        if self._measured[0] is not self._inspecting.file:
            self._measured = (self._inspecting.file, {})
            self.chosen = self.chosen if self.chosen in {e.name for e in self.lengths} else ""
        values = self._measured[1]
        if each.name not in values:
            values[each.name] = each.measured(self.scale)
        return values[each.name]

    def being_laid(self) -> tuple[np.ndarray, Measurement | None]:
        """(n, 3) metres of what is being laid, the mouse its last point, and what it comes to."""
        points = [*self.points]
        if self.pointed is not None and points:
            points.append(Point(self.pointed, np.zeros((3, 3))))
        places = np.array([point.metres for point in points]).reshape(-1, 3)
        if len(points) < KINDS[self.kind][1]:
            return places, None
        return places, measure(self.kind, points, self.scale)

    def _change(self, changed: LengthMark, name: str, note: str) -> None:
        new = replace(changed, name=name, note=note)
        lengths = tuple(new if each is changed else each for each in self.lengths)
        self._keep(lengths, f"edit {name}")

    def _named(self, name: str) -> LengthMark:
        return next(each for each in self.lengths if each.name == name)

    def _keep(self, lengths: tuple[LengthMark, ...], what: str) -> None:
        self._inspecting.edit(replace(self._inspecting.file, lengths=lengths), what=what)

    def _rescale(self, scale: Scale) -> None:
        file, error = self._inspecting.file, min(scale.error, 1.0)
        file = replace(file, metres_per_unit=scale.factor, scale_error=error)
        self._inspecting.edit(file, what="known length")


def parse_length(text: str, unit: str) -> float | None:
    """Metres that somebody typed: 0.75, 75 cm, 2,5 m; None: they are none.  unit: where no other
    is said.
    """
    words = text.strip().replace(",", ".")
    for name in sorted(UNITS, key=len, reverse=True):
        if words.endswith(name):
            words, unit = words[: -len(name)].strip(), name
            break
    try:
        metres = float(words) * UNITS[unit]
    except ValueError:
        return None
    return metres if np.isfinite(metres) and metres > 0 else None
