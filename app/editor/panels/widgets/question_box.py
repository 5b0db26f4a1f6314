"""A box in the middle of the window that wants an answer: its frame, and its row of buttons."""

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.panel_rows import item_label

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
