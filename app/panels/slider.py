"""The modality slider: a bar at the bottom with play, named stops that catch the hand, and x."""

from collections.abc import Sequence

from imgui_bundle import imgui

from app.panels import theme
from app.panels.status_line import HEIGHT as STATUS_HEIGHT
from app.panels.theme import Box
from app.viewer.arrange import steer
from app.viewer.stage import Stage
from runtime_models.model import Stop
from scene.control import SNAP, snap

Vec = imgui.ImVec2
MAX_WIDTH = 760.0  # logical pixels
ROW = 46.0
WIDEST_NAME = 140.0  # of an object beside its slider


def draw_slider_bar(stage: Stage, left: float, ui_scale: float) -> Box:
    """One row an object at the lower edge: moves x, starts and stops playing; returns its box.

    It lies in the middle of what is right of `left`, logical pixels.
    """
    rows = stage.sliders
    if not rows:
        return (0.0, 0.0, 0.0, 0.0)
    screen = imgui.get_io().display_size
    width = min(MAX_WIDTH * ui_scale, (screen.x - left) * 0.94)
    middle = (left + screen.x) / 2
    low = screen.y - (18 + STATUS_HEIGHT) * ui_scale
    imgui.set_next_window_pos(Vec(middle, low), 0, Vec(0.5, 1.0))
    imgui.set_next_window_size(Vec(width, 0))
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
    """Play button, track, value of one object."""
    thing, sweep = stage.scene.objects[index], stage.sweeps[index]
    height = ROW * ui_scale
    if _play_button(sweep.playing, height):
        stage.toggle_play(index)
    imgui.same_line(0, 16 * ui_scale)
    named = len(stage.sliders) == 1 < len(stage.movable)  # one of several: say which
    name_width = min(imgui.calc_text_size(thing.name).x, WIDEST_NAME * ui_scale) if named else 0.0
    value_width = max(imgui.calc_text_size("x 0.000").x, name_width) + 20 * ui_scale
    room = imgui.get_content_region_avail().x - value_width
    x, held = track(thing.model.stops, thing.slider_x, height, room)
    if held:
        sweep.playing = False
        steer(stage, index, x)
    imgui.same_line(0, 18 * ui_scale)
    origin = imgui.get_cursor_screen_pos()
    text_y = origin.y + (height - imgui.get_text_line_height()) / 2 + 9 * ui_scale
    imgui.set_cursor_screen_pos(Vec(origin.x, text_y))
    imgui.text_disabled(f"x {thing.slider_x:.3f}")
    if named:
        imgui.push_clip_rect(origin, Vec(origin.x + value_width, origin.y + height), True)
        imgui.get_window_draw_list().add_text(origin, theme.color(theme.TEXT), thing.name)
        imgui.pop_clip_rect()


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


def track(stops: Sequence[Stop], x: float, height: float, width: float = 0.0) -> tuple[float, bool]:
    """The line with its ticks, names and grab.  Returns x and whether the hand holds it.

    Without a width it takes what there is, less half a grab at both ends.
    """
    line = imgui.get_text_line_height()
    if not width > 0:
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + 0.5 * line)
        width = imgui.get_content_region_avail().x - 0.5 * line
    corner = imgui.get_cursor_screen_pos()
    imgui.invisible_button("track", Vec(width, height))
    held, hovered = imgui.is_item_active(), imgui.is_item_hovered()
    if held:
        at = (imgui.get_io().mouse_pos.x - corner.x) / width
        x = snap(at, stops, 0.0 if imgui.get_io().key_alt else SNAP)
    draw = imgui.get_window_draw_list()
    y = corner.y + height * 0.5 + line * 0.55
    half = max(2.0, line * 0.13)
    middle = corner.x + width * x
    draw.add_rect_filled(
        Vec(corner.x, y - half), Vec(corner.x + width, y + half), theme.color(theme.TRACK), half
    )
    draw.add_rect_filled(
        Vec(corner.x, y - half), Vec(middle, y + half), theme.color(theme.ACCENT, 0.85), half
    )
    _stop_names(stops, x, corner, width, y)
    radius = line * (0.56 if held or hovered else 0.48)
    draw.add_circle_filled(Vec(middle, y), radius, theme.color(theme.ACCENT))
    draw.add_circle_filled(Vec(middle, y), radius * 0.45, theme.color(theme.SURFACE))
    return x, held


def _stop_names(stops: Sequence[Stop], x: float, corner: Vec, width: float, y: float) -> None:
    """A tick and a name at each stop; the name of the stop one stands on is lit."""
    draw = imgui.get_window_draw_list()
    line = imgui.get_text_line_height()
    last_right = corner.x - line  # names that would overlap the one before are left out
    for stop in sorted(stops, key=lambda stop: stop.x):
        here = corner.x + width * stop.x
        on = abs(stop.x - x) < 1e-3
        draw.add_circle_filled(Vec(here, y), line * 0.24, theme.color(theme.TEXT))
        text_width = imgui.calc_text_size(stop.name).x
        left = min(max(here - text_width / 2, corner.x), corner.x + width - text_width)
        if left < last_right + line * 0.5:
            continue
        ink = theme.color(theme.ACCENT if on else theme.TEXT)
        draw.add_text(Vec(left, corner.y), ink, stop.name)
        last_right = left + text_width
