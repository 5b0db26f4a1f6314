"""A box that asks for a file or folder: typed, dropped, from the recent ones, or from a dialog."""

import shutil
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from imgui_bundle import imgui, portable_file_dialogs

from shapeshift.app.editor.panels.widgets.panel_rows import item_label, tip
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


# A box in the middle of the window that wants an answer: its frame, and its row of buttons.

Vec = imgui.ImVec2
WIDTH = 460.0  # logical pixels


def question_box(name: str, ui_scale: float) -> bool:
    """Opens a box in the middle of the window; True while it is to be filled, then end_popup."""
    if not imgui.is_popup_open(item_label(name)):
        imgui.open_popup(item_label(name))
    screen = imgui.get_io().display_size
    imgui.set_next_window_pos(Vec(screen.x / 2, screen.y / 2), 0, Vec(0.5, 0.5))
    imgui.set_next_window_size(Vec(min(WIDTH * ui_scale, screen.x * 0.9), 0))
    flags = imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_saved_settings
    return imgui.begin_popup_modal(item_label(name), None, flags)[0]


def answer_row(words: tuple[str, ...], ui_scale: float) -> str:
    """Buttons; the word that was clicked, the last one for Escape, else ""."""
    imgui.dummy(Vec(0, 4 * ui_scale))
    clicked = ""
    for number, word in enumerate(words):
        if number:
            imgui.same_line()
        if imgui.button(item_label(word), Vec(110 * ui_scale, 0)):
            clicked = word
    return words[-1] if imgui.is_key_pressed(imgui.Key.escape, False) else clicked
