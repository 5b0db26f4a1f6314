"""The modality slider: a bar at the bottom with play, named stops that catch the hand, and x."""

from collections.abc import Sequence
from dataclasses import dataclass

from imgui_bundle import imgui

from shapeshift.app.editor.panels.sections.stops_panel import pace_button, stop_tip
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import tip
from shapeshift.app.editor.panels.widgets.theme import Box
from shapeshift.app.editor.state.arrange import go_to_stop, rejoin, steer_by_hand, unchain
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.shown_scene import leader_of, may_follow
from shapeshift.app.editor.state.track import Grip, Track, half_ways, read_x
from shapeshift.app.editor.texts.table import said
from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.stop_dates import calendar_ticks
from shapeshift.scene.control import SNAP

Vec = imgui.ImVec2
ROW = 46.0  # logical pixels
WIDEST_NAME = 140.0  # of an object beside its slider
VALUE, PACE, SPLIT = 54.0, 46.0, 30.0  # widths: the number, the seconds, the split's button
ROOMY = 380.0  # less than this in a row and the seconds are left to the panel's section Play
KNOB_INKS = (theme.ACCENT, theme.SECOND)
LINE = 0.68  # of a row's height: where the track runs, below the names of its stops
DATE_ROOM = 6.0  # lines of text that a tick of the calendar has at the least
KNOB, SLACK = 0.56, 0.2  # of a line of text: the knob's radius, and how far beside it it is taken


def draw_slider_bar(state: EditorState, bar: Box | None, ui_scale: float) -> Box:
    """One row an object at the lower edge: moves x, starts and stops playing; returns its box."""
    rows = state.sliders
    if not rows or bar is None:
        return (0.0, 0.0, 0.0, 0.0)
    left, _, right, low = bar
    imgui.set_next_window_pos(Vec(left, low), 0, Vec(0.0, 1.0))
    imgui.set_next_window_size(Vec(right - left, 0))
    flags = imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_move
    imgui.begin("##modality", None, flags | imgui.WindowFlags_.no_saved_settings)
    for index in rows:
        imgui.push_id(index)
        if len(rows) > 1:
            imgui.text_disabled(state.scene.objects[index].name)
        draw_slider(state, index, ui_scale)
        imgui.pop_id()
    box = theme.window_box()
    imgui.end()
    return box


def draw_slider(state: EditorState, index: int, ui_scale: float) -> None:
    """Play button, seconds a way, track, value of one object; without keys no value to type."""
    obj, sweep = state.scene.objects[index], state.sweeps[index]
    height = ROW * ui_scale
    if _play_button(sweep.playing, height, ui_scale):
        state.toggle_play(index)
    if imgui.get_content_region_avail().x > ROOMY * ui_scale:
        imgui.same_line(0, 8 * ui_scale)
        _pace(state, index, height, ui_scale)
    imgui.same_line(0, 14 * ui_scale)
    named = len(state.sliders) == 1 < len(state.tracks)  # one of several: say which
    name_width = min(imgui.calc_text_size(obj.name).x, WIDEST_NAME * ui_scale) if named else 0.0
    value_width = max(VALUE * ui_scale, name_width)
    after = SPLIT * ui_scale if state.split.possible else 0.0
    linked = _chained(state, index)
    after += SPLIT * ui_scale if linked is not None else 0.0
    beside = value_width + after + 12 * ui_scale if theme.has_keys() else 0.0
    room = imgui.get_content_region_avail().x - beside
    stops = state.stops(index)
    second = state.split.on and state.split.name == obj.name
    xs = (obj.slider_x, state.split.x) if second else (obj.slider_x,)
    moved = track(stops, xs, state.grip, height, room)
    if moved.stop is not None:
        go_to_stop(state, index, moved.stop)
    elif moved.knob == 1:
        state.split.x = moved.x
    elif moved.knob == 0:
        steer_by_hand(state, index, moved.x)
    if not theme.has_keys():
        return
    imgui.same_line(0, 0)
    origin = imgui.get_cursor_screen_pos()
    left = origin.x + 12 * ui_scale
    if named:
        imgui.push_clip_rect(origin, Vec(left + value_width, origin.y + height), True)
        draw = imgui.get_window_draw_list()
        draw.add_text(Vec(left, origin.y), theme.color(theme.TEXT), obj.name)
        imgui.pop_clip_rect()
    line_y = origin.y + height * LINE - imgui.get_frame_height() / 2
    imgui.set_cursor_screen_pos(Vec(left, line_y))
    _value(state, index, stops, ui_scale)
    if state.split.possible:
        imgui.set_cursor_screen_pos(Vec(left + VALUE * ui_scale + 6 * ui_scale, line_y))
        _split_button(state, index, second, ui_scale)
    if linked is not None:
        along = after - SPLIT * ui_scale
        imgui.set_cursor_screen_pos(Vec(left + (VALUE + 6) * ui_scale + along, line_y))
        _chain_button(state, linked, ui_scale)


def _chained(state: EditorState, index: int) -> int | None:
    """Whose chain stands on the slider of an object: of the chosen one that follows it, or its own,
    that could follow its scene; None: no chain.
    """
    chosen = state.chosen_index
    if chosen is not None and chosen in state.chain.of(state.scene, index)[1:]:
        return chosen
    leader = leader_of(state.scene)
    objects = state.scene.objects
    if leader is None or index == leader or not may_follow(objects[index], objects[leader]):
        return None
    return index


def _chain_button(state: EditorState, index: int, ui_scale: float) -> None:
    """Two links of a chain, apart where the object has a slider of its own."""
    side, name = imgui.get_frame_height(), state.scene.objects[index].name
    follows = index in state.chain.followers(state.scene)
    corner = imgui.get_cursor_screen_pos()
    if imgui.button("##chain", Vec(side, side)):
        (unchain if follows else rejoin)(state, index)
    if follows:
        tip(said("{name} follows the scene; a click gives it its own slider.", name=name), ui_scale)
    else:
        tip(said("A click lets {name} follow the scene again.", name=name), ui_scale)
    draw, half = imgui.get_window_draw_list(), 0.13 * side
    ink = theme.color(theme.ACCENT if follows else theme.TEXT)
    middle = Vec(corner.x + side / 2, corner.y + side / 2)
    gap = 0.05 * side if follows else 0.18 * side
    for sign in (-1, 1):
        near, far = middle.x + sign * (gap - 0.1 * side), middle.x + sign * (gap + 0.24 * side)
        low, high = min(near, far), max(near, far)
        draw.add_rect(
            Vec(low, middle.y - half), Vec(high, middle.y + half), ink, half,
            max(1.0, side / 14),
        )  # fmt: skip


def _split_button(state: EditorState, index: int, on: bool, ui_scale: float) -> None:
    """A square with a line down its middle."""
    side = imgui.get_frame_height()
    corner = imgui.get_cursor_screen_pos()
    if imgui.button("##split", Vec(side, side)):
        state.split.toggle(state.scene.objects[index], way=state.shifts.get(index))
    tip("Split: another stop right of a line, with a knob of its own. Key C.", ui_scale)
    draw, inset = imgui.get_window_draw_list(), 0.26 * side
    low = Vec(corner.x + inset, corner.y + inset)
    high = Vec(corner.x + side - inset, corner.y + side - inset)
    middle = corner.x + side / 2
    ink = theme.color(theme.SECOND if on else theme.TEXT)
    draw.add_rect(low, high, ink, 1.0, max(1.0, side / 18))
    draw.add_rect_filled(Vec(middle, low.y), high, ink)


def _value(state: EditorState, index: int, stops: Sequence[Stop], ui_scale: float) -> None:
    """x as a number that can be typed, or a stop's name; Enter or leaving it takes it over."""
    x = state.scene.objects[index].slider_x
    imgui.set_next_item_width(VALUE * ui_scale)
    flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
    entered, text = imgui.input_text("##x", f"{x:.3f}", flags)
    left = imgui.is_item_deactivated_after_edit() and not imgui.is_key_pressed(imgui.Key.escape)
    if entered or left:
        try:
            typed = read_x(text, stops)
        except ValueError as error:
            state.problem = str(error)
        else:
            if text.strip() != f"{x:.3f}":  # the rounded number that stood there is no new one
                steer_by_hand(state, index, typed)
    tip("x: type a number from 0 to 1, or a stop's name. Arrow keys: a hundredth.", ui_scale)


def _pace(state: EditorState, index: int, height: float, ui_scale: float) -> None:
    """The seconds from stop to stop, on the track's line."""
    corner = imgui.get_cursor_screen_pos()
    line_y = corner.y + height * LINE - imgui.get_frame_height() / 2
    imgui.set_cursor_screen_pos(Vec(corner.x, line_y))
    pace_button(state, index, PACE * ui_scale, "", ui_scale)
    imgui.set_cursor_screen_pos(corner)
    imgui.dummy(Vec(PACE * ui_scale, height))


def _play_button(playing: bool, height: float, ui_scale: float) -> bool:
    """A round button with a triangle or two bars; True when it is clicked."""
    radius = height * 0.36
    corner = imgui.get_cursor_screen_pos()
    clicked = imgui.invisible_button("play", Vec(2 * radius, height))
    centre = Vec(corner.x + radius, corner.y + height / 2)
    draw = imgui.get_window_draw_list()
    hovered = imgui.is_item_hovered()
    draw.add_circle_filled(centre, radius, theme.color(theme.ACCENT if hovered else theme.RAISED))
    ink = theme.color(theme.SURFACE if hovered else theme.TEXT)
    r = radius * 0.42
    if playing:
        for side in (-1, 1):
            left = centre.x + side * r * 0.65 - r * 0.28
            draw.add_rect_filled(
                Vec(left, centre.y - r), Vec(left + r * 0.56, centre.y + r), ink, 1.0
            )
    else:
        draw.add_triangle_filled(
            Vec(centre.x - r * 0.7, centre.y - r),
            Vec(centre.x - r * 0.7, centre.y + r),
            Vec(centre.x + r * 1.1, centre.y),
            ink,
        )
    tip("Pause. Space." if playing else "Play through the stops. Space.", ui_scale)
    return clicked


@dataclass(frozen=True)
class Moved:
    """What a hand does to a track in this frame."""

    knob: int | None = None  # that it holds; None: none
    x: float = 0.0  # of that knob
    stop: int | None = None  # number of the stop whose name was clicked


def track_ends(box: Box, line: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Where x = 0 and x = 1 lie of a track whose item fills a box, with type `line` high."""
    left, top, right, bottom = box
    reach, middle = (KNOB + SLACK) * line + 1.0, (top + bottom) / 2
    return (left + reach, middle), (right - reach, middle)


def track(
    stops: Sequence[Stop], xs: Sequence[float], grip: Grip, height: float, width: float = 0.0
) -> Moved:
    """The line with its ticks, names and knobs, the first one's part of it filled.

    Without a width it takes what there is.  A knob can be taken all over, also where it stands
    out beyond an end of the line.
    """
    line = imgui.get_text_line_height()
    radius = KNOB * line
    width = width if width > 0 else imgui.get_content_region_avail().x
    corner = imgui.get_cursor_screen_pos()
    along = Track(corner.x + radius, max(width - 2 * radius, 1.0), radius + SLACK * line)
    y = corner.y + height * LINE
    chosen = _stop_names(stops, xs, along, corner)
    reach = along.knob + 1.0  # so that a press on the very edge is within it
    imgui.set_cursor_screen_pos(Vec(along.left - reach, y - reach))
    imgui.invisible_button("track", Vec(along.width + 2 * reach, 2 * reach))
    # Where frames are slow the mouse has moved far between the last one and letting go.
    held = imgui.is_item_active() or imgui.is_item_deactivated()
    hovered = imgui.is_item_hovered()
    tip("Drag from stop to stop. Alt: without snapping to them.", line / theme.FONT_SIZE)
    io, xs = imgui.get_io(), list(xs)
    if imgui.is_item_activated():
        grip.press(along, xs, io.mouse_pos.x)
    held = held and grip.knob < len(xs)
    if held:
        reached = 0.0 if io.key_alt else SNAP
        xs[grip.knob] = grip.drag(along, xs[grip.knob], io.mouse_pos.x, stops, reached)
    _line(stops, xs[0], along, y)
    for number, (x, ink) in enumerate(zip(xs, KNOB_INKS, strict=False)):
        lit = grip.knob == number if held else hovered
        _knob(along.place(x), y, radius if lit else 0.86 * radius, ink)
    imgui.set_cursor_screen_pos(corner)
    imgui.dummy(Vec(width, height))
    return Moved(grip.knob, xs[grip.knob], chosen) if held else Moved(stop=chosen)


def _line(stops: Sequence[Stop], x: float, along: Track, y: float) -> None:
    """The line up to the knob and beyond, a dot at each stop and a small tick half-way between."""
    draw, line = imgui.get_window_draw_list(), imgui.get_text_line_height()
    half = max(2.0, line * 0.13)
    left, middle, right = (along.place(place) for place in (0.0, x, 1.0))
    for low, high, ink in (
        (left, right, theme.color(theme.TRACK)),
        (left, middle, theme.color(theme.ACCENT, 0.85)),
    ):
        draw.add_rect_filled(Vec(low, y - half), Vec(high, y + half), ink, half)
    dates = calendar_ticks(stops, round(along.width / (DATE_ROOM * line)))
    for tick in [x for x, _ in dates] or half_ways(stops):
        at, tall = along.place(tick), line * 0.3
        ink = theme.color(theme.MUTED)
        draw.add_line(Vec(at, y - tall), Vec(at, y + tall), ink, max(1.0, line / 12))
    for stop in stops:
        draw.add_circle_filled(Vec(along.place(stop.x), y), line * 0.24, theme.color(theme.TEXT))


def _knob(place: float, y: float, radius: float, ink: tuple[float, float, float]) -> None:
    draw = imgui.get_window_draw_list()
    draw.add_circle_filled(Vec(place, y), radius, theme.color(ink))
    draw.add_circle_filled(Vec(place, y), radius * 0.45, theme.color(theme.SURFACE))


def _stop_names(
    stops: Sequence[Stop], xs: Sequence[float], along: Track, corner: imgui.ImVec2
) -> int | None:
    """A name above each stop, lit where a knob is; returns the number of the one clicked.

    Where stops have dates, those of a calendar stand where names leave room.
    """
    draw = imgui.get_window_draw_list()
    line = imgui.get_text_line_height()
    low, high = along.left - KNOB * line, along.left + along.width + KNOB * line
    last_right = low - line  # names that would overlap the one before are left out
    taken: list[tuple[float, float]] = []  # from where to where a word stands
    clicked = None
    for number, stop in enumerate(sorted(stops, key=lambda stop: stop.x)):
        size = imgui.calc_text_size(stop.name)
        left = min(max(along.place(stop.x) - size.x / 2, low), high - size.x)
        if left < last_right + line * 0.5:
            continue
        last_right = left + size.x
        imgui.set_cursor_screen_pos(Vec(left, corner.y))
        if imgui.invisible_button(f"stop {number}", Vec(max(size.x, 1.0), line)):
            clicked = number
        hovered = imgui.is_item_hovered()
        tip(stop_tip(stop, number), line / theme.FONT_SIZE)
        on = [ink for x, ink in zip(xs, KNOB_INKS, strict=False) if abs(stop.x - x) < 1e-3]
        ink = theme.color(theme.ACCENT if hovered else (on or [theme.TEXT])[0])
        draw.add_text(Vec(left, corner.y), ink, stop.name)
        taken.append((left, left + size.x))
    for x, words in calendar_ticks(stops, round(along.width / (DATE_ROOM * line))):
        wide = imgui.calc_text_size(words).x
        left = min(max(along.place(x) - wide / 2, low), high - wide)
        if all(left > b + line * 0.5 or left + wide < a - line * 0.5 for a, b in taken):
            draw.add_text(Vec(left, corner.y), theme.color(theme.MUTED), words)
            taken.append((left, left + wide))
    return clicked
