"""Marks of the scene that is open: laid, read, named, kept beside it; no GL, no imgui."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.app.document import Document
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.edited_file import stamp_of
from shapeshift.app.editor.texts.table import said
from shapeshift.app.errors import UsageError
from shapeshift.app.inspection.draw_values import MeasuredScene, measured_scene
from shapeshift.app.inspection.mark_options import free_name
from shapeshift.app.inspection.pictures import ColorScale, auto_ends
from shapeshift.app.inspection.window.emissivities import Emissivities
from shapeshift.app.paths import is_bundled
from shapeshift.renderer.colors.palette import ALL_VALUES, LEAST_SHARE
from shapeshift.runtime_models.files.plain_text import name_line
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.inspection.mark_photos import MOST_OF_ALL, shrunk_photo
from shapeshift.scene.inspection.marks import (
    MOST_MARKS,
    Bound,
    Isotherm,
    Kind,
    Mark,
    MarkReading,
    box_at,
    circle_at,
    line_at,
    read_mark,
    spot_at,
)
from shapeshift.scene.inspection.marks_file import (
    MarksFile,
    laid,
    marks_path,
    moved_marks,
    read_marks_file,
    write_marks_file,
)
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.scene import Scene

MOST_STEPS = 100  # that can be taken back


class Inspecting:
    """What the tool "Inspect" knows.  Marks are metres in the world of the window, not the file's.

    `picture` is what was measured last; `is_current` whether it is of what is seen now.
    """

    def __init__(self, state: EditorState) -> None:
        self._state = state
        self.on = False  # clicks and drags lay marks
        self.file = MarksFile()
        self.chosen = ""  # name of a mark; "": none
        self.picture: ValuePicture | None = None
        self.is_current = False
        self.readings: dict[str, MarkReading] = {}
        self.pointed = (np.nan, np.nan)  # value and metres under the mouse
        self._saved = self.file
        self._stamp: tuple = ()  # of the file beside the scene, as it was read or written
        self._before: list[MarksFile] = []
        self._left: dict[Path, MarksFile] = {}  # of scenes that were left without saving
        self._path: Path | None = None
        self._warned: MarksFile | None = None  # that somebody wanted to close, and was told
        self._measured: tuple[Scene | None, MeasuredScene | None] = (None, None)
        self.emissivities = Emissivities()
        self._surfaces: tuple = ()  # a picture, and what was said of emissivity when it was made

    # ---- the scene

    @property
    def measured(self) -> MeasuredScene | None:
        """What is measured; None: the scene has no value stop whose range is known."""
        state = self._state
        if self._measured[0] is not state.scene:
            found = None
            if state.has_legend:
                try:
                    found = measured_scene(self.document)
                except UsageError:  # several that do not agree
                    found = None
            self._measured = (state.scene, found)
        return self._measured[1]

    @property
    def document(self) -> Document:
        """What is open, as the command thermal has it: one model alone, or a scene file."""
        edited = self._state.edited
        return Document(self._state.scene, edited.file if edited.path else None)

    @property
    def source(self) -> Path | None:
        """The file beside which marks lie; None: there is no one file."""
        if self._state.edited.path is not None:
            return self._state.edited.path
        sources = self._state.sources
        return sources[0].path if len(sources) == 1 else None

    def opened(self) -> None:
        """Another scene: its marks, those that were not saved among them."""
        if self._path is not None:
            if self.unsaved:
                self._left[self._path] = self.file
            else:
                self._left.pop(self._path, None)
        self.on, self.chosen, self._before = False, "", []
        self.picture, self.is_current, self.readings = None, False, {}
        self.emissivities = Emissivities()
        self._state.settings = replace(self._state.settings, heat_ends=ALL_VALUES)
        self.file = self._saved = MarksFile()
        source = self.source
        self._path = None if source is None else marks_path(source)
        self._stamp = ()
        if self._path is None:
            return
        if self._path.exists():
            try:
                read = read_marks_file(self._path)
            except BadFile as error:
                self._state.problem = str(error)
                return
            self._stamp = stamp_of(self._path)
            self.file = self._saved = moved_marks(read, -self.document.origin)
        self.file = self._left.get(self._path, self.file)

    # ---- marks

    @property
    def unsaved(self) -> bool:
        return self.file is not self._saved

    def edit(self, file: MarksFile) -> None:
        """A step that `undo` takes back."""
        self._before, self.emissivities.dragged = [*self._before, self.file][-MOST_STEPS:], ()
        self.file = file
        self.read()

    def undo(self) -> bool:
        """False: there is nothing to be taken back."""
        if not self._before:
            return False
        self.file = self._before.pop()
        if self.chosen not in (mark.name for mark in self.file.marks):
            self.chosen = ""
        self.read()
        return True

    def lay(
        self, kind: Kind, start: tuple[float, float], end: tuple[float, float],
        seen: ValuePicture | None = None,
    ) -> None:  # fmt: skip
        """A mark where the picture shows something; start, end: its pixels (column, row).  seen:
        another one than the view's, such as around a hand's ray.
        """
        picture, names = seen or self.picture, [mark.name for mark in self.file.marks]
        if picture is None:
            return
        name = free_name(kind, names)
        try:
            if len(names) >= MOST_MARKS:
                raise ValueError(f"{MOST_MARKS:,} marks are the most that fit one file.")
            if kind == "spot":
                mark = spot_at(name, picture, start)
            elif kind == "line":
                mark = line_at(name, picture, np.array([start, end]))
            elif kind == "circle":
                radius = float(np.hypot(end[0] - start[0], end[1] - start[1]))
                mark = circle_at(name, picture, start, radius)
            else:
                mark = box_at(name, picture, start, end)
        except ValueError as error:
            self._state.say(str(error))
            return
        self.chosen = name
        self.edit(replace(self.file, marks=(*self.file.marks, laid(mark, picture))))

    def delete(self, name: str) -> None:
        """The mark, and the differences that name it."""
        marks = tuple(mark for mark in self.file.marks if mark.name != name)
        pairs = tuple(pair for pair in self.file.differences if name not in pair)
        self.chosen = ""
        self.edit(replace(self.file, marks=marks, differences=pairs))

    def name_mark(self, name: str, text: str) -> bool:
        """False where the text is no name, or another mark's."""
        text = text.strip()
        if not text or text != name_line(text) or text in (m.name for m in self.file.marks):
            return False
        marks = tuple(replace(m, name=text) if m.name == name else m for m in self.file.marks)
        pairs = tuple(
            (text if a == name else a, text if b == name else b) for a, b in self.file.differences
        )
        self.chosen = text if self.chosen == name else self.chosen
        self.edit(replace(self.file, marks=marks, differences=pairs))
        return True

    def mark(self, name: str) -> Mark:
        """The mark of that name.  KeyError: there is none."""
        return self.file.named(name)

    def change(self, name: str, changed: Mark) -> None:
        """Another mark in the place of the one of that name."""
        marks = tuple(changed if mark.name == name else mark for mark in self.file.marks)
        self.edit(replace(self.file, marks=marks))

    def drag(self, file: MarksFile) -> None:
        """A number that is being dragged: no step of its own."""
        self.file = file
        self.read()

    def lay_anew(self, name: str) -> None:
        """The value of a mark is what is seen of it now."""
        if self.picture is None or not self.is_current:
            return
        mark = laid(self.mark(name), self.picture)
        if mark.laid is not None:
            self.change(name, mark)
        else:
            self.note(said("Nothing is seen of {name} from here.", name=name))

    @property
    def chosen_object(self) -> str:
        """Name of the object that is edited, of several; "": there is one alone."""
        return self._state.chosen if len(self._state.scene.objects) > 1 else ""

    def write_note(self, name: str, text: str) -> None:
        """A line about a mark, for tables and reports."""
        note = name_line(text.strip()) if text.strip() else ""
        self.change(name, replace(self.mark(name), note=note))

    def attach_photo(self, name: str, path: Path) -> None:
        """A photo of what a mark is at, for reports; says what stands against it."""
        try:
            photo = shrunk_photo(path)
        except BadFile as error:
            self.fail(str(error))
            return
        if sum(len(mark.photo) for mark in self.file.marks) + len(photo) > MOST_OF_ALL:
            self.fail(said("The photos of all marks are too many; remove some first."))
            return
        self.change(name, replace(self.mark(name), photo=photo))
        self.note(said("{name} has a photo now, for reports.", name=name))

    def drop_photo(self, name: str) -> None:
        self.change(name, replace(self.mark(name), photo=b""))

    def less_of(self, name: str) -> str:
        """The mark whose mean is taken off that of another one; "": none is."""
        return next((less for of, less in self.file.differences if of == name), "")

    def take_off(self, name: str, less: str) -> None:
        """The difference of two marks from now on; "": of none."""
        others = tuple(pair for pair in self.file.differences if pair[0] != name)
        pairs = (*others, (name, less)) if less else others
        self.edit(replace(self.file, differences=pairs))

    def difference(self, of: str, less: str) -> float:
        """Mean less mean, as they are read now; NaN: one of them is not seen."""
        a, b = self.readings.get(of), self.readings.get(less)
        return a.mean - b.mean if a is not None and b is not None else np.nan

    def isotherm(self, kind: Bound) -> Isotherm | None:
        """The first of that kind."""
        return next((each for each in self.file.isotherms if each.kind == kind), None)

    def bound(self, kind: Bound, value: float | None) -> None:
        """All above or below a value is an alarm; None: no more."""
        others = tuple(each for each in self.file.isotherms if each.kind != kind)
        made: tuple[Isotherm, ...] = ()
        if value is not None and np.isfinite(value):
            made = (Isotherm(kind, **{"low" if kind == "above" else "high": float(value)}),)
        file = replace(self.file, isotherms=(*others, *made))
        before = self._before[-1] if self._before else None
        if before is not None and _lies_as(before, self.file):
            self.file = file  # the number is being dragged: one step
        else:
            self.edit(file)

    def note(self, sentence: str) -> None:
        """Says for a moment what a hand cannot do."""
        self._state.say(sentence)

    def fail(self, sentence: str) -> None:
        """Says what is wrong, until it is taken away."""
        self._state.problem = sentence

    # ---- what is read

    def saw(self, picture: ValuePicture) -> None:
        """What the view has, measured just now."""
        self.picture, self.is_current = picture, True
        self.read()
        self.emissivities.hand_over(self, picture)

    def corrected(self, picture: ValuePicture) -> ValuePicture:
        """As the file of marks has the emissivity."""
        return self.file.of_surfaces(picture)

    def read(self) -> None:
        """All marks anew in the picture that is there."""
        own = tuple(mark for mark in self.file.marks if mark.emissivity is not None)
        surfaces = (self.picture, self.file.emission, own, self.file.objects)
        if self.picture is not None and surfaces != self._surfaces:
            self.picture = self.corrected(self.picture)
            self._surfaces = (self.picture, *surfaces[1:])
        picture = self.picture
        marks: tuple[Mark, ...] = self.file.marks if picture is not None else ()
        self.readings = {mark.name: read_mark(mark, picture) for mark in marks if picture}

    def point(self, pixel: tuple[float, float] | None) -> None:
        """Looks up what lies under a pixel (column, row) of the picture; None: nothing does."""
        self.pointed = (np.nan, np.nan)
        if pixel is not None and self.picture is not None:
            at = np.array([pixel])
            value = self.picture.at(self.picture.values, at)[0]
            self.pointed = (float(value), float(self.picture.at(self.picture.depth_m, at)[0]))

    # ---- level and span

    @property
    def ends(self) -> tuple[float, float]:
        """The values that the ends of the palette stand for."""
        (low, high), (first, last) = self.value_range, self._state.settings.heat_ends
        return low + first * (high - low), low + last * (high - low)

    @ends.setter
    def ends(self, ends: tuple[float, float]) -> None:
        low, high = self.value_range
        first, last = ((value - low) / (high - low) for value in ends)
        if last - first >= LEAST_SHARE:
            self._state.settings = replace(self._state.settings, heat_ends=(first, last))

    @property
    def value_range(self) -> tuple[float, float]:
        """Of the stop that is measured."""
        measured = self.measured
        found = measured.stop.value_range if measured is not None else None
        return found or ALL_VALUES

    def auto(self) -> None:
        """The palette shows nearly all values of the view."""
        if self.picture is None:
            return
        try:
            self.ends = auto_ends(self.picture.as_photographed().values)  # as it is drawn
        except ValueError as error:
            self._state.say(str(error))

    @property
    def scale(self) -> ColorScale:
        """As the legend shows it."""
        assert self.measured is not None, "asked for where there is a value stop"
        return ColorScale(*self.ends, self.measured.stop.palette)

    # ---- files

    def keep(self) -> None:
        """Writes NAME.marks.json beside the scene; says why not, or where."""
        state, path = self._state, self._path
        if path is None:
            state.problem = said("Save the scene first (Ctrl+S): its marks lie beside it.")
        elif is_bundled(path):
            state.problem = said(
                "{name} came with the program; save the scene in a folder of yours, then its "
                "marks beside it.",
                name=(self.source or path).name,
            )
        elif stamp_of(path) != self._stamp:
            state.problem = said(
                "{name} was written by somebody else, or cannot be read; move it away, then save.",
                name=path.name,
            )
        else:
            try:
                write_marks_file(moved_marks(self.file, self.document.origin), path)
            except OSError as error:
                why = error.strerror or error
                state.problem = said("The marks cannot be kept: {why}.", why=why)
                return
            self._saved, self._stamp = self.file, stamp_of(path)
            state.say(said("Saved {path}", path=path))

    def may_close(self) -> bool:
        """Whether nothing would be lost; asked again with the same marks, it may."""
        if not self.unsaved or self._warned is self.file:
            return True
        self._warned = self.file
        self._state.problem = said(
            "Marks or lengths are not saved: save them in the section Measure, or close once more."
        )
        return False


def _lies_as(before: MarksFile, now: MarksFile) -> bool:
    """Whether marks and lengths are the same: what differs is a number that is being dragged."""
    return before.marks is now.marks and before.lengths is now.lengths and before.scale == now.scale
