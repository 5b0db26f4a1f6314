"""The panel's section "Inspect": marks with their values, isotherms, level and span, a report."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.scale_bar import in_unit
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import button_row, choice, item_label, tip
from shapeshift.app.editor.texts.table import said
from shapeshift.app.inspection.window.inspecting import Inspecting
from shapeshift.scene.inspection.air import FARTHEST_M, Air
from shapeshift.scene.inspection.emissivity import (
    KELVINS,
    LEAST_EMISSIVITY,
    SurfaceRadiation,
)
from shapeshift.scene.inspection.marks import Bound

Vec = imgui.ImVec2
COLUMNS = ("min", "mean", "max")
BOUND_TIPS: dict[Bound, str] = {
    "above": "All that is hotter is red, over every stop.",
    "below": "All that is colder is blue, over every stop.",
}
VALUE_TIPS: dict[Bound, str] = {  # of other values than heat
    "above": "All that is higher is red, over every stop.",
    "below": "All that is lower is blue, over every stop.",
}
AUTO_TIPS = (  # of heat, and of other values
    "The palette shows what this view has, from its coldest to its hottest.",
    "The palette shows what this view has, low to high.",
)
USUAL_EMISSIVITY = 0.95  # of most paints, and of brick, wood, rubber
EMISSIVITY = (
    "Readings become temperatures of surfaces; colours and their scale stay as photographed."
)
MEASURES = (
    "Click a spot, drag a box, Shift+drag a line, Ctrl+drag a circle; right drag orbits. Key Y."
)


@dataclass(frozen=True)
class InspectActions:
    """What the section's buttons do."""

    toggle: Callable[[], None]  # the tool
    auto: Callable[[], None]  # level and span of what is seen
    save: Callable[[], object]
    report: Callable[[], None] | None = None  # None: it is not offered


def draw_inspect(tool: Inspecting, actions: InspectActions, wanted: str, ui_scale: float) -> None:
    """All of the section; wanted: a unit of temperature instead of the stop's own."""
    measured = tool.measured
    if measured is None:
        imgui.text_wrapped(said("The values of these objects do not agree; show one."))
        return
    changed, _ = imgui.checkbox(item_label("lay marks"), tool.on)
    tip(MEASURES, ui_scale)
    if changed:
        actions.toggle()
    unit = in_unit(measured.stop.unit, 0, 1, wanted)[0]
    if tool.file.marks:
        _table(tool, wanted, unit, ui_scale)
    for of, less in tool.file.differences:
        _difference(tool, of, less, wanted)
    if tool.chosen:
        _chosen(tool, ui_scale)
    heat, digits = measured.stop.kind != "values", measured.stop.digits
    for kind, words in (BOUND_TIPS if heat else VALUE_TIPS).items():
        _bound(tool, kind, words, wanted, ui_scale)
    if measured.stop.temperature_unit in KELVINS:
        _emissivity(tool, wanted, ui_scale)
        if tool.chosen_object:
            draw_own_emissivity(tool, tool.chosen_object, True, ui_scale)
    low, high = in_unit(measured.stop.unit, *tool.ends, wanted)[1:]
    level, span = (low + high) / 2, high - low
    if heat:
        imgui.text_disabled(said("level {level:.1f}, span {span:.1f}", level=level, span=span))
    else:
        ends = {"level": f"{level:.{digits}f}", "span": f"{span:.{digits}f}"}
        imgui.text_disabled(said("level {level}, span {span}", **ends))
    tips = {
        "Auto": AUTO_TIPS[not heat],
        "All values": "The palette shows all of the range that the photos could.",
    }
    clicked = button_row(tips, ui_scale, 2)
    if clicked == "Auto":
        actions.auto()
    elif clicked:
        tool.ends = tool.value_range
    tips = {
        "Save marks": "All that is not saved; marks go into NAME.marks.json beside the scene.",
        "Report": "One HTML file with pictures and tables of this view, among the exports.",
    }
    report = actions.report
    if report is None:
        del tips["Report"]
    clicked = button_row(tips, ui_scale, len(tips))
    if clicked == "Save marks":
        actions.save()
    elif clicked and report is not None:
        report()


def _table(tool: Inspecting, wanted: str, unit: str, ui_scale: float) -> None:
    """A row a mark, by which it is chosen."""
    flags = imgui.TableFlags_.sizing_stretch_prop
    if not imgui.begin_table("##marks", 1 + len(COLUMNS), flags):
        return
    imgui.table_next_row()
    for number, name in enumerate(("", *COLUMNS)):
        imgui.table_set_column_index(number)
        imgui.text_disabled(said(name) if name else unit)
    measured = tool.measured
    assert measured is not None  # draw_inspect has seen to it
    for mark in tool.file.marks:
        imgui.table_next_row()
        imgui.table_set_column_index(0)
        chosen = mark.name == tool.chosen
        span = imgui.SelectableFlags_.span_all_columns
        if imgui.selectable(f"{mark.name}##mark {mark.name}", chosen, span)[0]:
            tool.chosen = "" if chosen else mark.name
        tip("Choose it to rename or delete it.", ui_scale)
        reading = tool.readings.get(mark.name)
        if reading is None:
            continue
        values = (reading.least, reading.mean, reading.most)
        for number, value in enumerate(values[:1] if mark.kind == "spot" else values):
            imgui.table_set_column_index(2 if mark.kind == "spot" else 1 + number)
            shown = in_unit(measured.stop.unit, value, value, wanted)[1]
            digits = measured.stop.digits
            imgui.text_unformatted(f"{shown:.{digits}f}" if np.isfinite(shown) else "--")
    imgui.end_table()


def _difference(tool: Inspecting, of: str, less: str, wanted: str) -> None:
    """A row of two marks: the mean of the one less that of the other."""
    measured = tool.measured
    assert measured is not None  # draw_inspect has seen to it
    unit, one, none = in_unit(measured.stop.unit, tool.difference(of, less), 0.0, wanted)
    shown = f"{one - none:+.{measured.stop.digits}f} {unit}" if np.isfinite(one) else "--"
    imgui.text_unformatted(f"{of} \u2212 {less}   {shown}")


def _chosen(tool: Inspecting, ui_scale: float) -> None:
    """The name of the chosen mark, to be typed, and the button that deletes it."""
    name = tool.chosen
    if theme.has_keys():
        _name(tool, name, ui_scale)
        imgui.same_line()
    else:
        imgui.align_text_to_frame_padding()
        imgui.text_disabled(name)
        imgui.same_line()
    if imgui.button(item_label("Delete"), Vec(-1, 0)) and tool.chosen == name:
        tool.delete(name)
        return
    tip("Delete the mark; Ctrl+Z brings it back.", ui_scale)
    if tool.chosen == name:
        draw_about_mark(tool, name, ui_scale)


def _name(tool: Inspecting, name: str, ui_scale: float) -> None:
    """Of the chosen mark, to be typed."""
    gap = imgui.get_style().item_spacing.x
    imgui.set_next_item_width(0.6 * (imgui.get_content_region_avail().x - gap))
    done, text = imgui.input_text(
        f"##name of {name}", name, imgui.InputTextFlags_.enter_returns_true
    )
    tip("Its name; Enter takes it over.", ui_scale)
    if done and not tool.name_mark(name, text) and text != name:
        imgui.set_keyboard_focus_here(-1)


def _emissivity(tool: Inspecting, wanted: str, ui_scale: float) -> None:
    """Whether readings are of surfaces that mirror, and how much."""
    measured, emission = tool.measured, tool.file.emission
    assert measured is not None  # draw_inspect has seen to it
    changed, on = imgui.checkbox(item_label("emissivity"), emission is not None)
    tip(EMISSIVITY, ui_scale)
    if changed:
        tool.radiate(SurfaceRadiation(USUAL_EMISSIVITY) if on else None)
        emission = tool.file.emission
    if emission is None:
        return
    surface, own = emission.surface, measured.stop.unit
    width = imgui.get_window_size().x
    imgui.same_line(0.4 * width)
    imgui.set_next_item_width(0.22 * width)
    done, share = imgui.drag_float(
        "##emissivity", surface.emissivity, 0.005, LEAST_EMISSIVITY, 1.0, "%.2f"
    )
    tip("Of what is seen: 0.95 paint, brick, skin; 0.8 rusty steel; 0.2 bare metal.", ui_scale)
    imgui.same_line()
    imgui.set_next_item_width(-1)
    unit, shown, _ = in_unit(own, surface.reflected, surface.reflected, wanted)
    style = f"%.1f {unit.replace('%', '%%')}".rstrip()
    moved, mirrored = imgui.drag_float("##reflected", shown, 0.2, 0, 0, style)
    tip("Of what it mirrors: the room's walls, or the sky's.", ui_scale)
    back = in_unit(unit, mirrored, mirrored, own)[1] if unit != own else mirrored
    if done or moved:
        try:
            tool.radiate(SurfaceRadiation(share, back if moved else surface.reflected))
        except ValueError:  # typed and out of bounds: what was there stays
            return
    _air(tool, wanted, ui_scale)


def draw_own_emissivity(tool: Inspecting, name: str, of_object: bool, ui_scale: float) -> None:
    """Whether a mark, or an object, has an emissivity of its own, and which."""
    emission = tool.file.emission
    usual = USUAL_EMISSIVITY if emission is None else emission.surface.emissivity
    share = dict(tool.file.objects).get(name) if of_object else tool.mark(name).emissivity
    label = said("emissivity of {name}", name=name)
    changed, on = imgui.checkbox(f"{label}##own {of_object}", share is not None)
    tip("Its own, in every reading, alarm, picture and report.", ui_scale)
    if changed:
        share = usual if on else None
        tool.shine(name, share, of_object)
    if share is None:
        return
    imgui.same_line()
    imgui.set_next_item_width(-1)
    done, new = imgui.drag_float(
        f"##share {of_object} {name}", share, 0.005, LEAST_EMISSIVITY, 1.0, "%.2f"
    )
    tip("Of what is seen: 0.95 paint, brick, skin; 0.8 rusty steel; 0.2 bare metal.", ui_scale)
    if done and LEAST_EMISSIVITY <= new <= 1:
        tool.shine(name, new, of_object)


def _air(tool: Inspecting, wanted: str, ui_scale: float) -> None:
    """What lies between the camera and the surfaces: metres, per cent of humidity, temperature."""
    emission = tool.file.emission
    assert emission is not None  # _emissivity has seen to it
    air, width = emission.air, imgui.get_window_size().x
    imgui.align_text_to_frame_padding()
    imgui.text(said("air"))
    tip("The air takes some of the radiation of what is far, and adds its own.", ui_scale)
    imgui.same_line(0.3 * width)
    imgui.set_next_item_width(0.22 * width)
    far, metres = imgui.drag_float("##air metres", air.distance_m, 0.2, 0.0, FARTHEST_M, "%.1f m")
    tip("From the camera to what is seen, at the photos; 0: as if there were no air.", ui_scale)
    imgui.same_line()
    imgui.set_next_item_width(0.2 * width)
    wet, humidity = imgui.drag_float("##humidity", air.humidity, 0.5, 0.0, 100.0, "%.0f %%")
    tip("Relative humidity.", ui_scale)
    imgui.same_line()
    imgui.set_next_item_width(-1)
    unit, shown, _ = in_unit("°C", air.celsius, air.celsius, wanted)
    warm, typed = imgui.drag_float("##air temperature", shown, 0.2, 0, 0, f"%.1f {unit}")
    tip("Of the air.", ui_scale)
    back = in_unit(unit, typed, typed, "°C")[1] if unit != "°C" else typed
    if far or wet or warm:
        try:
            between = Air(metres, humidity, back if warm else air.celsius)
        except ValueError:  # typed and out of bounds: what was there stays
            return
        tool.radiate(emission.surface, between)


def _bound(tool: Inspecting, kind: Bound, words: str, wanted: str, ui_scale: float) -> None:
    """An isotherm: on or off, and its number."""
    measured, isotherm = tool.measured, tool.isotherm(kind)
    assert measured is not None  # draw_inspect has seen to it
    own = measured.stop.unit
    changed, on = imgui.checkbox(item_label(kind), isotherm is not None)
    tip(words, ui_scale)
    if changed:
        low, high = tool.ends
        tool.bound(kind, (low + (0.75 if kind == "above" else 0.25) * (high - low)) if on else None)
        isotherm = tool.isotherm(kind)
    if isotherm is None:
        return
    imgui.same_line(0.4 * imgui.get_window_size().x)
    imgui.set_next_item_width(-1)
    value = isotherm.low if kind == "above" else isotherm.high
    unit, shown, _ = in_unit(own, value, value, wanted)
    style = f"%.{measured.stop.digits}f {unit.replace('%', '%%')}".rstrip()
    low, high = in_unit(own, *tool.value_range, wanted)[1:]
    done, new = imgui.drag_float(f"##{kind}", shown, (high - low) / 500, 0, 0, style)
    tip("Drag it, or Ctrl+click it and type.", ui_scale)
    if done and np.isfinite(new) and abs(new) <= 1e6:
        tool.bound(kind, in_unit(unit, new, new, own)[1] if unit != own else new)


# What belongs to the chosen mark: a note, a photo, the mark that is taken off it.


def draw_about_mark(tool: Inspecting, name: str, ui_scale: float) -> None:
    """Below the mark's name."""
    mark = tool.mark(name)
    if mark.laid is not None:
        imgui.align_text_to_frame_padding()
        imgui.text_disabled(mark.laid.words())
        imgui.same_line()
        if imgui.button(item_label("Read anew"), Vec(-1, 0)):
            tool.lay_anew(name)
            return
        tip("Its value is that of its laying, then; this takes what this view reads.", ui_scale)
    measured = tool.measured
    if measured is not None and measured.stop.temperature_unit in KELVINS:
        draw_own_emissivity(tool, name, False, ui_scale)
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
