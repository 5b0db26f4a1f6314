"""The panel's section "Stops": a button for each, play and pause, and how x plays by itself."""

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import choice, item_label, slider, tip
from shapeshift.app.editor.state.arrange import go_to_stop
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.track import is_blend
from shapeshift.app.editor.texts.table import said
from shapeshift.runtime_models.model import Stop
from shapeshift.scene.control import EASES, MODES, Sweep

Vec = imgui.ImVec2
LONGEST_LEG_S = 20.0
SHORTEST_LEG_S = 0.2
LONGEST_REST_S = 10.0
MODE_NAMES = {"ping-pong": "there and back", "loop": "round and round", "once": "once"}
COLUMNS = 3
MENU, MENU_WIDTH = "pace", 260.0  # the list that opens where the seconds stand; logical pixels


def draw_stops(state: EditorState, ui_scale: float) -> None:
    """Of every object that has some: the stops to go to, play and pause, the pace."""
    for index in state.sliders:
        imgui.push_id(index)
        if len(state.tracks) > 1:
            imgui.text_disabled(state.scene.objects[index].name)
        _stop_buttons(state, index, ui_scale)
        playing = state.sweeps[index].playing
        gap = imgui.get_style().item_spacing.x
        width = (imgui.get_content_region_avail().x - gap) / 2
        if imgui.button(item_label("Pause" if playing else "Play"), Vec(width, 0)):
            state.toggle_play(index)
        tip("Key Space plays and pauses all objects.", ui_scale)
        imgui.same_line()
        pace_button(state, index, width, "a stop", ui_scale)
        imgui.pop_id()
    if not state.sliders:
        nothing = (
            "There is one stop: nothing to slide." if state.scene.objects else "Nothing is open."
        )
        imgui.text_disabled(said(nothing))


def _stop_buttons(state: EditorState, index: int, ui_scale: float) -> None:
    """One for each stop, lit where x is."""
    gap = imgui.get_style().item_spacing.x
    stops = state.stops(index)
    columns = min(COLUMNS, max(len(stops), 1))
    width = (imgui.get_content_region_avail().x - gap * (columns - 1)) / columns
    for number, stop in enumerate(stops):
        if number % columns:
            imgui.same_line()
        obj = state.scene.objects[index]
        lit = abs(stop.x - obj.slider_x) < 1e-3 and not is_blend(obj.x)
        if lit:
            imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.ACCENT, 1))
        if imgui.button(f"{stop.name}###stop {number}", Vec(width, 0)):
            go_to_stop(state, index, number)
        if lit:
            imgui.pop_style_color()
        tip(stop_tip(stop, number), ui_scale)


def stop_tip(stop: Stop, number: int) -> str:
    """Its name, its x, and its key where it has one."""
    if number < 9:
        return said("{name}: x {x:.3f}, key {key}", name=stop.name, x=stop.x, key=number + 1)
    return f"{stop.name}: x {stop.x:.3f}"


def pace_button(state: EditorState, index: int, width: float, words: str, ui_scale: float) -> None:
    """The seconds from stop to stop; a click opens all settings of playing."""
    seconds = f"{state.sweeps[index].leg_s:.3g} s"
    fits = imgui.calc_text_size(f"{seconds} {said(words)}").x < width
    label = f"{seconds} {said(words)}" if words and fits else seconds
    if imgui.button(f"{label}###pace", Vec(width, 0)):
        imgui.open_popup(MENU)
    tip("How playing goes: seconds from stop to stop, there and back, which stops.", ui_scale)
    imgui.set_next_window_size(Vec(MENU_WIDTH * ui_scale, 0))
    if imgui.begin_popup(MENU):
        _sweep(state, index, ui_scale)
        imgui.end_popup()


def _sweep(state: EditorState, index: int, ui_scale: float) -> None:
    """How fast and which way one object's x plays, and through which stops."""
    sweep = state.sweeps[index]
    imgui.push_item_width(-1)
    sweep.leg_s = slider(
        "leg", sweep.leg_s, SHORTEST_LEG_S, LONGEST_LEG_S, "%.1f s from stop to stop"
    )
    tip("How long the way from one stop to the next takes.", ui_scale)
    sweep.rest_s = slider(
        "rest", sweep.rest_s, 0.0, LONGEST_REST_S, "%.1f s of rest at stops", "no rest at stops"
    )
    tip("How long it stays at each stop.", ui_scale)
    sweep.mode = choice("mode", sweep.mode, MODES, [MODE_NAMES[mode] for mode in MODES])
    tip("What happens after the last stop.", ui_scale)
    sweep.ease = choice(
        "ease", sweep.ease, EASES, [said("pace: {name}", name=said(name)) for name in EASES]
    )
    tip("How speed changes on the way from one stop to the next.", ui_scale)
    imgui.pop_item_width()
    if any(stop.date for stop in state.stops(index)):
        _, sweep.by_date = imgui.checkbox(item_label("even in time"), sweep.by_date)
        tip("Ways take as long as the dates of their stops are apart.", ui_scale)
    _visited(state, index, sweep, ui_scale)


def _visited(state: EditorState, index: int, sweep: Sweep, ui_scale: float) -> None:
    """A box for each stop; two at least are visited."""
    for stop in state.stops(index):
        changed, on = imgui.checkbox(f"{stop.name}##{stop.x}", stop.x in sweep.xs)
        tip("Visited while playing; two stops at least are.", ui_scale)
        if changed:
            state.visit(index, stop.x, on)
