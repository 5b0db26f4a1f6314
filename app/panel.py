"""The panel at the left: frame times, splat counts, quality, palette, machine, keys, messages."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from imgui_bundle import imgui

from app import theme
from app.stage import AS_FILED, Stage
from app.theme import Box
from renderer.palette import PALETTES
from renderer.settings import FrameStats

Vec = imgui.ImVec2
WIDTH = 268.0  # logical pixels
MARGIN = 16.0
BAR_HEIGHT = 92.0  # of the slider bar with one row, with what lies below it
BAR_FIRST, BAR_ROW = 46.0, 71.0  # a row without and with the name of its object
MIN_FREE = 0.5  # of the window's width and height
MAX_LAMBDA = 512.0  # pixels; the slider's end means no limit
FAR_RADII = 12.0  # scene radii; the distance slider's end means no limit
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
    ("P, F12", "save a picture"),
    ("H, Tab", "hide all this"),
)


@dataclass
class Readings:
    """What was measured, for showing."""

    stats: FrameStats = field(default_factory=FrameStats)
    frame_ms: float = 0.0  # the last frame with new splats, whole: update to swap
    machine: Mapping[str, str] = field(default_factory=dict)  # label -> driver or back end
    flying: bool = False
    idle: bool = False
    note: str = ""  # said for a few seconds at the upper edge


def draw_panel(stage: Stage, readings: Readings, ui_scale: float) -> Box:
    """The whole left panel; changes the stage's settings and palette.  Returns where it is."""
    imgui.set_next_window_pos(Vec(MARGIN * ui_scale, MARGIN * ui_scale))
    screen = imgui.get_io().display_size
    beside = free_area((screen.x, screen.y), len(stage.sliders), ui_scale)[0] > 0
    bar = 0.0 if beside else bar_height(len(stage.sliders))  # else the panel ends above it
    limit = screen.y - (2 * MARGIN + bar) * ui_scale
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
    _frame(readings)
    if _section("Passes", open_first=True):
        _passes(readings.stats.ms, ui_scale)
    if _section("Splats", open_first=True):
        _splats(readings.stats)
    if _section("Quality", open_first=True):
        _quality(stage, ui_scale)
    if _section("Machine"):
        _rows(readings.machine.items(), share=0.34)
    if _section("Keys"):
        _rows(KEYS, share=0.40)
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
    bottom = height - bar_height(rows) * pixels
    enough = width - left > MIN_FREE * width and bottom > MIN_FREE * height
    return (left, 0.0, float(width), bottom) if enough else (0.0, 0.0, float(width), float(height))


def draw_note(text: str, ui_scale: float) -> None:
    """A short message at the upper edge that needs no answer."""
    if not text:
        return
    imgui.set_next_window_pos(
        Vec(imgui.get_io().display_size.x / 2, MARGIN * ui_scale), 0, Vec(0.5, 0)
    )
    flags = imgui.WindowFlags_
    imgui.begin(
        "##note",
        None,
        flags.no_decoration | flags.always_auto_resize | flags.no_inputs | flags.no_saved_settings
        | flags.no_focus_on_appearing,
    )  # fmt: skip
    imgui.text(text)
    imgui.end()


def draw_problem(stage: Stage, ui_scale: float) -> None:
    """The message box of a file that could not be opened; the scene stays as it was."""
    if not stage.problem:
        return
    if not imgui.is_popup_open("Not opened"):
        imgui.open_popup("Not opened")
    screen = imgui.get_io().display_size
    imgui.set_next_window_pos(Vec(screen.x / 2, screen.y / 2), 0, Vec(0.5, 0.5))
    imgui.set_next_window_size(Vec(min(460 * ui_scale, screen.x * 0.9), 0))
    flags = imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_saved_settings
    if imgui.begin_popup_modal("Not opened", None, flags)[0]:
        imgui.push_text_wrap_pos(0)
        imgui.text_unformatted(stage.problem)
        imgui.pop_text_wrap_pos()
        imgui.dummy(Vec(0, 4 * ui_scale))
        closed = imgui.button("OK", Vec(90 * ui_scale, 0))
        if (
            closed
            or imgui.is_key_pressed(imgui.Key.enter)
            or imgui.is_key_pressed(imgui.Key.escape)
        ):
            stage.problem = ""
            imgui.close_current_popup()
        imgui.end_popup()


def _title(stage: Stage) -> None:
    names = ", ".join(thing.name for thing in stage.scene.objects)
    imgui.text_colored(imgui.ImVec4(*theme.ACCENT, 1), "Shapeshift")
    if names:
        imgui.same_line()
        imgui.push_text_wrap_pos(0)
        imgui.text_unformatted(names)
        imgui.pop_text_wrap_pos()
    else:
        imgui.text_wrapped("Drop a scene on the window: a package, a .shift, .ply or .splat file.")


def _frame(readings: Readings) -> None:
    """The frame in one line."""
    if not readings.frame_ms > 0:
        return
    rate = "at rest" if readings.idle else f"{1e3 / readings.frame_ms:.0f} fps"
    mode = "fly" if readings.flying else "orbit"
    imgui.text(f"{_ms(readings.frame_ms)} ms")
    imgui.same_line()
    imgui.text_disabled(f"{rate}  \u2013  {mode}")


def _section(name: str, open_first: bool = False) -> bool:
    """A heading that folds; returns whether it is open."""
    imgui.dummy(Vec(0, 1))
    flags = imgui.TreeNodeFlags_.no_tree_push_on_open | imgui.TreeNodeFlags_.span_avail_width
    if open_first:
        flags |= imgui.TreeNodeFlags_.default_open
    imgui.push_style_var(imgui.StyleVar_.frame_padding, Vec(0, imgui.get_style().frame_padding.y))
    is_open = imgui.tree_node_ex(name, flags)
    imgui.pop_style_var()
    return is_open


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
        _right_aligned(_ms(ms))
    imgui.end_table()


def _splats(stats: FrameStats) -> None:
    rows = [("in the scene", stats.splats), ("drawn", stats.drawn)]
    rows += [(f"culled: {why}", count) for why, count in sorted(stats.culled.items())]
    _rows([(name, f"{count:,}".replace(",", "\u2009")) for name, count in rows])


def _quality(stage: Stage, ui_scale: float) -> None:
    """Thresholds, palette and background."""
    settings = stage.settings
    imgui.push_item_width(imgui.get_content_region_avail().x)
    flags = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.always_clamp
    end = MAX_LAMBDA
    shown = min(settings.max_pixels, end)
    text = "largest splat: any" if shown >= end else "largest splat: %.0f px"
    moved, pixels = imgui.slider_float("##lambda", shown, 1.0, end, text, flags)
    if moved:
        settings = replace(settings, max_pixels=pixels if pixels < end else np.inf)
    imgui.set_item_tooltip("\u03c4\u03bb: splats longer than this on the screen are left out")
    end = FAR_RADII * stage.radius
    shown = min(settings.max_distance, end)
    text = "distance: any" if shown >= end else "distance: %.2f m"
    low = 0.01 * stage.radius
    moved, metres = imgui.slider_float("##distance", shown, low, end, text, flags)
    if moved:
        settings = replace(settings, max_distance=metres if metres < end else np.inf)
    imgui.set_item_tooltip("\u03c4dist: splats farther away than this are left out")
    if stage.has_palettes:
        names = [AS_FILED, *PALETTES]
        labels = ["palette: as filed", *(f"palette: {name}" for name in PALETTES)]
        changed, chosen = imgui.combo("##palette", names.index(stage.palette), labels)
        if changed:
            stage.choose_palette(names[chosen])
    imgui.pop_item_width()
    changed, background = imgui.color_edit3(
        "background", list(settings.background), imgui.ColorEditFlags_.no_inputs
    )
    if changed:
        settings = replace(settings, background=tuple(background))
    if settings != stage.settings:
        stage.settings = settings


def _rows(rows: Iterable[tuple[str, str]], share: float = 0.0) -> None:
    """Muted names, values: at the right, or from a `share` of the width on, where they wrap."""
    for name, value in rows:
        imgui.text_disabled(name)
        if share:
            imgui.same_line(imgui.get_window_size().x * share)
            imgui.push_text_wrap_pos(0)
            imgui.text_unformatted(value)
            imgui.pop_text_wrap_pos()
        else:
            imgui.same_line()
            _right_aligned(value)


def _right_aligned(text: str) -> None:
    room = imgui.get_content_region_avail().x - imgui.calc_text_size(text).x
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(room, 0.0))
    imgui.text_unformatted(text)


def _ms(value: float) -> str:
    return f"{value:.2f}" if value < 10 else f"{value:.1f}" if value < 100 else f"{value:.0f}"
