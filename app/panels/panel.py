"""The panel at the left: its frame, times and counts, keys, messages; sections from beside it."""

from collections.abc import Mapping
from dataclasses import replace

from imgui_bundle import imgui

from app.panels import theme
from app.panels.budget_panel import draw_budget
from app.panels.panel_rows import choice, ms_text, number, right_aligned, rows, section, tip
from app.panels.play_panel import draw_play
from app.panels.quality_panel import draw_quality
from app.panels.regions_panel import draw_regions
from app.panels.status_line import HEIGHT as STATUS_HEIGHT
from app.panels.theme import Box
from app.viewer.dial import Dial
from app.viewer.readings import Readings
from app.viewer.sections import Hooks
from app.viewer.stage import AS_FILED, Stage
from renderer.palette import PALETTES
from renderer.settings import CULL_REASONS, DEBUG_VIEWS, FrameStats

Vec = imgui.ImVec2
WIDTH = 268.0  # logical pixels
MARGIN = 16.0
BAR_HEIGHT = 92.0  # of the slider bar with one row, with what lies below it
BAR_FIRST, BAR_ROW = 46.0, 71.0  # a row without and with the name of its object
NOTE_WIDTH = 620.0  # logical pixels; longer notes wrap
MIN_FREE = 0.5  # of the window's width and height
DEBUG_NAMES = {
    "": "picture",
    "culls": "what is culled, and why",
    "birdseye": "the same from above",
    "overdraw": "overdraw",
    "depth": "depth",
    "object": "objects",
}
KEYS = (
    ("drag", "orbit, look"),
    ("right drag", "pan, look"),
    ("wheel", "nearer, farther"),
    ("double click", "centre that place"),
    ("V", "orbit / fly"),
    ("WASD QE", "move; Shift fast, Ctrl slow"),
    ("F, Shift+F", "frame all, first view"),
    ("Space", "play, pause"),
    ("1 \u2013 9", "go to a stop"),
    ("Alt", "slider without snapping"),
    ("G, Shift+G", "debug views"),
    ("L", "lens on, off"),
    ("B + drag", "paint a region; Shift erases"),
    ("Esc", "leave the region"),
    ("N, P", "next, previous camera"),
    ("K", "keep this view in a list"),
    ("F12", "save a picture"),
    ("H, Tab", "hide all this"),
)


def draw_panel(stage: Stage, dial: Dial, readings: Readings, ui_scale: float, hooks: Hooks) -> Box:
    """The whole left panel; changes the stage's settings and palette.  Returns where it is.

    `hooks` hold what other parts of the program add: under the title, after Regions, to the keys.
    """
    imgui.set_next_window_pos(Vec(MARGIN * ui_scale, MARGIN * ui_scale))
    screen = imgui.get_io().display_size
    beside = free_area((screen.x, screen.y), len(stage.sliders), ui_scale)[0] > 0
    bar = 0.0 if beside else bar_height(len(stage.sliders))  # else the panel ends above it
    limit = screen.y - (2 * MARGIN + bar + STATUS_HEIGHT) * ui_scale
    imgui.set_next_window_size_constraints(
        Vec(WIDTH * ui_scale, 0), Vec(WIDTH * ui_scale, max(limit, 1.0))
    )
    flags = imgui.WindowFlags_
    imgui.begin(
        "##panel",
        None,
        flags.no_title_bar | flags.no_resize | flags.no_move | flags.always_auto_resize
        | flags.no_saved_settings,
    )  # fmt: skip
    _title(stage)
    for draw in hooks.top:
        draw(ui_scale)
    _frame(readings)
    _others(hooks, True, ui_scale)
    several = len(stage.scene.objects) > 1  # then there is more to see than frames
    if section("Budget", open_first=not several):
        draw_budget(stage, dial, ui_scale)
    if section("Quality", open_first=not several):
        draw_quality(stage, readings, ui_scale)
    if section("Regions", open_first=bool(stage.regions.items)):
        draw_regions(stage, ui_scale)
    _others(hooks, False, ui_scale)
    if section("Play"):
        draw_play(stage, ui_scale)
    if section("Look"):
        _look(stage, ui_scale)
    if section("Passes"):
        _passes(readings.stats.ms, ui_scale)
    if section("Counts"):
        _splats(readings.stats)
        _rates(readings, ui_scale)
    if section("Machine"):
        rows(readings.machine.items(), share=0.34)
    if section("Keys"):
        rows((*KEYS, *hooks.keys), share=0.40)
    box = theme.window_box()
    imgui.end()
    return box


def bar_height(rows: int) -> float:
    """Logical pixels that the slider bar takes at the lower edge."""
    return (0.0, BAR_HEIGHT)[rows] if rows < 2 else BAR_ROW * rows + BAR_HEIGHT - BAR_FIRST


def free_area(size: tuple[float, float], rows: int, pixels: float) -> Box:
    """The part of the window, in pixels, that panel and slider bar leave free.

    `rows` is the number of sliders, `pixels` what a unit of the overlay has.  In a window so small
    that little would be left it is all of the window.
    """
    width, height = size
    left = (WIDTH + 1.5 * MARGIN) * pixels
    bottom = height - (bar_height(rows) + STATUS_HEIGHT) * pixels
    enough = width - left > MIN_FREE * width and bottom > MIN_FREE * height
    return (left, 0.0, float(width), bottom) if enough else (0.0, 0.0, float(width), float(height))


def draw_note(text: str, left: float, ui_scale: float) -> None:
    """A message that needs no answer, at the upper edge and central in what is right of `left`."""
    if not text:
        return
    screen = imgui.get_io().display_size
    middle = (left + screen.x) / 2
    imgui.set_next_window_pos(Vec(middle, MARGIN * ui_scale), 0, Vec(0.5, 0))
    flags = imgui.WindowFlags_
    imgui.begin(
        "##note",
        None,
        flags.no_decoration | flags.always_auto_resize | flags.no_inputs | flags.no_saved_settings
        | flags.no_focus_on_appearing,
    )  # fmt: skip
    width = min(NOTE_WIDTH * ui_scale, (screen.x - left) * 0.9)
    room = width - 2 * imgui.get_style().window_padding.x
    imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + room)
    imgui.text_unformatted(text)
    imgui.pop_text_wrap_pos()
    imgui.end()


def draw_problem(stage: Stage, ui_scale: float) -> None:
    """The message box of a file that could not be opened; the scene stays as it was."""
    if not stage.problem:
        return
    fresh = not imgui.is_popup_open("A problem")  # the key that led to it is not for it
    if fresh:
        imgui.open_popup("A problem")
    screen = imgui.get_io().display_size
    imgui.set_next_window_pos(Vec(screen.x / 2, screen.y / 2), 0, Vec(0.5, 0.5))
    imgui.set_next_window_size(Vec(min(460 * ui_scale, screen.x * 0.9), 0))
    flags = imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_saved_settings
    if imgui.begin_popup_modal("A problem", None, flags)[0]:
        imgui.push_text_wrap_pos(0)
        imgui.text_unformatted(stage.problem)
        imgui.pop_text_wrap_pos()
        imgui.dummy(Vec(0, 4 * ui_scale))
        closed = imgui.button("OK", Vec(90 * ui_scale, 0))
        keys = (imgui.Key.enter, imgui.Key.escape)
        if closed or (not fresh and any(imgui.is_key_pressed(key, False) for key in keys)):
            stage.problem = ""
            imgui.close_current_popup()
        imgui.end_popup()


def _others(hooks: Hooks, above: bool, ui_scale: float) -> None:
    """The sections of other parts of the program that have their place there."""
    for other in hooks.sections:
        if other.above != above or (other.shown is not None and not other.shown()):
            continue
        unfold = other.opens is not None and other.opens()
        if section(other.name, other.open_first, unfold):
            imgui.push_id(other.name)
            other.draw(ui_scale)
            imgui.pop_id()


def _title(stage: Stage) -> None:
    names = stage.title
    imgui.text_colored(imgui.ImVec4(*theme.ACCENT, 1), "Shapeshift")
    if names:
        imgui.same_line()
        imgui.push_text_wrap_pos(0)
        imgui.text_unformatted(names)
        imgui.pop_text_wrap_pos()
    else:
        imgui.text_wrapped("Drop a scene on the window: a package, a .shift, .ply or .splat file.")


def _frame(readings: Readings) -> None:
    """The frame in two lines: its time, and how much of the scene it drew."""
    ms = readings.meter.ms
    if not ms > 0:
        return
    rate = "at rest" if readings.idle else f"{1e3 / ms:.0f} fps"
    mode = "fly" if readings.flying else "orbit"
    imgui.text(f"{ms_text(ms)} ms")
    imgui.same_line()
    imgui.text_disabled(f"{rate}  \u2013  {mode}")
    stats = readings.stats
    imgui.text(number(stats.drawn))
    imgui.same_line()
    imgui.text_disabled(f"of {number(stats.splats)} splats drawn")


def _passes(ms_of_pass: Mapping[str, float], ui_scale: float) -> None:
    """A bar and the milliseconds of every named pass, in their order."""
    most = max(ms_of_pass.values(), default=0.0)
    if not imgui.begin_table("passes", 3):
        return
    imgui.table_setup_column("name", imgui.TableColumnFlags_.width_fixed, 74 * ui_scale)
    imgui.table_setup_column("bar", imgui.TableColumnFlags_.width_stretch)
    imgui.table_setup_column("ms", imgui.TableColumnFlags_.width_fixed, 48 * ui_scale)
    for name, ms in ms_of_pass.items():
        imgui.table_next_column()
        imgui.text_disabled(name)
        imgui.table_next_column()
        corner, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
        line = imgui.get_text_line_height()
        length = max(room * ms / most if most > 0 else 0.0, 1.0)
        imgui.get_window_draw_list().add_rect_filled(
            Vec(corner.x, corner.y + line * 0.28),
            Vec(corner.x + length, corner.y + line * 0.78),
            theme.color(theme.ACCENT, 0.75),
            2.0,
        )
        imgui.table_next_column()
        right_aligned(ms_text(ms))
    imgui.end_table()


def _rates(readings: Readings, ui_scale: float) -> None:
    """How often the work was done that need not be done every frame."""
    meter, now = readings.meter, readings.now
    shapes, colors = (meter.per_second(f"{what}_runs", now) for what in ("geometry", "color"))
    rows(
        [
            ("slowest of the last second", f"{ms_text(meter.slowest_ms)} ms"),
            ("sorts a second", f"{meter.per_second('sorts', now):.0f}"),
            ("age of the order", f"{readings.stats.order_age} frames"),
            ("shapes decoded a second", f"{shapes:.0f}"),
            ("colours decoded a second", f"{colors:.0f}"),
            ("of all frames", f"{number(meter.geometry_runs)}, {number(meter.color_runs)}"),
        ]
    )
    tip("Networks run when x changes (shapes) or when the eye has moved (colours).", ui_scale)


def _splats(stats: FrameStats) -> None:
    """Why splats were not drawn: the first gate that each one failed, in the gates' order."""
    counts = [("in the scene", stats.splats), ("drawn", stats.drawn)]
    known = [why for why in CULL_REASONS if why in stats.culled]
    counts += [(f"culled: {why}", stats.culled[why]) for why in known]
    rows([(name, number(count)) for name, count in counts])


def _look(stage: Stage, ui_scale: float) -> None:
    """What is shown: the picture or a debug view of it, palette and background."""
    imgui.push_item_width(-1)
    names = [f"show: {DEBUG_NAMES[name]}" for name in DEBUG_VIEWS]
    debug = choice("debug", stage.settings.debug, DEBUG_VIEWS, names)
    tip("Key G goes through these, Shift+G backwards.", ui_scale)
    if debug != stage.settings.debug:
        stage.settings = replace(stage.settings, debug=debug)
    if stage.has_palettes:
        names = [AS_FILED, *PALETTES]
        labels = ["palette: as filed", *(f"palette: {name}" for name in PALETTES)]
        chosen = choice("palette", stage.palette, names, labels)
        if chosen != stage.palette:
            stage.choose_palette(chosen)
    imgui.pop_item_width()
    settings = stage.settings
    changed, background = imgui.color_edit3(
        "background", list(settings.background), imgui.ColorEditFlags_.no_inputs
    )
    if changed:
        stage.settings = replace(settings, background=tuple(background))
