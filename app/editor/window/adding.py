"""Adding an object to the scene that is open: the box that takes a path or a dropped file."""

from collections.abc import Callable, Sequence
from pathlib import Path

from shapeshift.app.camera_files import camera_reading
from shapeshift.app.editor.panels.widgets.path_box import PathBox
from shapeshift.app.editor.state.arrange import edit, undo
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.opened import OpenedFiles, Opener, Progress, read_files
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.files import poll_opener
from shapeshift.app.opening import ReadingOptions, open_model
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import is_scene_file
from shapeshift.scene.scene import Scene


class Adding:
    """The box, and the reading that may be under way."""

    def __init__(
        self, state: EditorState, options: ReadingOptions, upload: Callable[[Scene], None],
        added: Callable[[], None], recent: Callable[[], Sequence[Path]],
    ) -> None:  # fmt: skip
        """`upload` gives a scene to the device and raises BadFile where it does not fit."""
        self._state, self._options = state, options
        self._upload, self._added, self._recent = upload, added, recent
        self._opener = Opener()
        self._box = PathBox("Add to the scene", "Add")

    @property
    def asking(self) -> bool:
        return self._box.asking

    def ask(self) -> None:
        self._box.ask()

    def begin(self, paths: tuple[Path, ...]) -> None:
        """Reads files and adds them when all are there."""
        self._box.close()
        options = self._options

        def read(paths: tuple[Path, ...], progress: Progress) -> OpenedFiles:
            return read_files(
                paths,
                lambda path, progress: open_model(path, options, progress),  # finest level at once
                camera_reading(options),
                progress,
                options.reading(),
                beside=False,
            )

        self._opener.start(paths, read)
        self._state.say(self._opener.note)

    def poll(self) -> bool:
        """Takes over what has been read; True while something is being read or looked for."""
        return poll_opener(self._state, self._opener, self.add_opened) or self._box.browsing

    def add_opened(self, found: OpenedFiles) -> None:
        """One object more of each source; a scene that the device cannot hold stays without."""
        state = self._state
        if found.path is not None:
            state.problem = said(
                "{name} is a scene file: open it instead, or add its models one by one.",
                name=found.path.name,
            )
            return
        if not found.sources:
            state.problem = said("A file of cameras is no object; drop it on the window itself.")
            return
        file = state.edited.file
        for source in found.sources:
            item = state.edited.item(source)
            file = edits.add(file, item)
        try:
            edit(state, file, f"add {file.items[-1].name}")
        except (BadFile, ValueError) as error:
            state.problem = str(error)
            return
        try:
            self._upload(state.scene)
        except BadFile as error:
            undo(state)
            state.problem = str(error)
            return
        state.chosen = file.items[-1].name
        self._added()

    def draw(self, ui_scale: float) -> None:
        """The box: a path, a recent file, or something that is dropped meanwhile."""
        paths = [path for path in self._recent() if not is_scene_file(path)]
        if chosen := self._box.draw(paths, ui_scale):
            self.begin(chosen)
