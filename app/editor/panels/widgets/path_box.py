"""A box that asks for a file or folder: typed, dropped, from the recent ones, or from a dialog."""

import shutil
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from imgui_bundle import imgui, portable_file_dialogs

from shapeshift.app.editor.panels.widgets.panel_rows import tip
from shapeshift.app.editor.panels.widgets.question_box import answer_row, question_box
from shapeshift.app.editor.texts.table import said
from shapeshift.app.paths import plain

LONGEST_PATH = 1000  # letters
MOST_RECENT = 6
DIALOGS = ("zenity", "kdialog", "qarma", "matedialog")  # what Linux desktops ask files with


@dataclass
class PathBox:
    """Asks while `asking`; what it is for is its title and the word on its button."""

    title: str
    word: str
    asking: bool = False
    _path: str = ""
    _dialog: portable_file_dialogs.open_file | None = None

    def ask(self) -> None:
        self.asking, self._path = True, ""

    def close(self) -> None:
        self.asking, self._dialog = False, None

    def draw(self, recent: Sequence[Path], ui_scale: float) -> tuple[Path, ...]:
        """Draws the box while it asks; returns what was chosen, () as long as nothing was."""
        if not self.asking or not question_box(self.title, ui_scale):
            return ()
        imgui.text_wrapped(said("Drop a file or folder here, or name it:"))
        imgui.push_item_width(-1)
        if imgui.is_window_appearing():
            imgui.set_keyboard_focus_here()
        flags = imgui.InputTextFlags_.enter_returns_true
        entered, self._path = imgui.input_text("##path", self._path[:LONGEST_PATH], flags)
        tip("A path; ~ and file:// are understood.", ui_scale)
        imgui.pop_item_width()
        chosen = _recent(recent, ui_scale)
        words = (self.word, "Browse\u2026", "Cancel") if can_browse() else (self.word, "Cancel")
        clicked = answer_row(words, ui_scale)
        if clicked == "Browse\u2026" and self._dialog is None:
            self._dialog = portable_file_dialogs.open_file(self.title)
        chosen = chosen or self._from_dialog()
        if not chosen and (entered or clicked == self.word) and self._path.strip():
            chosen = (plain(self._path.strip()),)
        if chosen or clicked == "Cancel":
            self.close()
            imgui.close_current_popup()
        imgui.end_popup()
        return chosen

    @property
    def browsing(self) -> bool:
        """Whether the desktop's own dialog is open: somebody has to ask how it ended."""
        return self._dialog is not None

    def _from_dialog(self) -> tuple[Path, ...]:
        """What the desktop's dialog has given, once; () while it is open or was cancelled."""
        if self._dialog is None or not self._dialog.ready(0):
            return ()
        found, self._dialog = self._dialog.result(), None
        return tuple(map(Path, found))


def can_browse(which: Callable[[str], str | None] = shutil.which) -> bool:
    """Whether there is a dialog of the desktop to ask with."""
    return sys.platform in ("win32", "darwin") or any(which(name) for name in DIALOGS)


def _recent(paths: Sequence[Path], ui_scale: float) -> tuple[Path, ...]:
    """Files that were opened before; the one that was clicked."""
    chosen: tuple[Path, ...] = ()
    for row, path in enumerate(paths[:MOST_RECENT]):
        if imgui.selectable(f"{path.name or path}##{row}", False)[0]:
            chosen = (path,)
        tip(str(path), ui_scale)
    return chosen
