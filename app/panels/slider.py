"""The modality slider: a bar at the bottom with play, named stops that catch the hand, and x."""

from collections.abc import Sequence

from imgui_bundle import imgui

from app.panels import theme
from app.panels.panel_rows import tip
from app.panels.stops_panel import pace_button
from app.panels.theme import Box
from app.viewer.arrange import go_to_stop, steer_by_hand
from app.viewer.stage import Stage
from app.viewer.track import Grip, Track, half_ways, read_x
from runtime_models.model import Stop
from scene.control import SNAP

Vec = imgui.ImVec2
ROW = 46.0  # logical pixels
WIDEST_NAME = 140.0  # of an object beside its slider
VALUE, PACE = 54.0, 46.0  # widths of the number and of the seconds
ROOMY = 380.0  # less than this in a row and the seconds are left to the panel's section Play
LINE = 0.68  # of a row's height: where the track runs, below the names of its stops
KNOB, SLACK = 0.56, 0.2  # of a line of text: the knob's radius, and how far beside it it is taken


def draw_slider_bar(stage: Stage, bar: Box | None, ui_scale: float) -> Box:
    """One row an object at the lower edge: moves x, starts and stops playing; returns its box."""
    rows = stage.sliders
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
            imgui.text_disabled(stage.scene.objects[index].name)
        _row(stage, index, ui_scale)
        imgui.pop_id()
    box = theme.window_box()
    imgui.end()
    return box


def _row(stage: Stage, index: int, ui_scale: float) -> None:
    """Play button, seconds a way, track, value of one object."""
    thing, sweep = stage.scene.objects[index], stage.sweeps[index]
    height = ROW * ui_scale
    if _play_button(sweep.playing, height):
        stage.toggle_play(index)
    if imgui.get_content_region_avail().x > ROOMY * ui_scale:
        imgui.same_line(0, 8 * ui_scale)
        _pace(stage, index, height, ui_scale)
    imgui.same_line(0, 14 * ui_scale)
    named = len(stage.sliders) == 1 < len(stage.movable)  # one of several: say which
    name_width = min(imgui.calc_text_size(thing.name).x, WIDEST_NAME * ui_scale) if named else 0.0
    value_width = max(VALUE * ui_scale, name_width)
    room = imgui.get_content_region_avail().x - value_width - 12 * ui_scale
    stops = stage.stops(index)
    x, held, stop = track(stops, thing.x, stage.grip, height, room)
    if stop is not None:
        go_to_stop(stage, index, stop)
    elif held:
        steer_by_hand(stage, index, x)
    imgui.same_line(0, 0)
    origin = imgui.get_cursor_screen_pos()
    left = origin.x + 12 * ui_scale
    if named:
        imgui.push_clip_rect(origin, Vec(left + value_width, origin.y + height), True)
        draw = imgui.get_window_draw_list()
        draw.add_text(Vec(left, origin.y), theme.color(theme.TEXT), thing.name)
        imgui.pop_clip_rect()
    line_y = origin.y + height * LINE - imgui.get_frame_height() / 2
    imgui.set_cursor_screen_pos(Vec(left, line_y))
    _value(stage, index, stops, ui_scale)


def _value(stage: Stage, index: int, stops: Sequence[Stop], ui_scale: float) -> None:
    """x as a number that can be typed, or a stop's name; Enter or leaving it takes it over."""
    x = stage.scene.objects[index].x
    imgui.set_next_item_width(VALUE * ui_scale)
    flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
    entered, text = imgui.input_text("##x", f"{x:.3f}", flags)
    left = imgui.is_item_deactivated_after_edit() and not imgui.is_key_pressed(imgui.Key.escape)
    if entered or left:
        try:
            typed = read_x(text, stops)
        except ValueError as error:
            stage.problem = str(error)
        else:
            if text.strip() != f"{x:.3f}":  # the rounded number that stood there is no new one
                steer_by_hand(stage, index, typed)
    tip("x: type a number from 0 to 1, or a stop's name. Arrow keys: a hundredth.", ui_scale)


def _pace(stage: Stage, index: int, height: float, ui_scale: float) -> None:
    """The seconds from stop to stop, on the track's line."""
    corner = imgui.get_cursor_screen_pos()
    line_y = corner.y + height * LINE - imgui.get_frame_height() / 2
    imgui.set_cursor_screen_pos(Vec(corner.x, line_y))
    pace_button(stage, index, PACE * ui_scale, "", ui_scale)
    imgui.set_cursor_screen_pos(corner)
    imgui.dummy(Vec(PACE * ui_scale, height))


def _play_button(playing: bool, height: float) -> bool:
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
    if hovered:
        imgui.set_tooltip("Pause (Space)" if playing else "Play through the stops (Space)")
    return clicked


def track(
    stops: Sequence[Stop], x: float, grip: Grip, height: float, width: float = 0.0
) -> tuple[float, bool, int | None]:
    """The line with its ticks, names and knob.  Returns x, whether the hand moves it, and the
    number of the stop whose name was clicked.

    Without a width it takes what there is.  The knob can be taken all over, also where it stands
    out beyond an end of the line.
    """
    line = imgui.get_text_line_height()
    radius = KNOB * line
    width = width if width > 0 else imgui.get_content_region_avail().x
    corner = imgui.get_cursor_screen_pos()
    along = Track(corner.x + radius, max(width - 2 * radius, 1.0), radius + SLACK * line)
    y = corner.y + height * LINE
    chosen = _stop_names(stops, x, along, corner, y)
    reach = along.knob + 1.0  # so that a press on the very edge is within it
    imgui.set_cursor_screen_pos(Vec(along.left - reach, y - reach))
    imgui.invisible_button("track", Vec(along.width + 2 * reach, 2 * reach))
    held, hovered = imgui.is_item_active(), imgui.is_item_hovered()
    io = imgui.get_io()
    if imgui.is_item_activated():
        grip.take(along, x, io.mouse_pos.x)
    if held:
        x = grip.drag(along, x, io.mouse_pos.x, stops, 0.0 if io.key_alt else SNAP)
    _line(stops, x, along, y)
    _knob(along.place(x), y, radius if held or hovered else 0.86 * radius)
    imgui.set_cursor_screen_pos(corner)
    imgui.dummy(Vec(width, height))
    return x, held, chosen


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
    for tick in half_ways(stops):
        at, tall = along.place(tick), line * 0.3
        ink = theme.color(theme.MUTED)
        draw.add_line(Vec(at, y - tall), Vec(at, y + tall), ink, max(1.0, line / 12))
    for stop in stops:
        draw.add_circle_filled(Vec(along.place(stop.x), y), line * 0.24, theme.color(theme.TEXT))


def _knob(place: float, y: float, radius: float) -> None:
    draw = imgui.get_window_draw_list()
    draw.add_circle_filled(Vec(place, y), radius, theme.color(theme.ACCENT))
    draw.add_circle_filled(Vec(place, y), radius * 0.45, theme.color(theme.SURFACE))


def _stop_names(stops: Sequence[Stop], x: float, along: Track, corner: Vec, y: float) -> int | None:
    """A name above each stop, lit where x is; returns the number of the one that was clicked."""
    draw = imgui.get_window_draw_list()
    line = imgui.get_text_line_height()
    low, high = along.left - KNOB * line, along.left + along.width + KNOB * line
    last_right = low - line  # names that would overlap the one before are left out
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
        if hovered:
            key = f", key {number + 1}" if number < 9 else ""
            imgui.set_tooltip(f"{stop.name}: x {stop.x:.3f}{key}")
        lit = hovered or abs(stop.x - x) < 1e-3
        ink = theme.color(theme.ACCENT if lit else theme.TEXT)
        draw.add_text(Vec(left, corner.y), ink, stop.name)
    return clicked
