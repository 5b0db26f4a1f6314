"""Marks of the scene that is open: laid, read, named, kept beside it; no GL, no imgui."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.app.document import Document
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.beside import open_beside, source_of
from shapeshift.app.editor.texts.table import said
from shapeshift.app.errors import UsageError
from shapeshift.app.inspection.draw_values import MeasuredScene, measured_scene
from shapeshift.app.inspection.mark_options import free_name
from shapeshift.app.inspection.pictures import ColorScale, auto_ends
from shapeshift.renderer.colors.palette import ALL_VALUES, LEAST_SHARE
from shapeshift.runtime_models.files.plain_text import name_line
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.inspection.air import Air
from shapeshift.scene.inspection.emissivity import Emission, SurfaceRadiation
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
from shapeshift.scene.inspection.marks_file import MarksFile, laid
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.scene import Scene


class Inspecting:
    """What the tool "Inspect" knows.  Marks are metres in the world of the window, not the file's.

    `picture` is what was measured last; `is_current` whether it is of what is seen now.
    """

    def __init__(self, state: EditorState) -> None:
        self._state = state
        self.on = False  # clicks and drags lay marks
        self.chosen = ""  # name of a mark; "": none
        self.picture: ValuePicture | None = None
        self.is_current = False
        self.pointed = (np.nan, np.nan)  # value and metres under the mouse
        self._read: tuple = (None, None)  # the marks and the picture that readings are of
        self._readings: dict[str, MarkReading] = {}
        self._measured: tuple[Scene | None, MeasuredScene | None] = (None, None)
        self._surfaces: tuple = ()  # a picture, and what was said of emissivity when it was made
        self._known: set[str] | None = None  # objects that were there, or were handed an emissivity
        state.renamed.append(self._rename)

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
        return source_of(self._state)

    def opened(self) -> None:
        """Another scene, with the marks that lie beside it."""
        self.on, self.chosen = False, ""
        self.picture, self.is_current, self._known = None, False, None
        self._state.settings = replace(self._state.settings, heat_ends=ALL_VALUES)
        open_beside(self._state)

    # ---- marks

    @property
    def file(self) -> MarksFile:
        """All marks, lengths and alarms, as the history has them."""
        return self._state.edited.marks

    def edit(self, file: MarksFile, what: str, together: str = "") -> None:
        """A step of the history; those in a row that are `together` are one, such as a drag."""
        self._state.record_regions()
        self._state.edited.record_marks(file, what, together)

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
        marks = (*self.file.marks, laid(mark, picture))
        self.edit(replace(self.file, marks=marks), what=f"add {name}")

    def delete(self, name: str) -> None:
        """The mark, and the differences that name it."""
        marks = tuple(mark for mark in self.file.marks if mark.name != name)
        pairs = tuple(pair for pair in self.file.differences if name not in pair)
        self.chosen = ""
        file = replace(self.file, marks=marks, differences=pairs)
        self.edit(file, what=f"delete {name}")

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
        self.edit(replace(self.file, marks=marks, differences=pairs), what=f"rename {name}")
        return True

    def mark(self, name: str) -> Mark:
        """The mark of that name.  KeyError: there is none."""
        return self.file.named(name)

    def change(self, name: str, changed: Mark) -> None:
        """Another mark in the place of the one of that name."""
        marks = tuple(changed if mark.name == name else mark for mark in self.file.marks)
        self.edit(replace(self.file, marks=marks), what=f"edit {name}")

    def lay_anew(self, name: str) -> None:
        """The value of a mark is what is seen of it now."""
        if self.picture is None or not self.is_current:
            return
        mark = laid(self.mark(name), self.picture)
        if mark.laid is not None:
            self.change(name, mark)
        else:
            self.note(said("Nothing is seen of {name} from here.", name=name))

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
        self.edit(replace(self.file, differences=pairs), what=f"edit {name}")

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
        self.edit(file, what="alarm", together=f"alarm {kind} {bool(made)}")

    def radiate(self, surface: SurfaceRadiation | None, air: Air | None = None) -> None:
        """Values become temperatures of such surfaces, behind this air (None: behind what they
        were); without a surface they are as photographed.
        """
        known = self.file.emission or Emission()
        emission = replace(known, surface=surface, air=air or known.air) if surface else None
        file = replace(self.file, emission=emission)
        self.edit(file, what="emissivity", together=f"emissivity {surface is not None}")

    def shine(self, name: str, emissivity: float | None, of_object: bool = False) -> None:
        """The emissivity of a mark, or an object, of its own; None: of all that is seen."""
        if of_object:
            self._known = self._known and {*self._known, name}  # what is said of it stands
            kept = tuple(pair for pair in self.file.objects if pair[0] != name)
            new = ((name, emissivity),) if emissivity is not None else ()
            file = replace(self.file, objects=(*kept, *new))
        else:
            changed = replace(self.mark(name), emissivity=emissivity)
            marks = tuple(changed if mark.name == name else mark for mark in self.file.marks)
            file = replace(self.file, marks=marks)
        together = f"emissivity {name} {of_object} {emissivity is not None}"
        self.edit(file, what="emissivity", together=together)

    def _rename(self, names: Mapping[str, str]) -> None:
        """Objects of the scene have other names."""
        if self._known is not None:
            self._known |= {names[name] for name in self._known if name in names}
        if self.picture is not None:  # it is as it was but for what its objects are called
            owners = tuple(names.get(name, name) for name in self.picture.owner_names)
            self.picture = replace(self.picture.as_photographed(), owner_names=owners)

    @property
    def chosen_object(self) -> str:
        """Name of the object that is edited, of several; "": there is one alone."""
        return self._state.chosen if len(self._state.scene.objects) > 1 else ""

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
        self._hand_over(picture)

    def _hand_over(self, picture: ValuePicture) -> None:
        """An object that was cut out since the scene was opened takes over the emissivity of a mark
        that lies on it, once: it keeps it wherever it goes.
        """
        if self._known is None:
            self._known = set(picture.owner_names)
        new = [name for name in picture.owner_names if name not in self._known]
        own = [mark for mark in self.file.marks if mark.emissivity is not None] if new else []
        objects = dict(self.file.objects)
        for mark in own:
            if not picture.sees(mark.place[None]).any():
                continue
            owner = int(picture.owner_at(picture.pixel_of(mark.place[None])[0])[0])
            name = picture.owner_names[owner] if owner >= 0 else ""
            if name not in new or name in self._known or mark.emissivity is None:
                continue
            objects[name] = mark.emissivity
            self._known.add(name)
            words = {"name": name, "share": f"{mark.emissivity:g}", "mark": mark.name}
            self.note(said("{name} has the emissivity {share} of {mark} now.", **words))
        if objects != dict(self.file.objects):
            self.edit(replace(self.file, objects=tuple(objects.items())), what="emissivity")

    def corrected(self, picture: ValuePicture) -> ValuePicture:
        """As the file of marks has the emissivity; values that are no temperatures stay."""
        return self.file.of_surfaces(picture)

    @property
    def readings(self) -> dict[str, MarkReading]:
        """Of each mark in the picture that is there, by name; the same object until one changes."""
        file, picture = self.file, self.picture
        own = tuple(mark for mark in file.marks if mark.emissivity is not None)
        if picture is not None and (picture, file.emission, own, file.objects) != self._surfaces:
            picture = self.picture = self.corrected(picture)
            self._surfaces = (picture, file.emission, own, file.objects)
        if self._read[0] is not file or self._read[1] is not picture:
            marks: tuple[Mark, ...] = file.marks if picture is not None else ()
            self._readings = {mark.name: read_mark(mark, picture) for mark in marks if picture}
            self._read = (file, picture)
            if self.chosen not in (mark.name for mark in file.marks):
                self.chosen = ""  # undone
        return self._readings

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
