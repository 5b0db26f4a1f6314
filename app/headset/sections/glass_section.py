"""Of the panel's section "Look": which stop is seen through a round glass in the hand."""

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.panel_rows import item_label, subsection
from shapeshift.app.editor.texts.table import said
from shapeshift.app.headset.over.glass_state import stop_names
from shapeshift.app.headset.sections.comfort_section import lit_button
from shapeshift.app.headset.xr_user import XrState

COLUMNS = 3
NONE, HELP = "no glass", "It is in the hand of the panel once the panel is closed."


def draw_glass(state: XrState) -> None:
    """A button for no glass and one for each stop, lit where it is chosen."""
    names = stop_names(state.editor)
    if not names or not subsection("Glass", bool(state.glass.stop)):
        return
    glass, gap = state.glass, imgui.get_style().item_spacing.x
    width = (imgui.get_content_region_avail().x - gap * (COLUMNS - 1)) / COLUMNS
    imgui.push_id("glass")
    if lit_button(item_label(NONE), not glass.stop, width):
        glass.stop = ""
    for number, name in enumerate(names, 1):
        if number % COLUMNS:
            imgui.same_line()
        if lit_button(f"{name}###glass {number}", glass.stop == name, width):
            glass.stop = name
    imgui.pop_id()
    if glass.stop:
        imgui.push_text_wrap_pos(0)
        imgui.text_disabled(said(HELP))
        imgui.pop_text_wrap_pos()
