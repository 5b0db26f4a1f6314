"""Adding an object to the scene that is open: the box that takes a path or a dropped file."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from shapeshift.app.camera_files import camera_reading
from shapeshift.app.opening import open_model
from shapeshift.app.panels.path_box import PathBox
from shapeshift.app.viewer.arrange import edit, undo
from shapeshift.app.viewer.files import take_over
from shapeshift.app.viewer.opened import Found, Opener, Told, read_files
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import is_scene_file

if TYPE_CHECKING:
    from shapeshift.app.viewer.viewer import Viewer


class Adding:
    """The box, and the reading that may be under way."""

    def __init__(self, viewer: "Viewer", added: Callable[[], None]) -> None:
        self._viewer, self._added = viewer, added
        self._opener = Opener()
        self._box = PathBox("Add to the scene", "Add")

    @property
    def asking(self) -> bool:
        return self._box.asking

    def ask(self) -> None:
        self._box.ask()

    def begin(self, paths: tuple[Path, ...]) -> None:
        """Reads files and adds them when all are there."""
        viewer = self._viewer
        self._box.close()
        options = viewer.options

        def read(paths: tuple[Path, ...], told: Told) -> Found:
            return read_files(
                paths,
                lambda path, told: open_model(path, options, told),  # finest level at once
                camera_reading(options),
                told,
                options.reading(),
                beside=False,
            )

        self._opener.start(paths, read)
        viewer.say(self._opener.note)

    def poll(self) -> bool:
        """Takes over what has been read; True while something is being read or looked for."""
        return take_over(self._viewer, self._opener, self.take) or self._box.browsing

    def take(self, found: Found) -> None:
        """One object more of each source; a scene that the device cannot hold stays without."""
        viewer, stage = self._viewer, self._viewer.stage
        if found.file is not None:
            stage.problem = (
                f"{found.path.name} is a scene file: open it instead, or add its models one by one."
            )
            return
        if not found.sources:
            stage.problem = "A file of cameras is no object; drop it on the window itself."
            return
        file = stage.document.file
        for source in found.sources:
            item = stage.document.item(source)
            file = edits.add(file, item)
        try:
            edit(stage, file, f"add {file.items[-1].name}")
        except (BadFile, ValueError) as error:
            stage.problem = str(error)
            return
        try:
            viewer.renderer.update(stage.scene)
        except BadFile as error:
            undo(stage)
            viewer.shown.forget()
            stage.problem = str(error)
            return
        stage.chosen = file.items[-1].name
        self._added()

    def draw(self, ui_scale: float) -> None:
        """The box: a path, a recent file, or something that is dropped meanwhile."""
        recent = self._viewer.files.recent
        paths = [path for path in recent.paths if not is_scene_file(path)] if recent else []
        if chosen := self._box.draw(paths, ui_scale):
            self.begin(chosen)
