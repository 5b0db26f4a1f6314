"""The section "Gallery": a picture of each stop, two of them picked, and the way between them."""

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import labelled_slider, tip
from shapeshift.app.editor.panels.widgets.textures import Textures
from shapeshift.app.editor.state.film.gallery import SIZE, Gallery

Vec = imgui.ImVec2
COLUMNS = 3
FRAME = 2.0  # logical pixels about a picked picture
FASTEST_S, SLOWEST_S = 0.5, 20.0


def draw_gallery(gallery: Gallery, textures: Textures, ui_scale: float) -> None:
    """The pictures, the slider between the two that are picked, there and back by itself."""
    gallery.seen = True
    if gallery.index is None:
        imgui.text_disabled("There is one stop: nothing to pick.")
        return
    gap = imgui.get_style().item_spacing.x
    width = (imgui.get_content_region_avail().x - gap * (COLUMNS - 1)) / COLUMNS
    for number, stop in enumerate(gallery.stops):
        if number % COLUMNS:
            imgui.same_line()
        imgui.begin_group()
        if _picture(gallery, textures, number, width, ui_scale):
            gallery.pick(stop.name)
        imgui.end_group()
    if len(gallery.picked) < 2:
        imgui.text_disabled("Pick two to go from one to the other.")
        return
    imgui.push_item_width(-1)
    start, end = gallery.picked
    moved, part = labelled_slider("way", gallery.part, 0.0, 1.0, f"{start} to {end}")
    if moved:
        gallery.slide(part)
    tip("Straight from one to the other, at an even pace: no third stop is passed.", ui_scale)
    room = imgui.get_content_region_avail().x
    if imgui.button("Stop" if gallery.sliding else "Slide", Vec((room - gap) / 2, 0)):
        gallery.toggle_sliding()
    tip("There and back by itself, as a film goes.", ui_scale)
    imgui.same_line()
    imgui.set_next_item_width(-1)
    changed, leg_s = imgui.slider_float(
        "##leg", gallery.leg_s, FASTEST_S, SLOWEST_S, "%.1f s", imgui.SliderFlags_.always_clamp
    )
    if changed:
        gallery.leg_s = leg_s
    tip("How long a way takes.", ui_scale)
    imgui.pop_item_width()


def _picture(
    gallery: Gallery, textures: Textures, number: int, width: float, ui_scale: float
) -> bool:
    """One stop, framed where it is picked; whether it was clicked."""
    stop = gallery.stops[number]
    height = width * SIZE[1] / SIZE[0]
    corner = imgui.get_cursor_screen_pos()
    clicked = imgui.invisible_button(f"{stop.name}##picture {number}", Vec(width, height))
    hovered = imgui.is_item_hovered()
    tip(f"{stop.name}: x {stop.x:.3f}. A click goes there and picks it.", ui_scale)
    drawing = imgui.get_window_draw_list()
    end = Vec(corner.x + width, corner.y + height)
    picture = gallery.thumbnails.pictures.get(stop.x)
    if picture is None:
        drawing.add_rect_filled(corner, end, theme.color(theme.RAISED))
    else:
        name = f"{gallery.thumbnails.version} {number}"
        drawing.add_image(textures.number(name, picture), corner, end)
    picked = stop.name in gallery.picked
    if picked or hovered:
        edge = theme.color(theme.ACCENT if picked else theme.MUTED)
        drawing.add_rect(corner, end, edge, 0, 0, FRAME * ui_scale)
    imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + width)
    ink = theme.ACCENT if picked else theme.TEXT
    imgui.text_colored(imgui.ImVec4(*ink, 1), stop.name)
    imgui.pop_text_wrap_pos()
    return clicked
