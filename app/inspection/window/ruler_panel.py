"""The panel's section "Measure": what clicks lay, what was measured, the scale, a report."""

from collections.abc import Callable
from dataclasses import dataclass, field

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import button_row, choice, item_label, tip
from shapeshift.app.editor.texts.table import said
from shapeshift.app.inspection.window.ruler import Ruler, parse_length
from shapeshift.scene.inspection.lengths import UNITS

Vec = imgui.ImVec2
KIND_LABELS = {"distance": "Distance", "polyline": "Way", "angle": "Angle", "area": "Area"}
KIND_TIPS = {
    "Distance": "Between two points on the surface.",
    "Way": "Along any number of points; Enter or a double click ends it.",
    "Angle": "Of three points, at the second one.",
    "Area": "Of three corners or more, in order; Enter or a click on the first one ends it.",
}
ACTIONS = {
    "Save lengths": "All that is not saved; lengths go into NAME.marks.json beside the scene.",
    "Report": "One HTML file with a picture and a table of this view, among the exports.",
}


@dataclass
class RulerActions:
    """What the section's buttons do, and the unit in which it speaks."""

    toggle: Callable[[], None]
    save: Callable[[], object]
    report: Callable[[], None]
    unit: Callable[[], str]
    choose_unit: Callable[[str], None]
    typed: dict[str, str] = field(default_factory=dict)  # known lengths, as they are being typed


def draw_ruler(ruler: Ruler, actions: RulerActions, ui_scale: float) -> None:
    """All of the section."""
    changed, _ = imgui.checkbox(item_label("measure"), ruler.on)
    tip("Click points on the surface; a drag orbits. Key Shift+Y.", ui_scale)
    if changed:
        actions.toggle()
    _kinds(ruler, actions, ui_scale)
    unit = actions.unit()
    if ruler.lengths:
        _table(ruler, unit, ui_scale)
    if ruler.chosen in {each.name for each in ruler.lengths}:
        _chosen(ruler, actions, unit, ui_scale)
    imgui.set_next_item_width(-1)
    labels = [said("lengths in {unit}", unit=name) for name in UNITS]
    wanted = choice("unit of lengths", unit, list(UNITS), labels)
    tip("Of lengths here and in reports; areas in its square.", ui_scale)
    if wanted != unit:
        actions.choose_unit(wanted)
    if ruler.scale.factor != 1:
        imgui.text_disabled(said("lengths times {factor:.4g}", factor=ruler.scale.factor))
        imgui.same_line()
        if imgui.small_button(item_label("As in the file")):
            ruler.forget_scale()
        tip("Forgets the known length.", ui_scale)
    clicked = button_row(ACTIONS, ui_scale, 2)
    if clicked == "Save lengths":
        actions.save()
    elif clicked:
        actions.report()


def _kinds(ruler: Ruler, actions: RulerActions, ui_scale: float) -> None:
    """A button a kind, two to a row; the one that clicks lay is lit."""
    gap = imgui.get_style().item_spacing.x
    width = (imgui.get_content_region_avail().x - gap) / 2
    for number, (kind, label) in enumerate(KIND_LABELS.items()):
        lit = ruler.on and kind == ruler.kind
        if number % 2:
            imgui.same_line()
        if lit:
            imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.ACCENT, 1))
        if imgui.button(item_label(label), Vec(width, 0)):
            ruler.choose_kind(kind)
            if not ruler.on:
                actions.toggle()
        if lit:
            imgui.pop_style_color()
        tip(KIND_TIPS[label], ui_scale)


def _table(ruler: Ruler, unit: str, ui_scale: float) -> None:
    """A row a length, by which it is chosen."""
    if not imgui.begin_table("##lengths", 2, imgui.TableFlags_.sizing_stretch_prop):
        return
    for each in ruler.lengths:
        imgui.table_next_row()
        imgui.table_set_column_index(0)
        chosen = each.name == ruler.chosen
        span = imgui.SelectableFlags_.span_all_columns
        if imgui.selectable(f"{each.name}##length {each.name}", chosen, span)[0]:
            ruler.chosen = "" if chosen else each.name
        tip(each.note or said("Choose it to rename, note or delete it."), ui_scale)
        imgui.table_set_column_index(1)
        imgui.text_unformatted(ruler.measured(each).words(unit))
    imgui.end_table()


def _chosen(ruler: Ruler, actions: RulerActions, unit: str, ui_scale: float) -> None:
    """Name, note and known length of what is chosen, to be typed, and Delete."""
    name = ruler.chosen
    each = next(length for length in ruler.lengths if length.name == name)
    enter = imgui.InputTextFlags_.enter_returns_true
    width = imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x
    if theme.has_keys():
        imgui.set_next_item_width(0.6 * width)
        done, text = imgui.input_text(f"##name of length {name}", name, enter)
        tip("Its name; Enter takes it over.", ui_scale)
        if done and text != name and ruler.name_length(name, text):
            name = ruler.chosen
        imgui.same_line()
    if imgui.button(item_label("Delete"), Vec(-1, 0)):
        ruler.delete(name)
        return
    tip("Delete it; Ctrl+Z brings it back.", ui_scale)
    if not theme.has_keys():
        return
    imgui.set_next_item_width(-1)
    hint = said("note")
    done, text = imgui.input_text_with_hint(f"##note of length {name}", hint, each.note, enter)
    tip("A line about it, for the report; Enter takes it over.", ui_scale)
    if done:
        ruler.write_note(name, text)
    if each.kind != "distance":
        return
    imgui.set_next_item_width(0.6 * width)
    typed = actions.typed.get(name, "")
    hint = said("known, {unit}", unit=unit)
    done, text = imgui.input_text_with_hint(f"##known {name}", hint, typed, enter)
    actions.typed[name] = text
    tip("What this distance is in truth, such as 0.75 or 75 cm: all lengths follow.", ui_scale)
    imgui.same_line()
    metres = parse_length(text, unit)
    imgui.begin_disabled(metres is None)
    pressed = imgui.button(item_label("Set scale"), Vec(-1, 0))
    imgui.end_disabled()
    tip("All lengths are scaled so that this one is what was typed.", ui_scale)
    if (done or pressed) and metres is not None and ruler.know(name, metres):
        actions.typed.pop(name, None)
