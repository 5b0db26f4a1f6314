"""What belongs to the chosen mark: a note, a photo, the mark that is taken off it."""

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import choice, item_label, tip
from shapeshift.app.editor.state.inspecting import Inspecting
from shapeshift.app.editor.texts.table import said


def draw_about_mark(tool: Inspecting, name: str, ui_scale: float) -> None:
    """Below the mark's name."""
    mark = tool.mark(name)
    if theme.has_keys():
        imgui.set_next_item_width(-1)
        enter = imgui.InputTextFlags_.enter_returns_true
        hint = said("note")
        done, text = imgui.input_text_with_hint(f"##note of {name}", hint, mark.note, enter)
        tip("A line about it, for the report; Enter takes it over.", ui_scale)
        if done:
            tool.write_note(name, text)
    others = [other.name for other in tool.file.marks if other.name != name]
    if others:
        imgui.set_next_item_width(-1)
        less = tool.less_of(name)
        labels = [said("difference: none"), *(said("less {name}", name=each) for each in others)]
        wanted = choice(f"less of {name}", less, ["", *others], labels, names=True)
        tip("Its mean less that of another mark, below the table and in reports.", ui_scale)
        if wanted != less:
            tool.take_off(name, wanted)
    if mark.photo:
        if imgui.button(item_label("Remove its photo"), imgui.ImVec2(-1, 0)):
            tool.drop_photo(name)
        tip("The photo that was dropped for it; reports show it.", ui_scale)
    elif theme.has_keys():
        imgui.push_text_wrap_pos(0)
        imgui.text_disabled(said("Drop a photo of it on the window, for reports."))
        imgui.pop_text_wrap_pos()
