"""How the overlay looks: dark and neutral, one warm accent, a readable font at any density."""

from pathlib import Path

import imgui_bundle
from imgui_bundle import imgui

from shapeshift.app.editor.texts.fonts import more_letters

Box = tuple[float, float, float, float]  # left, top, right, bottom in logical pixels

FONT_SIZE = 15.0  # logical pixels
FONT = Path(imgui_bundle.__file__).parent / "assets/fonts/Roboto/Roboto-Regular.ttf"

# Its symbols of the bar of tools are letters above U+F000 (SIL OFL 1.1).
SYMBOLS = Path(imgui_bundle.__file__).parent / "assets/fonts/Font_Awesome_6_Free-Solid-900.otf"

BEYOND = (3.0, 3.0)  # logical pixels that items reach beyond their edges for a ray or a finger

ACCENT = (0.95, 0.63, 0.27)
TEXT = (0.90, 0.90, 0.91)
MUTED = (0.58, 0.59, 0.62)
SURFACE = (0.105, 0.108, 0.118)
RAISED = (0.175, 0.180, 0.195)
SECOND = (0.47, 0.72, 0.95)  # what stands for a second x
WARNING = (0.93, 0.36, 0.27)
TRACK = (0.30, 0.31, 0.33)


def color(rgb: tuple[float, float, float], alpha: float = 1.0) -> int:
    """Packed colour for draw lists."""
    return imgui.get_color_u32(imgui.ImVec4(*rgb, alpha))


def window_box() -> Box:
    """Where the overlay's window that is being made lies."""
    low, size = imgui.get_window_pos(), imgui.get_window_size()
    return (low.x, low.y, low.x + size.x, low.y + size.y)


def has_keys() -> bool:
    """Whether there are a mouse and keys: numbers are typed then, and tips name keys.

    Else a ray or a finger points, as in a headset.
    """
    return not imgui.get_io().config_flags & imgui.ConfigFlags_.no_keyboard


def apply(ui_scale: float, keys: bool = True, every_letter: bool = False) -> None:
    """Styles the current ImGui context, between frames alone.  ImGui rasters the letters that it
    needs at the density of the framebuffer.

    Without `keys` a ray or a finger points at it: all that can be hit is larger.  every_letter: of
    all languages that are offered, not of the one in use alone.
    """
    io = imgui.get_io()
    io.config_input_text_cursor_blink = False  # at rest no frame is drawn
    if not keys:
        io.config_flags |= imgui.ConfigFlags_.no_keyboard | imgui.ConfigFlags_.is_touch_screen
    io.fonts.clear()
    io.fonts.add_font_from_file_ttf(str(FONT), FONT_SIZE)
    for path in [SYMBOLS] * keys + more_letters(every_letter):
        config = imgui.ImFontConfig()
        config.merge_mode = True
        io.fonts.add_font_from_file_ttf(str(path), FONT_SIZE, config)

    style = imgui.get_style()
    _unscale(style)
    imgui.style_colors_dark(style)
    style.window_rounding = style.popup_rounding = 8
    style.frame_rounding = style.grab_rounding = 4
    style.window_border_size = 0
    style.window_padding = imgui.ImVec2(14, 12)
    style.frame_padding = imgui.ImVec2(8, 4)
    style.item_spacing = imgui.ImVec2(8, 5)
    style.cell_padding = imgui.ImVec2(4, 2)
    style.grab_min_size = 12
    style.scrollbar_size = 10
    if not keys:
        style.frame_padding, style.item_spacing = imgui.ImVec2(8, 5), imgui.ImVec2(8, 8)
        style.touch_extra_padding = imgui.ImVec2(*BEYOND)
        style.scrollbar_size, style.grab_min_size = 16, 20
        style.window_rounding = style.child_border_size = 0
    for where, (rgb, alpha) in _colors().items():
        red, green, blue = rgb
        style.set_color_(where, imgui.ImVec4(red, green, blue, alpha))
    style.scale_all_sizes(ui_scale)
    style.font_size_base = FONT_SIZE * ui_scale


def _unscale(style: imgui.Style) -> None:
    """Every length as ImGui has it at first: scaling what was scaled before rounds twice."""
    fresh = imgui.Style()
    for name in dir(fresh):
        value = getattr(fresh, name)
        if isinstance(value, float | imgui.ImVec2) and not name.startswith("_"):
            setattr(style, name, value)


def _colors() -> dict:
    """ImGui colour slot -> (rgb, alpha)."""
    col = imgui.Col_
    return {
        col.text: (TEXT, 1),
        col.text_disabled: (MUTED, 1),
        col.window_bg: (SURFACE, 0.90),
        col.popup_bg: (SURFACE, 0.98),
        col.frame_bg: (RAISED, 1),
        col.frame_bg_hovered: ((0.22, 0.225, 0.24), 1),
        col.frame_bg_active: ((0.25, 0.255, 0.27), 1),
        col.button: (RAISED, 1),
        col.button_hovered: ((0.26, 0.265, 0.28), 1),
        col.button_active: ((0.32, 0.325, 0.34), 1),
        col.header: (SURFACE, 0),
        col.header_hovered: (RAISED, 1),
        col.header_active: (RAISED, 1),
        col.slider_grab: (ACCENT, 0.9),
        col.slider_grab_active: (ACCENT, 1),
        col.scrollbar_bg: (SURFACE, 0),
        col.scrollbar_grab: (TRACK, 1),
        col.check_mark: (ACCENT, 1),
        col.checkbox_selected_bg: (RAISED, 1),
        col.input_text_cursor: (TEXT, 1),
        col.plot_histogram: (ACCENT, 0.75),
        col.separator: (TRACK, 0.5),
        col.title_bg_active: (RAISED, 1),
        # No dimming behind boxes: ImGui reorders its commands for it, which moderngl-window's
        # renderer does not follow, so that the box itself would be dimmed.
        col.modal_window_dim_bg: ((0, 0, 0), 0),
    }
