"""A histogram of an object's anchors in the section "Parts": a drag over it chooses them."""

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import choice, tip
from shapeshift.app.editor.state.messages import number
from shapeshift.app.editor.state.parts.anchor_numbers import (
    BINS,
    DISTANCE,
    QUANTITIES,
    SIZE,
    Histogram,
)
from shapeshift.app.editor.state.parts.parts_tool import PartsTool
from shapeshift.app.editor.texts.table import said

Vec = imgui.ImVec2
TALL = 64.0  # logical pixels
EXPLAINED = {
    "size": "The longest sigma of a splat, metres.",
    "opacity": "0: not there, 1: nothing behind it is seen.",
    "brightness": "0: black, 1: white.",
    "distance": "Metres from the middle.",
}


def draw_histogram(tool: PartsTool, how: str, eye: np.ndarray, ui_scale: float) -> None:
    """Which quantity, its bars, and the values at their ends; `how` is what a drag does."""
    select = tool.selecting
    imgui.push_item_width(-1)
    measuring = select.measuring
    labels = [said("all anchors by {quantity}", quantity=said(name)) for name in QUANTITIES]
    measuring.quantity = choice("quantity", measuring.quantity, QUANTITIES, labels)
    tip(EXPLAINED[measuring.quantity], ui_scale)
    imgui.pop_item_width()
    histogram = select.histogram(eye)
    corner, size = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
    size = Vec(size.x, TALL * ui_scale)
    imgui.invisible_button("##histogram", size)
    tip("Drag over it to choose these anchors; Shift adds, Alt removes.", ui_scale)
    draw = imgui.get_window_draw_list()
    end = Vec(corner.x + size.x, corner.y + size.y)
    draw.add_rect_filled(corner, end, theme.color(theme.RAISED), 4 * ui_scale)
    if histogram is None:
        imgui.text_disabled(measuring.status or "\u2026")
        return
    held = _hold(tool, histogram, corner.x, size.x, how)
    _bars(draw, histogram, _chosen_counts(tool, histogram), corner, size, held)
    _ends(histogram, held)


def _hold(
    tool: PartsTool, histogram: Histogram, left: float, width: float, how: str
) -> tuple[int, int] | None:
    """The bins that the mouse has been dragged over; they are chosen when it lets go."""
    select = tool.selecting
    place = (imgui.get_mouse_pos().x - left) / max(width, 1.0) * BINS
    now = int(np.clip(place, 0, BINS - 1))
    if imgui.is_item_activated():
        select.held = (now, now)
    elif select.held is not None and imgui.is_item_active():
        select.held = (select.held[0], now)
    elif select.held is not None:
        first, last = select.held
        select.held = None
        select.range(histogram, first, last, how)
    return select.held


def _chosen_counts(tool: PartsTool, histogram: Histogram) -> np.ndarray:
    """(BINS,) of the chosen anchors, counted once for each choice."""
    select = tool.selecting
    if len(tool.chosen) != len(histogram.bin_of):
        return np.zeros(BINS, int)
    kept = select.counted
    if kept is None or kept[0] is not tool.chosen or kept[1] is not histogram:
        kept = select.counted = (tool.chosen, histogram, histogram.counts_of(tool.chosen))
    return kept[2]


def _bars(
    draw: imgui.ImDrawList, histogram: Histogram, chosen: np.ndarray, corner: imgui.ImVec2,
    size: imgui.ImVec2, held: tuple[int, int] | None,
) -> None:  # fmt: skip
    """Square roots of counts, so that a few among thousands are seen; the chosen ones in colour."""
    most = float(np.sqrt(max(histogram.counts.max(), 1)))
    each, low = size.x / BINS, corner.y + size.y
    if held is not None:
        first, last = sorted(held)
        ink = theme.color(theme.ACCENT, 0.25)
        edge = corner.x + (last + 1) * each
        draw.add_rect_filled(Vec(corner.x + first * each, corner.y), Vec(edge, low), ink)
    for counts, rgb in ((histogram.counts, theme.MUTED), (chosen, theme.ACCENT)):
        color = theme.color(rgb)
        for place in np.flatnonzero(counts):
            tall = max(float(np.sqrt(counts[place])) / most * (size.y - 4), 1.0)
            x = corner.x + float(place) * each
            draw.add_rect_filled(Vec(x, low - tall), Vec(x + max(each - 0.5, 1.0), low), color)


def _ends(histogram: Histogram, held: tuple[int, int] | None) -> None:
    """The values at the ends of the bars, or of what the mouse is dragged over."""
    first, last = sorted(held) if held is not None else (0, BINS - 1)
    low, high = (value_text(histogram, bin) for bin in (first, last + 1))
    if held is None:
        imgui.text_disabled(low)
        imgui.same_line()
        room = imgui.get_content_region_avail().x - imgui.calc_text_size(high).x
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(room, 0.0))
        imgui.text_disabled(high)
        return
    count = int(histogram.counts[first : last + 1].sum())
    imgui.text_unformatted(
        said("{low} to {high}: {count}", low=low, high=high, count=number(count))
    )


def value_text(histogram: Histogram, edge: int) -> str:
    """An edge between two bins, with its unit: "12 mm", "0.50"."""
    value = float(histogram.edges[edge])
    if histogram.name not in (SIZE, DISTANCE):
        return f"{value:.2f}"
    return f"{value:.3g} m" if value >= 1 else f"{value * 100:.3g} cm" if value >= 0.01 else (
        f"{value * 1000:.2g} mm"
    )  # fmt: skip
