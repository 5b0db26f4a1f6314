"""Styles that are added in the gallery, or taken out: the command `style` beside the window."""

import typing
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from shapeshift.app.drawing import make_folder
from shapeshift.app.editor.state.arrange import edit, go_to_stop
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.edited_file import key_of
from shapeshift.app.editor.state.files.opened import Source
from shapeshift.app.editor.state.files.saving import unsaved
from shapeshift.app.editor.texts.table import said
from shapeshift.app.errors import UsageError
from shapeshift.app.film.window.rendering import ChildWork, ProgramChild, free_name
from shapeshift.app.training.style_options import Options
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import describe
from shapeshift.scene.document import edits

ENDING = ".shift"
_SHAPES = typing.get_args(typing.get_type_hints(Options)["shape"])
SHAPES: tuple[str, ...] = tuple(shape for shape in _SHAPES if shape)


class StyleWork(ChildWork):
    """The choices, and the one style that may be under way; a new file each, never the old one."""

    def __init__(
        self, state: EditorState, folder: Path, open_file: Callable[[Path], None] | None = None
    ) -> None:
        """folder: where new packages go; open_file: opens one that was made of what is open alone.

        Without it, and in a scene of several objects, the object gets the new package in its place.
        """
        super().__init__()
        self._state, self._folder, self._open_file = state, folder, open_file
        self._object, self.stop = "", ""  # whose package it is, and the stop that it shall show
        self.shape = SHAPES[0]
        self.strength = 1.0
        self.path = Path()
        self._going_to = ""  # a stop of what is being opened

    def status(self) -> str:
        """Words for the status line; "" when nothing is under way."""
        return said("style {part:.0%}", part=self.progress[1]) if self.running else ""

    def name(self, index: int = 0) -> str:
        """What a stop of the chosen shape will be called."""
        obj = self._state.scene.objects[index]
        taken = {stop.name.casefold() for stop in obj.model.stops}
        word = self.shape.capitalize()
        names = [word, *(f"{word} {n}" for n in range(2, len(taken) + 3))]
        return next(name for name in names if name.casefold() not in taken)

    def add(self, source: str, index: int = 0) -> None:
        """Begins a stop of the chosen shape, from the stop `source` of an object."""
        name = self.name(index)
        # Behind all others: the ways between those that were there stay what they were.
        words = ["--shape", self.shape, "--name", name, "--from", source]
        self._begin([*words, "--strength", f"{self.strength:g}"], self.shape, index, name)

    def remove(self, stop: str, index: int = 0) -> None:
        """Begins to take a stop out of an object."""
        self._begin(["--remove", stop], "without", index, "")

    def _begin(self, words: list[str], word: str, index: int, stop: str) -> None:
        state = self._state
        try:
            item, source = state.edited.file.all_items[index], state.sources[index]
            if item.part is not None:
                raise UsageError(f"{item.name} is a part of a package; open that alone.")
            make_folder(self._folder)
            self.path = free_name(self._folder, f"{source.path.stem}-{word}", ENDING)
            self._object, self.stop = item.name, stop
            command = ["style", str(source.path), "--out", str(self.path), *words]
            self._child = ProgramChild(command)
        except (OSError, UsageError) as error:
            self.say_failed(error)

    def say_left(self) -> None:
        self._state.say(said("The style was left; nothing was written."))

    def say_failed(self, why: object) -> None:
        self._state.problem = said("There is no new style: {error}", error=why)

    def poll(self) -> bool:
        """Once a frame; what was made of what is open alone is gone to as soon as it is open."""
        busy = super().poll()
        opened, wanted = self._state.sources, self._going_to
        if not wanted or len(opened) != 1 or opened[0].path != self.path:
            return busy
        self._going_to = ""
        names = [stop.name for stop in self._state.stops(0)]
        if wanted in names:
            go_to_stop(self._state, 0, names.index(wanted))
            self._state.say(said("{stop} is the last stop now.", stop=wanted))
        return True

    def show(self, child: ProgramChild) -> None:
        """What was made, in place of what it was made of."""
        state = self._state
        alone = state.edited.path is None and len(state.scene.objects) == 1
        if self._open_file is not None and alone and not unsaved(state):
            self._going_to = self.stop
            self._open_file(self.path)
            return
        try:
            put_in_place(state, self._object, self.path, self.stop)
        except (BadFile, OSError) as error:
            state.problem = said(
                "The new style is in {path}, and cannot be shown: {error}",
                path=self.path, error=error,
            )  # fmt: skip
        else:
            state.say(said("It is in {path}", path=self.path), seconds=8)


def put_in_place(state: EditorState, name: str, path: Path, stop: str) -> None:
    """Another package for an object, at one of its stops ("": its first): an edit like others.

    Raises BadFile.
    """
    model = state.read_model(path)
    item = edits.item_named(state.edited.file, name)
    places = {each.name: each.x for each in model.stops}
    values: dict[str, Any] = {
        "model": path.absolute().as_posix(),
        "x": places.get(stop, model.stops[0].x),
    }
    source = Source(path, model, describe(model, path))
    state.edited.sources[key_of(replace(item, **values))] = source
    edit(state, edits.change(state.edited.file, name, **values), f"style of {name}")
