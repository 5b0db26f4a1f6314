"""The section "Gallery": a picture of each stop, two of them picked, and the way between them."""

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.overlay_renderer import Textures
from shapeshift.app.editor.panels.widgets.panel_rows import (
    choice,
    item_label,
    labelled_slider,
    slider,
    tip,
)
from shapeshift.app.editor.texts.table import said
from shapeshift.app.film.window.gallery import SIZE, Gallery
from shapeshift.app.film.window.style_work import SHAPES, StyleWork

Vec = imgui.ImVec2
COLUMNS = 3
FRAME = 2.0  # logical pixels about a picked picture
FASTEST_S, SLOWEST_S = 0.5, 20.0


def draw_gallery(gallery: Gallery, styles: StyleWork, textures: Textures, ui_scale: float) -> None:
    """The pictures, the way between the two that are picked, styles to add and to take out."""
    gallery.seen = True
    _pictures(gallery, textures, ui_scale)
    if len(gallery.picked) == 2:
        _way(gallery, ui_scale)
    elif len(gallery.stops) > 1:
        imgui.text_disabled(said("Pick two to go from one to the other."))
    if gallery.stops:
        _styles(gallery, styles, ui_scale)


def _pictures(gallery: Gallery, textures: Textures, ui_scale: float) -> None:
    gap = imgui.get_style().item_spacing.x
    width = (imgui.get_content_region_avail().x - gap * (COLUMNS - 1)) / COLUMNS
    stops = gallery.stops
    for styled in (False, True):  # styles have a row of their own below what was photographed
        row = [n for n, stop in enumerate(stops) if (stop.kind == "style") == styled]
        if styled and 0 < len(row) < len(stops):
            imgui.text_disabled(said("Styles"))
        for place, number in enumerate(row):
            if place % COLUMNS:
                imgui.same_line()
            imgui.begin_group()
            if _picture(gallery, textures, number, width, ui_scale):
                gallery.pick(stops[number].name)
            imgui.end_group()


def _way(gallery: Gallery, ui_scale: float) -> None:
    """The slider between two stops, and there and back by itself."""
    gap = imgui.get_style().item_spacing.x
    imgui.push_item_width(-1)
    start, end = gallery.picked
    moved, part = labelled_slider(
        "way", gallery.part, 0.0, 1.0, said("{start} to {end}", start=start, end=end)
    )
    if moved:
        gallery.slide(part)
    tip("Straight from one to the other, at an even pace: no third stop is passed.", ui_scale)
    room = imgui.get_content_region_avail().x
    if imgui.button(item_label("Stop" if gallery.sliding else "Slide"), Vec((room - gap) / 2, 0)):
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


def _styles(gallery: Gallery, styles: StyleWork, ui_scale: float) -> None:
    """A shape to add, the picked stop to take out; or how far that is."""
    if styles.running:
        words, part = styles.progress
        imgui.progress_bar(part, Vec(-1, 0), words)
        if imgui.button(item_label("Cancel"), Vec(-1, 0)):
            styles.cancel()
        tip("Nothing is left of it.", ui_scale)
        return
    gap, room = imgui.get_style().item_spacing.x, imgui.get_content_region_avail().x
    imgui.push_item_width((room - gap) / 2)
    styles.shape = choice("shape", styles.shape, SHAPES, SHAPES)
    tip("What becomes of the splats at the new stop, by a rule.", ui_scale)
    imgui.pop_item_width()
    imgui.same_line()
    source = gallery.picked[-1] if gallery.picked else gallery.stops[0].name
    if imgui.button(item_label("Add style"), Vec(-1, 0)):
        styles.add(source, gallery.index or 0)
    tip(
        said(
            "A new stop that starts from {stop}, in a new file, seconds to minutes; all other "
            "stops stay as they are.",
            stop=source,
        ),
        ui_scale,
    )
    imgui.push_item_width(-1)
    styles.strength = slider("strength", styles.strength, 0.1, 1.0, "strength: %.2f")
    tip("How far the new stop is from the one that it starts from.", ui_scale)
    imgui.pop_item_width()
    if gallery.picked and len(gallery.stops) > 1:
        if imgui.button(said("Take out {stop}", stop=source) + "###take out", Vec(-1, 0)):
            styles.remove(source, gallery.index or 0)
        tip("The stop that was picked last, in a new file; this one stays.", ui_scale)


def _picture(
    gallery: Gallery, textures: Textures, number: int, width: float, ui_scale: float
) -> bool:
    """One stop, framed where it is picked; whether it was clicked."""
    stop = gallery.stops[number]
    height = width * SIZE[1] / SIZE[0]
    corner = imgui.get_cursor_screen_pos()
    clicked = imgui.invisible_button(f"{stop.name}##picture {number}", Vec(width, height))
    hovered = imgui.is_item_hovered()
    tip(
        said("{name}: x {x:.3f}. A click goes there and picks it.", name=stop.name, x=stop.x),
        ui_scale,
    )
    drawing = imgui.get_window_draw_list()
    end = Vec(corner.x + width, corner.y + height)
    picture = gallery.thumbnails.pictures.get(stop.x)
    if picture is None:
        drawing.add_rect_filled(corner, end, theme.color(theme.RAISED))
    else:
        name = f"{gallery.thumbnails.version} {number}"
        drawing.add_image(textures.reference(name, picture), corner, end)
    picked = stop.name in gallery.picked
    if picked or hovered:
        edge = theme.color(theme.ACCENT if picked else theme.MUTED)
        drawing.add_rect(corner, end, edge, 0, FRAME * ui_scale)
    imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + width)
    ink = theme.ACCENT if picked else theme.TEXT
    imgui.text_colored(imgui.ImVec4(*ink, 1), stop.name)
    imgui.pop_text_wrap_pos()
    return clicked
