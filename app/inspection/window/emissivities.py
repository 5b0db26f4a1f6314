"""Emissivity in the tool "Inspect": of all that is seen, of single marks and objects."""

from dataclasses import dataclass, field, replace
from typing import Protocol

from shapeshift.app.editor.texts.table import said
from shapeshift.scene.inspection.air import Air
from shapeshift.scene.inspection.emissivity import Emission, SurfaceRadiation
from shapeshift.scene.inspection.marks import Mark
from shapeshift.scene.inspection.marks_file import MarksFile
from shapeshift.scene.inspection.value_picture import ValuePicture


class MarksTool(Protocol):
    """What of `Inspecting` is changed here."""

    file: MarksFile

    def edit(self, file: MarksFile) -> None: ...
    def drag(self, file: MarksFile) -> None: ...
    def mark(self, name: str) -> Mark: ...
    def note(self, sentence: str) -> None: ...


@dataclass
class Emissivities:
    """What is known of them while a scene is open."""

    dragged: tuple = ()  # whose was changed last; (): something else was
    known: set[str] = field(default_factory=set)  # objects that were there, or were handed one
    began: bool = False

    def radiate(
        self, tool: MarksTool, surface: SurfaceRadiation | None, air: Air | None = None
    ) -> None:
        """Values become temperatures of such surfaces, behind this air (None: behind what they
        were); without a surface they are as photographed.
        """
        known = tool.file.emission or Emission()
        emission = replace(known, surface=surface, air=air or known.air) if surface else None
        self._change(tool, replace(tool.file, emission=emission), surface and ("all",))

    def shine(
        self, tool: MarksTool, name: str, emissivity: float | None, of_object: bool = False
    ) -> None:
        """The emissivity of a mark, or an object, of its own; None: of all that is seen."""
        if of_object:
            kept = tuple(pair for pair in tool.file.objects if pair[0] != name)
            new = ((name, emissivity),) if emissivity is not None else ()
            file = replace(tool.file, objects=(*kept, *new))
        else:
            changed = replace(tool.mark(name), emissivity=emissivity)
            marks = tuple(changed if mark.name == name else mark for mark in tool.file.marks)
            file = replace(tool.file, marks=marks)
        self._change(tool, file, (name, of_object) if emissivity is not None else None)

    def _change(self, tool: MarksTool, file: MarksFile, of: tuple | None) -> None:
        """One step of all changes of the same number, one after the other."""
        if of and self.dragged == of:
            tool.drag(file)
        else:
            tool.edit(file)
        self.dragged = of or ()

    def hand_over(self, tool: MarksTool, picture: ValuePicture) -> None:
        """An object that was cut out since the scene was opened takes over the emissivity of a mark
        that lies on it, once: it keeps it wherever it goes.
        """
        if not self.began:
            self.began, self.known = True, set(picture.owner_names)
        new = [name for name in picture.owner_names if name not in self.known]
        own = [mark for mark in tool.file.marks if mark.emissivity is not None] if new else []
        objects = dict(tool.file.objects)
        for mark in own:
            if not picture.sees(mark.place[None]).any():
                continue
            owner = int(picture.owner_at(picture.pixel_of(mark.place[None])[0])[0])
            name = picture.owner_names[owner] if owner >= 0 else ""
            if name not in new or name in objects or mark.emissivity is None:
                continue
            objects[name] = mark.emissivity
            self.known.add(name)
            words = {"name": name, "share": f"{mark.emissivity:g}", "mark": mark.name}
            tool.note(said("{name} has the emissivity {share} of {mark} now.", **words))
        if len(objects) > len(tool.file.objects):
            tool.edit(replace(tool.file, objects=tuple(objects.items())))
