"""The panel's section "Parts": things and junk of a captured scene, taken out of it."""

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import (
    button_row,
    choice,
    item_label,
    slider,
    tip,
)
from shapeshift.app.editor.state.messages import number
from shapeshift.app.editor.state.parts.parts_lit import (
    BINS,
    DISTANCE,
    QUANTITIES,
    SIZE,
    Histogram,
)
from shapeshift.app.editor.state.parts.parts_tool import REPLACE, PartsTool
from shapeshift.app.editor.state.parts.selecting import ALL, COLOR, DRAGS, LASSO, SPHERE, THING
from shapeshift.app.editor.texts.table import said
from shapeshift.scene.pick import anchor_places

# A histogram of an object's anchors in the section "Parts": a drag over it chooses them.

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


MOST_BRUSH = 120.0  # logical pixels
AXES = ("left", "right"), ("low", "high"), ("back", "front")  # ends of x, y and z
DEEDS = {
    "Object": "Make it an object that can be moved, hidden and thrown. Enter.",
    "Hide": "An object that is not seen; its box in Objects shows it again.",
    "Delete": "Gone, and not in what is saved. Key Delete; Ctrl+Z brings it back.",
}
SIZES = {
    "Less": "The next click takes less than it means. Ctrl+wheel.",
    "More": "The next click takes more than it means. Ctrl+wheel.",
}
CHOICES = {
    "None": "Choose nothing. Esc.",
    "Invert": "Everything else of the object.",
    "Crop\u2026": "A box; all outside of it goes.",
}
FLOATERS = "Junk in the air: small groups apart, huge faint splats. Look, then press Delete."
DRAG_WORDS = {
    THING: "drag: the thing in a box",
    ALL: "drag: all in a box",
    LASSO: "drag: all in a lasso",
    SPHERE: "drag: a sphere about a place",
    COLOR: "click: a colour, everywhere",
}
LEAST_LIKENESS, MOST_LIKENESS = 0.01, 0.4  # of Oklab


def draw_parts(
    tool: PartsTool, ui_scale: float, how: str = REPLACE, eye: np.ndarray | None = None
) -> None:
    """All of the section; `how` is what the keys that are held make of a choice, and `eye` (3,)
    metres, world, from where colours are seen.
    """
    changed, _ = imgui.checkbox(item_label("take things out"), tool.on)
    tip("Point at a thing and it lights up; a click chooses it. Key O.", ui_scale)
    if changed:
        tool.toggle()
    if not tool.on:
        return
    if tool.crop is not None:
        draw_crop(tool, tool.crop, ui_scale)
        return
    chosen = chosen_words(tool)
    imgui.push_text_wrap_pos(0)
    imgui.text_disabled(chosen)
    imgui.pop_text_wrap_pos()
    imgui.begin_disabled(not tool.count)
    clicked = button_row(DEEDS, ui_scale, 3)
    imgui.end_disabled()
    if clicked:
        {"Object": tool.make, "Hide": tool.hide, "Delete": tool.delete}[clicked]()
    size = f"{100 * tool.factor:.0f} %" if tool.factor != 1 else ""
    clicked = button_row(SIZES, ui_scale, 2)
    if clicked:
        tool.grow(1.0 if clicked == "More" else -1.0)
    if size:
        imgui.text_disabled(said("a click takes {size} of what it means", size=size))
    clicked = button_row(CHOICES, ui_scale, 3)
    if clicked:
        {"None": tool.clear, "Invert": tool.invert, "Crop\u2026": tool.begin_crop}[clicked]()
    eye = np.zeros(3) if eye is None else eye
    if imgui.button(item_label("Floaters"), Vec(-1, 0)):
        tool.selecting.propose_floaters(eye, how)
    tip(FLOATERS, ui_scale)
    if theme.has_keys():  # a hand in a headset draws no boxes
        draw_hand(tool, ui_scale)
        draw_histogram(tool, how, eye, ui_scale)


def chosen_words(tool: PartsTool) -> str:
    """How many anchors are chosen, and of what."""
    if not tool.count:
        return said("nothing is chosen")
    return said("{count} anchors of {name}", count=number(tool.count), name=tool.name)


def draw_hand(tool: PartsTool, ui_scale: float) -> None:
    """What the left button does in the picture, and the size of the brush."""
    select = tool.selecting
    imgui.push_item_width(-1)
    select.drag = choice("drag", select.drag, DRAGS, [DRAG_WORDS[drag] for drag in DRAGS])
    tip("A thing in front of others, or all that shows there, behind it too. Key U.", ui_scale)
    if select.drag == COLOR:
        select.likeness = slider(
            "likeness", select.likeness, LEAST_LIKENESS, MOST_LIKENESS, "as unlike as: %.2f"
        )
        tip("How far a colour may be from the one that is clicked: black to white is 1.", ui_scale)
    else:
        regions = tool.state.regions
        regions.brush = slider("brush", regions.brush, 3.0, MOST_BRUSH, "brush: %.0f px")
        tip("Hold B and drag to add anchors, with Shift or Alt to remove them.", ui_scale)
    imgui.pop_item_width()


def draw_crop(tool: PartsTool, crop: np.ndarray, ui_scale: float) -> None:
    """Six sides of the crop box, in the object's frame, and what to do with it."""
    if tool.index is None:
        return
    places = anchor_places(tool.state.scene.objects[tool.index].model)
    low, high = np.nanmin(places, axis=0), np.nanmax(places, axis=0)
    imgui.push_item_width(-1)
    for axis, names in enumerate(AXES):
        for side, name in enumerate(names):
            value = float(crop[side, axis])
            new = slider(name, value, float(low[axis]), float(high[axis]), f"{said(name)}: %.2f m")
            tip("A side of the box; what is red goes.", ui_scale)
            if new != value:
                tool.move_crop_side(axis, side, new)
    imgui.pop_item_width()
    gone = int(tool.outside().sum())
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.ACCENT, 1))
    if imgui.button(said("Crop: {count} anchors go", count=number(gone)) + "###crop", Vec(-1, 0)):
        tool.apply_crop()
    imgui.pop_style_color()
    tip("All outside the box is deleted, in one step. Enter.", ui_scale)
    if imgui.button(item_label("Cancel"), Vec(-1, 0)):
        tool.crop = None
    tip("Nothing goes. Esc.", ui_scale)
