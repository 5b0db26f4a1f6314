"""What the window says while it shows no scene: what can be dropped, or what it is doing first."""

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import item_label, tip
from shapeshift.app.editor.panels.widgets.theme import Box
from shapeshift.app.editor.texts.table import said

Vec = imgui.ImVec2
WIDTH = 420.0  # logical pixels
WHAT = (
    "A package of this program, splats of any known format, a folder of layers or of a training "
    "run, or a scene file."
)
FORMATS = ".shift  .ply  .spz  .splat  .ksplat  .sog  .glb  .scene.json"
DEMO_LABEL, OPEN = "The demo", "Open\u2026"
CHOICES = {
    OPEN: "Name a file or folder. Ctrl+O.",
    DEMO_LABEL: "A bench in photo, thermal, opened; throw its mug and its wrench.",
}


def draw_empty(free: Box, ui_scale: float) -> tuple[Box, str]:
    """A card in the middle of what is free.  Returns where it is, and which button was clicked."""
    left, top, right, bottom = free
    width = min(WIDTH * ui_scale, 0.94 * (right - left))
    imgui.set_next_window_pos(Vec((left + right) / 2, (top + bottom) / 2), 0, Vec(0.5, 0.5))
    imgui.set_next_window_size(Vec(width, 0))
    flags = imgui.WindowFlags_
    imgui.begin("##empty", None, flags.no_decoration | flags.no_move | flags.no_saved_settings)
    imgui.push_text_wrap_pos(0)
    imgui.text_colored(imgui.ImVec4(*theme.ACCENT, 1), said("Drop a scene here"))
    imgui.text_unformatted(said(WHAT))
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.MUTED, 1))
    imgui.text_unformatted(FORMATS)
    imgui.pop_style_color()
    imgui.pop_text_wrap_pos()
    imgui.dummy(Vec(0, 4 * ui_scale))
    clicked, gap = "", imgui.get_style().item_spacing.x
    each = (imgui.get_content_region_avail().x - gap * (len(CHOICES) - 1)) / len(CHOICES)
    for number, (label, what) in enumerate(CHOICES.items()):
        if number:
            imgui.same_line()
        if imgui.button(item_label(label), Vec(each, 0)):
            clicked = label
        tip(what, ui_scale)
    box = theme.window_box()
    imgui.end()
    return box, clicked


def draw_opening(size: tuple[float, float], lines: tuple[str, ...], ui_scale: float) -> None:
    """A card in the middle of a window of `size`, logical pixels; the first line is its title."""
    width = min(WIDTH * ui_scale, 0.94 * size[0])
    imgui.set_next_window_pos(Vec(size[0] / 2, size[1] / 2), 0, Vec(0.5, 0.5))
    imgui.set_next_window_size(Vec(width, 0))
    flags = imgui.WindowFlags_
    imgui.begin("##opening", None, flags.no_decoration | flags.no_move | flags.no_saved_settings)
    imgui.push_text_wrap_pos(0)
    imgui.text_colored(imgui.ImVec4(*theme.ACCENT, 1), lines[0])
    for line in lines[1:]:
        imgui.text_unformatted(line)
    imgui.pop_text_wrap_pos()
    imgui.end()
