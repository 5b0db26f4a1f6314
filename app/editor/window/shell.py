"""What concerns the window and no scene: text size, language, folded panel, keys, messages."""

import re
from collections.abc import Callable, Mapping, Sequence

import glfw
from imgui_bundle import imgui

from shapeshift.app.editor.panels.messages_panel import draw_messages
from shapeshift.app.editor.panels.panel import PanelActions, chosen_tool
from shapeshift.app.editor.panels.scale_bar import KELVIN
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import choice, item_label, tip
from shapeshift.app.editor.panels.widgets.theme import Box
from shapeshift.app.editor.state.messages import Messages
from shapeshift.app.editor.state.user.settings import ProgramSettings, other_text_size
from shapeshift.app.editor.texts.fonts import is_offered, why_not
from shapeshift.app.editor.texts.table import all_languages, language_in_use, said, use_language
from shapeshift.app.editor.window.monitor import place_of
from shapeshift.app.editor.window.window import Event, KeyDown, Window

# The sheet of keys: everything that keys and mouse do, in groups; F1 opens and closes it.

Vec = imgui.ImVec2
Row = tuple[str, str]  # key, what it does
# What is printed on keys, and the text by which tables have it in the language of a keyboard.
KEY_WORDS = {
    "Ctrl": "the key Ctrl", "Shift": "the key Shift", "Space": "the key Space",
    "Enter": "the key Enter", "Delete": "the key Delete",
}  # fmt: skip
WORDS = re.compile(rf"\b({'|'.join(KEY_WORDS)})\b")
COLUMN = 330.0  # logical pixels, of a group
LONGEST_SEARCH = 60  # letters
KEY_PART = 0.40  # of a column, where what a key does begins
MOUSE_AND_CAMERA = (
    ("drag", "orbit; look about when flying"),
    ("right drag", "pan; look about when flying"),
    ("wheel", "nearer, farther"),
    ("double click", "centre that place"),
    ("V", "orbit or fly"),
    ("W A S D Q E", "move; Shift fast, Ctrl slow"),
    ("F", "frame everything"),
    ("Shift+F", "the first view"),
    ("numpad 1, 3, 7", "front, right, top; Ctrl: the other side"),
    ("numpad 5", "parallel rays, or those of an eye"),
    ("N, P", "next, previous camera of a file"),
    ("K", "keep this view in a file"),
)
SLIDER = (
    ("drag", "x from stop to stop; Alt: without snapping"),
    ("1 \u2013 9", "go to a stop"),
    ("left, right", "a hundredth of x"),
    ("Shift+left, right", "to the next stop"),
    ("Space", "play, pause"),
    ("number beside it", "click to type x, or a stop's name"),
)
REGIONS = (
    ("L", "lens on, off"),
    ("B + drag", "paint a region; Shift erases"),
    ("Esc", "leave the region"),
)
PROGRAM = (
    ("Ctrl+O", "open; or drop files on the window"),
    ("Ctrl+N", "an empty scene"),
    ("Ctrl+Z, Ctrl+Y", "undo, redo an edit"),
    ("Ctrl+S", "save the scene; Shift: as"),
    ("F12", "save a picture"),
    ("G, Shift+G", "debug views"),
    ("Ctrl +, Ctrl \u2013", "larger, smaller text; Ctrl 0 as at first"),
    ("Ctrl+click", "on a slider of the panel: type its number"),
    ("H, Tab", "hide all this"),
    ("F11", "full screen"),
    ("F1", "this sheet"),
)
GROUPS = {
    "Slider": SLIDER,
    "Camera": MOUSE_AND_CAMERA,
    "Program": PROGRAM,
    "Regions": REGIONS,
}


def found_groups(
    groups: Mapping[str, Sequence[Row]], first: Sequence[str], words: str
) -> dict[str, list[Row]]:
    """Those of the tool in hand `first`; of all the rows that have these words, in the language in
    use: all of a group whose heading has them.
    """
    wanted = words.casefold().split()

    def has(*texts: str) -> bool:
        whole = " ".join(texts).casefold()
        return all(word in whole for word in wanted)

    order = [name for name in first if name in groups]
    order += [name for name in groups if name not in order]
    found = {
        name: [row for row in groups[name] if has(said(name), key_text(row[0]), said(row[1]))]
        for name in order
    }
    return {name: rows for name, rows in found.items() if rows}


def draw_keys(
    more: dict[str, list[Row]], first: Sequence[str], words: str, ui_scale: float
) -> tuple[Box, bool, str]:
    """The sheet over the window's middle; `more` are groups of other parts of the program, `first`
    those of the tool in hand, `words` what is looked for.

    Returns where it is, whether it was closed, and what is looked for now.
    """
    screen = imgui.get_io().display_size
    groups = {**{name: list(rows) for name, rows in GROUPS.items()}, **more}
    columns = max(1, min(3, int(0.94 * screen.x / (COLUMN * ui_scale))))
    width = min(columns * COLUMN * ui_scale, 0.94 * screen.x)
    imgui.set_next_window_pos(Vec(screen.x / 2, screen.y / 2), 0, Vec(0.5, 0.5))
    imgui.set_next_window_size_constraints(Vec(width, 0), Vec(width, 0.94 * screen.y))
    flags = imgui.WindowFlags_
    imgui.push_style_color(imgui.Col_.window_bg, imgui.ImVec4(*theme.SURFACE, 0.98))
    imgui.begin(
        "##keys",
        None,
        flags.no_title_bar | flags.no_resize | flags.no_move | flags.no_saved_settings
        | flags.always_auto_resize,
    )  # fmt: skip
    imgui.pop_style_color()
    closed, words = _heading(words, ui_scale)
    groups = found_groups(groups, first, words)
    if not groups:
        imgui.text_disabled(said("No key has these words."))
    start, each = imgui.get_cursor_pos(), imgui.get_content_region_avail().x / columns
    lowest = start.y
    for column, names in enumerate(spread(groups, columns)):
        imgui.set_cursor_pos(Vec(start.x + column * each, start.y))
        for name in names:
            _group(name, groups[name], each, ui_scale)
        lowest = max(lowest, imgui.get_cursor_pos_y())
    imgui.set_cursor_pos(Vec(start.x, lowest))
    imgui.dummy(Vec(0, 0))  # the window reaches down to here
    box = theme.window_box()
    imgui.end()
    return box, closed, words


def _heading(words: str, ui_scale: float) -> tuple[bool, str]:
    """What is looked for, and the button that closes the sheet, at the right; whether it is to
    close.
    """
    start, room = imgui.get_cursor_pos(), imgui.get_content_region_avail().x
    width = 80 * ui_scale
    if imgui.is_window_appearing():
        imgui.set_keyboard_focus_here()
    imgui.set_next_item_width(min(room - width - 16 * ui_scale, 1.2 * COLUMN * ui_scale))
    hint = said("Keys and mouse: type to find one")
    _, words = imgui.input_text_with_hint("##find", hint, words[:LONGEST_SEARCH])
    left = imgui.is_item_focused() and imgui.is_key_pressed(imgui.Key.escape, False)
    tip("Words of what you want to do, or a key.", ui_scale)
    below = imgui.get_cursor_pos()
    imgui.set_cursor_pos(Vec(start.x + room - width, start.y))
    closed = imgui.button(item_label("Close"), Vec(width, 0))
    tip("F1 or Esc.", ui_scale)
    imgui.set_cursor_pos(Vec(below.x, below.y + 8 * ui_scale))
    return closed or left, words


def _group(name: str, rows: Sequence[Row], width: float, ui_scale: float) -> None:
    """A heading and its rows, one below the other from the cursor on."""
    left, gap = imgui.get_cursor_pos_x(), 16 * ui_scale
    imgui.text_colored(imgui.ImVec4(*theme.ACCENT, 1), said(name))
    for key, what in rows:
        imgui.set_cursor_pos_x(left)
        y = imgui.get_cursor_pos_y()
        imgui.push_text_wrap_pos(left + KEY_PART * width - gap / 4)
        imgui.text_unformatted(key_text(key))
        imgui.pop_text_wrap_pos()
        below = imgui.get_cursor_pos_y()
        imgui.set_cursor_pos(Vec(left + KEY_PART * width, y))
        imgui.push_text_wrap_pos(left + width - gap)
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.MUTED, 1))
        imgui.text_unformatted(said(what))
        imgui.pop_style_color()
        imgui.pop_text_wrap_pos()
        imgui.set_cursor_pos_y(max(below, imgui.get_cursor_pos_y()))
    imgui.set_cursor_pos(Vec(left, imgui.get_cursor_pos_y() + gap / 2))


def key_text(key: str) -> str:
    """A row's key as keyboards of the language in use have it."""
    text = said(key)
    if text != key and key not in KEY_WORDS:
        return text
    return WORDS.sub(lambda found: _printed(found[0]), key)


def _printed(word: str) -> str:
    text = KEY_WORDS[word]
    return word if said(text) == text else said(text)


def spread(groups: Mapping[str, Sequence[Row]], columns: int) -> list[list[str]]:
    """The groups' names by column, in their order, each to the column that is shortest so far."""
    out: list[list[str]] = [[] for _ in range(columns)]
    length = [0] * columns
    for name, rows in groups.items():
        at = length.index(min(length))
        out[at].append(name)
        length[at] += len(rows) + 2
    return out


LANGUAGES_WIDE = 240.0  # logical pixels, of what is said under the list
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
        self.keys_open, self._words = False, ""  # the sheet of keys, and what is looked for in it
        self.actions = PanelActions(
            self.fold, self.resize_text, self.show_keys, settings.sections, self.keep,
            lambda: settings.tool, self.choose_tool, self.draw_languages, set(),
        )  # fmt: skip

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

    def choose_tool(self, name: str) -> None:
        """Another tool of the bar; kept for the next start."""
        if name != self._settings.tool:
            self._settings.tool = name
            self.keep()

    def draw_settings(self, ui_scale: float) -> None:
        """What the section Settings has."""
        draw_settings(self._settings, self.keep, ui_scale)

    def draw_languages(self, ui_scale: float) -> None:
        """The list under the globe."""
        if not self._window.every_letter:
            self._window.restyle(every_letter=True)
        if (code := draw_languages(ui_scale)) != language_in_use().code:
            self.speak(code)

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
            first = chosen_tool(self._settings.tool).keys
            box, closed, self._words = draw_keys(more_keys, first, self._words, ui_scale)
            boxes.append(box)
            self.keys_open = not closed
        else:
            self._words = ""
        return boxes


def speak_first(settings: ProgramSettings, messages: Messages) -> None:
    """The language of the settings, before the window opens; English where no font has it."""
    language = all_languages().get(settings.language)
    if language is not None and not is_offered(language.code):
        messages.fail(why_not(language))
        language = None
    use_language(language.code if language is not None else "")


# The languages under the globe, and the panel's section "Settings": units, which the next start
# keeps.


def draw_languages(ui_scale: float) -> str:
    """Each language as its speakers write it, where a font has its letters; the chosen code."""
    languages, now = all_languages(), language_in_use().code
    offered = [code for code in languages if is_offered(code)]
    for code in offered:
        language = languages[code]
        if imgui.selectable(f"{language.own or language.name}###{code}", code == now)[0]:
            now = code
        tip("The language of this window. A file of texts is all that another one needs.", ui_scale)
    imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + LANGUAGES_WIDE * ui_scale)
    for code in languages.keys() - offered:
        imgui.text_disabled(why_not(languages[code]))
    imgui.pop_text_wrap_pos()
    return now


def draw_settings(settings: ProgramSettings, keep: Callable[[], None], ui_scale: float) -> None:
    """`keep` writes the settings."""
    imgui.push_item_width(-1)
    units = ["", *KELVIN]
    labels = [said("temperature: as filed"), *(said("temperature: {unit}", unit=u) for u in KELVIN)]
    known = settings.temperature if settings.temperature in units else ""
    unit = choice("temperature", known, units, labels)
    tip("The unit of the legend beside the picture.", ui_scale)
    if unit != known:
        settings.temperature = unit
        keep()
    imgui.pop_item_width()
