"""Styles that are added in the gallery, or taken out: the command `style` beside the window."""

import typing
from collections.abc import Callable
from pathlib import Path

from shapeshift.app.drawing import make_folder
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.film.program_child import ProgramChild
from shapeshift.app.editor.state.film.rendering import free_name, scene_on_disk
from shapeshift.app.errors import UsageError
from shapeshift.app.training.style_options import Options

ENDING = ".shift"
_SHAPES = typing.get_args(typing.get_type_hints(Options)["shape"])
SHAPES: tuple[str, ...] = tuple(shape for shape in _SHAPES if shape)


class StyleWork:
    """The choices, and the one style that may be under way; a new file each, never the old one."""

    def __init__(self, state: EditorState, folder: Path, show: Callable[[Path], None]) -> None:
        """folder: where new packages go; show: what is done with one that is there."""
        self._state, self._folder, self._show = state, folder, show
        self.shape = SHAPES[0]
        self.strength = 1.0
        self._child: ProgramChild | None = None
        self._path = Path()

    @property
    def running(self) -> bool:
        return self._child is not None

    @property
    def progress(self) -> tuple[str, float]:
        """What is being done, part done."""
        return self._child.progress if self._child else ("", 0.0)

    def status(self) -> str:
        """Words for the status line; "" when nothing is under way."""
        return f"style {self.progress[1]:.0%}" if self.running else ""

    def name(self) -> str:
        """What a stop of the chosen shape will be called."""
        obj = self._state.scene.objects[0]
        taken = {stop.name.casefold() for stop in obj.model.stops}
        word = self.shape.capitalize()
        names = [word, *(f"{word} {n}" for n in range(2, len(taken) + 3))]
        return next(name for name in names if name.casefold() not in taken)

    def add(self, source: str) -> None:
        """Begins a stop of the chosen shape, from the stop `source`."""
        words = ["--shape", self.shape, "--name", self.name(), "--from", source]
        self._begin([*words, "--after", source, "--strength", f"{self.strength:g}"], self.shape)

    def remove(self, stop: str) -> None:
        """Begins to take a stop out."""
        self._begin(["--remove", stop], "without")

    def _begin(self, words: list[str], word: str) -> None:
        state = self._state
        try:
            if state.edited.path is not None or len(state.scene.objects) != 1:
                raise UsageError("open the package itself; it is one of several objects here.")
            scene, reading = scene_on_disk(state)
            make_folder(self._folder)
            self._path = free_name(self._folder, f"{Path(scene).stem}-{word}", ENDING)
            command = ["style", str(scene), *reading, "--out", str(self._path), *words]
            self._child = ProgramChild(command)
        except (OSError, UsageError) as error:
            state.problem = f"There is no new style: {error}"

    def cancel(self) -> None:
        """Ends it; nothing is left of it."""
        if self._child is not None:
            self._child.cancel()

    def poll(self) -> bool:
        """Once a frame: shows what is there now; True while it is under way."""
        child = self._child
        if child is None or child.code is None:
            return child is not None
        self._child = None
        if child.cancelled:
            self._state.say("The style was left; nothing was written.")
        elif problem := child.problem():
            self._state.problem = f"There is no new style: {problem}"
        else:
            self._show(self._path)
        return True
