"""Notes and problems over the picture: a note fades, a problem stays until it is taken away."""

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import tip
from shapeshift.app.editor.panels.widgets.theme import Box
from shapeshift.app.editor.state.messages import Messages

Vec = imgui.ImVec2
WIDEST = 560.0  # logical pixels; longer sentences wrap
MARGIN, GAP = 16.0, 8.0
CROSS = 20.0  # side of the button that takes a problem away
STRIPE = 4.0  # its mark at the left


def draw_messages(messages: Messages, free: Box, ui_scale: float) -> list[Box]:
    """At the upper edge of what is free; returns where problems lie: they take clicks."""
    left, top, right, _ = free
    width = min(WIDEST * ui_scale, 0.94 * (right - left))
    middle, y = (left + right) / 2, top + MARGIN * ui_scale
    boxes = []
    for number, sentence in enumerate(reversed(messages.problems)):
        box = _problem(messages, number, sentence, Vec(middle - width / 2, y), width, ui_scale)
        boxes.append(box)
        y = box[3] + GAP * ui_scale
    if messages.note:
        draw_note(messages.note, Vec(middle, y), width)
    return boxes


def draw_note(text: str, at: imgui.ImVec2, width: float) -> None:
    """Over what lies there, which takes the clicks; `at` is the middle of its upper edge."""
    imgui.set_next_window_pos(at, 0, Vec(0.5, 0))
    flags = imgui.WindowFlags_
    imgui.begin(
        "##note",
        None,
        flags.no_decoration | flags.always_auto_resize | flags.no_inputs | flags.no_saved_settings
        | flags.no_focus_on_appearing,
    )  # fmt: skip
    room = width - 2 * imgui.get_style().window_padding.x
    imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + room)
    imgui.text_unformatted(text)
    imgui.pop_text_wrap_pos()
    imgui.end()


def _problem(
    messages: Messages, number: int, sentence: str, at: imgui.ImVec2, width: float, ui_scale: float
) -> Box:
    """A sentence with a cross at its right."""
    imgui.set_next_window_pos(at)
    imgui.set_next_window_size(Vec(width, 0))
    flags = imgui.WindowFlags_
    imgui.begin(
        f"##problem {number}",
        None,
        flags.no_decoration | flags.no_move | flags.no_saved_settings | flags.no_focus_on_appearing
        | flags.no_scroll_with_mouse,
    )  # fmt: skip
    side = CROSS * ui_scale
    start = imgui.get_cursor_pos()
    room = imgui.get_content_region_avail().x - side - GAP * ui_scale
    imgui.push_text_wrap_pos(start.x + room)
    imgui.text_unformatted(sentence)
    imgui.pop_text_wrap_pos()
    imgui.set_cursor_pos(Vec(start.x + room + GAP * ui_scale, start.y))
    if _cross(side, ui_scale):
        messages.dismiss(sentence)
    box = theme.window_box()
    imgui.get_window_draw_list().add_rect_filled(
        Vec(box[0], box[1]),
        Vec(box[0] + STRIPE * ui_scale, box[3]),
        theme.color(theme.WARNING),
        8 * ui_scale,
        imgui.ImDrawFlags_.round_left,
    )
    imgui.end()
    return box


def _cross(side: float, ui_scale: float) -> bool:
    corner = imgui.get_cursor_screen_pos()
    clicked = imgui.invisible_button("dismiss", Vec(side, side))
    hovered = imgui.is_item_hovered()
    tip("Take this away. Esc.", ui_scale)
    draw, inset = imgui.get_window_draw_list(), 0.28 * side
    if hovered:
        end = Vec(corner.x + side, corner.y + side)
        draw.add_rect_filled(corner, end, theme.color(theme.RAISED), 4.0)
    low, high = corner.x + inset, corner.x + side - inset
    top, bottom = corner.y + inset, corner.y + side - inset
    ink, wide = theme.color(theme.TEXT), max(1.5, side / 12)
    draw.add_line(Vec(low, top), Vec(high, bottom), ink, wide)
    draw.add_line(Vec(low, bottom), Vec(high, top), ink, wide)
    return clicked
