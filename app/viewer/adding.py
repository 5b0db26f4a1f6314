"""Adding an object to the scene that is open: the box that takes a path or a dropped file."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from imgui_bundle import imgui

from app.camera_files import camera_reading
from app.opening import open_model
from app.panels.panel_rows import tip
from app.paths import plain
from app.viewer.arrange import edit, undo
from app.viewer.files import take_over
from app.viewer.opened import Found, Opener, Told, read_files
from app.viewer.saving import LONGEST_PATH, answer_row, box
from runtime_models.model import BadFile
from scene import edits
from scene.scene_file import is_scene_file

if TYPE_CHECKING:
    from app.viewer.viewer import Viewer

Vec = imgui.ImVec2
ADD = "Add to the scene"
MOST_RECENT = 6


class Adding:
    """The box, and the reading that may be under way."""

    def __init__(self, viewer: "Viewer", added: Callable[[], None]) -> None:
        self._viewer, self._added = viewer, added
        self._opener = Opener()
        self.asking = False
        self._path = ""

    def ask(self) -> None:
        self.asking, self._path = True, ""

    def begin(self, paths: tuple[Path, ...]) -> None:
        """Reads files and adds them when all are there."""
        viewer = self._viewer
        self.asking = False
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
        """Takes over what has been read; True while something is being read."""
        return take_over(self._viewer, self._opener, self.take)

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
        if not self.asking or not box(ADD, ui_scale):
            return
        imgui.push_text_wrap_pos(0)
        imgui.text_unformatted("Drop a file or folder here, or name it:")
        imgui.pop_text_wrap_pos()
        imgui.push_item_width(-1)
        if imgui.is_window_appearing():
            imgui.set_keyboard_focus_here()
        flags = imgui.InputTextFlags_.enter_returns_true
        entered, self._path = imgui.input_text("##path", self._path[:LONGEST_PATH], flags)
        imgui.pop_item_width()
        chosen = self._recent(ui_scale)
        clicked = answer_row(("Add", "Cancel"), ui_scale)
        if chosen is not None:
            self.begin((chosen,))
        elif (entered or clicked == "Add") and self._path.strip():
            self.begin((plain(self._path.strip()),))
        elif clicked == "Cancel":
            self.asking = False
        if not self.asking:
            imgui.close_current_popup()
        imgui.end_popup()

    def _recent(self, ui_scale: float) -> Path | None:
        """Files that were opened before; the one that was clicked."""
        recent = self._viewer.files.recent
        paths = [path for path in recent.paths if not is_scene_file(path)] if recent else []
        chosen = None
        for row, path in enumerate(paths[:MOST_RECENT]):
            if imgui.selectable(f"{path.name or path}##{row}", False)[0]:
                chosen = path
            tip(str(path), ui_scale)
        return chosen
