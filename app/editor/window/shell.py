"""What concerns the window and no scene: text size, language, folded panel, keys, messages."""

from collections.abc import Callable

import glfw

from shapeshift.app.editor.panels.keys_sheet import Row, draw_keys
from shapeshift.app.editor.panels.messages_panel import draw_messages
from shapeshift.app.editor.panels.panel import PanelActions
from shapeshift.app.editor.panels.sections.settings_panel import draw_settings
from shapeshift.app.editor.panels.widgets.theme import Box
from shapeshift.app.editor.state.messages import Messages
from shapeshift.app.editor.state.user.settings import ProgramSettings, other_text_size
from shapeshift.app.editor.texts.fonts import is_offered, why_not
from shapeshift.app.editor.texts.table import all_languages, said, use_language
from shapeshift.app.editor.window.monitor import place_of
from shapeshift.app.editor.window.window import Event, KeyDown, Window

LARGER, SMALLER, AS_AT_FIRST = ("+", "="), ("-",), ("0",)  # with Ctrl


class Shell:
    """Its keys, and what it draws over everything else."""

    def __init__(
        self,
        window: Window,
        settings: ProgramSettings,
        messages: Messages,
        now: Callable[[], float],
    ) -> None:
        self._window, self._settings, self._messages, self._now = window, settings, messages, now
        self.keys_open = False
        self.actions = PanelActions(
            self.fold, self.resize_text, self.show_keys, settings.sections, self.keep
        )

    def handle_event(self, event: Event) -> bool:
        """True for a key that is the shell's."""
        match event:
            case KeyDown(key=glfw.KEY_F1):
                self.keys_open = not self.keys_open
            case KeyDown(key=glfw.KEY_ESCAPE) if self.keys_open:
                self.keys_open = False
            case KeyDown(key=glfw.KEY_ESCAPE):
                return self._messages.dismiss_newest()
            case KeyDown(shortcut=letter) if letter in LARGER:
                self.resize_text(1)
            case KeyDown(shortcut=letter) if letter in SMALLER:
                self.resize_text(-1)
            case KeyDown(shortcut=letter) if letter in AS_AT_FIRST:
                self.resize_text(0)
            case _:
                return False
        return True

    def show_keys(self) -> None:
        self.keys_open = True

    def resize_text(self, step: int) -> None:
        """Larger (1), smaller (-1), as the monitor asks for (0); kept for the next start."""
        size = other_text_size(self._window.text_size, step) if step else None
        self._window.text_size = self._settings.text_size = size
        now = said("Text size {size:.0%}", size=self._window.text_size)
        self._messages.say(now, self._now())
        self.keep()

    def draw_settings(self, ui_scale: float) -> None:
        """What the section Settings has."""
        draw_settings(self._settings, self.speak, self.keep, ui_scale)

    def speak(self, code: str) -> None:
        """Texts of another language from the next frame on; kept for the next start."""
        use_language(code)
        self._settings.language = code
        self._window.restyle()
        self.keep()

    def keep_place(self) -> None:
        """Where the window is, for the next start; called when it closes."""
        self._settings.place = place_of(self._window.handle) or self._settings.place
        self.keep()

    def fold(self, folded: bool) -> None:
        """Folds or opens the panel; kept for the next start."""
        self._settings.panel_open = not folded
        self.keep()

    def keep(self) -> None:
        """Writes the settings; what stands against that is said once."""
        try:
            self._settings.keep()
        except OSError as error:
            why = error.strerror or error
            self._messages.fail(said("The settings cannot be kept: {why}.", why=why))
            self._settings.folder = None  # said once

    def draw(self, free: Box, more_keys: dict[str, list[Row]], ui_scale: float) -> list[Box]:
        """Messages in what is free, the sheet of keys over all; returns what takes clicks."""
        boxes = draw_messages(self._messages, free, ui_scale)
        if self.keys_open:
            box, closed = draw_keys(more_keys, ui_scale)
            boxes.append(box)
            self.keys_open = not closed
        return boxes


def speak_first(settings: ProgramSettings, messages: Messages) -> None:
    """The language of the settings, before the window opens; English where no font has it."""
    language = all_languages().get(settings.language)
    if language is not None and not is_offered(language.code):
        messages.fail(why_not(language))
        language = None
    use_language(language.code if language is not None else "")
