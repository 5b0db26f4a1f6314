"""The panel's section "Quality": every shortcut with what it trades, and what it costs now."""

from dataclasses import replace

from imgui_bundle import imgui

from shapeshift.app.charts.comparison import exact, is_exact, shortcuts
from shapeshift.app.editor.panels.widgets.panel_rows import (
    choice,
    db_text,
    item_label,
    labelled_slider,
    open_slider,
    right_aligned,
    slider,
    subsection,
    tip,
)
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.frame_stats import FrameStatsView
from shapeshift.app.editor.texts.table import said
from shapeshift.renderer.foveation import RADIUS_DEGREES
from shapeshift.renderer.settings import FOVEATIONS, ORDERS, TARGETS, RenderSettings

MAX_LAMBDA = 512.0  # pixels; the slider's end means no limit
FAR_RADII = 12.0  # scene radii; the distance slider's end means no limit
MOST_FOOTPRINT = 8.0  # pixels
BY_TURN = 31  # this place of the slider: no sort because of the number of frames
STOPS = (RenderSettings().min_transmittance, 1 / 2048, 1 / 256, 1 / 64)  # light left, where to stop
GROUPS = {  # heading -> the settings below it
    "Culls": ("max_pixels", "max_distance", "min_pixels", "fade"),
    "Order": ("order", "key_bits", "resort_frames", "resort_degrees"),
    "Colour": ("recolor_degrees", "skip_unseen"),
    "Pixels": ("render_scale", "foveation", "target", "min_transmittance"),
}
ORDER_NAMES = {"depth": "order: along the view", "distance": "order: distance to the eye"}


def draw_quality(state: EditorState, readings: FrameStatsView, ui_scale: float) -> None:
    """What the setting costs in the picture, a way back, and the controls in groups."""
    settings = state.settings
    _cost(state, readings, ui_scale)
    changed = shortcuts(settings)
    imgui.push_item_width(-1)
    for heading, names in GROUPS.items():
        if not subsection(heading, any(n in changed for n in names)):
            continue
        if heading == "Culls":
            settings = _culls(settings, state.radius, ui_scale)
        elif heading == "Order":
            settings = _order(settings, ui_scale)
        elif heading == "Colour":
            settings = _color(settings, ui_scale)
        else:
            settings = _pixels(settings, readings.drawing, ui_scale)
    imgui.pop_item_width()
    if settings != state.settings:
        state.settings = settings


def _cost(state: EditorState, readings: FrameStatsView, ui_scale: float) -> None:
    """Error against exact, of the order too when one is kept, and the buttons."""
    settings = state.settings
    at_exact = is_exact(settings, readings.drawing)
    imgui.text_disabled(said("error against exact"))
    tip(
        "PSNR of what you see against the exact picture of the same view: nothing left out, "
        "sorted anew, float32. Measured once when all is still.", ui_scale,
    )  # fmt: skip
    imgui.same_line()
    right_aligned(error_text(readings, at_exact))
    if readings.stale_db is not None:
        imgui.text_disabled(said("of the kept order"))
        tip("PSNR of this frame, with the order it kept, against one sorted anew.", ui_scale)
        imgui.same_line()
        right_aligned(db_text(readings.stale_db))
    gap = imgui.get_style().item_spacing.x
    width = (imgui.get_content_region_avail().x - gap) / 2
    imgui.begin_disabled(not shortcuts(settings))
    if imgui.button(item_label("Back to exact"), imgui.ImVec2(width, 0)):
        plain = exact(settings, "")
        state.settings = replace(plain, debug=settings.debug, target=RenderSettings().target)
    imgui.end_disabled()
    tip("Every control below to the setting that leaves nothing out.", ui_scale)
    imgui.same_line()
    imgui.begin_disabled(at_exact)
    if imgui.button(item_label("Measure now"), imgui.ImVec2(width, 0)):
        state.measure_now = True
    imgui.end_disabled()
    tip("Draws this view exactly and as set, once each.", ui_scale)


def error_text(readings: FrameStatsView, at_exact: bool) -> str:
    """The figure; in brackets when the picture has changed since it was measured."""
    if at_exact:
        return "none"
    if readings.error_db is None:
        return "\u2026"
    text = db_text(readings.error_db)
    return f"({text})" if readings.error_is_old else text


def _culls(settings: RenderSettings, radius: float, ui_scale: float) -> RenderSettings:
    pixels = open_slider(
        "lambda", settings.max_pixels, 1.0, MAX_LAMBDA, "largest splat: %.0f px",
        "largest splat: any",
    )  # fmt: skip
    tip(
        "\u03c4\u03bb: splats with a longer sigma on the screen are left out. Saves the most "
        "pixels; what stands close loses its large surfaces.", ui_scale,
    )  # fmt: skip
    metres = open_slider(
        "distance", settings.max_distance, 0.01 * radius, FAR_RADII * radius,
        "distance: %.2f m", "distance: any",
    )  # fmt: skip
    tip(
        "\u03c4dist: splats farther away are left out. Saves whole parts of a large scene; "
        "the background goes.", ui_scale,
    )  # fmt: skip
    least = slider(
        "footprint", settings.min_pixels, 0.0, MOST_FOOTPRINT, "smallest splat: %.2f px",
        "smallest splat: any",
    )  # fmt: skip
    tip(
        "Splats that reach less far than this on the screen are left out. Saves sorting and "
        "set-up in far views; fine texture thins out.", ui_scale,
    )  # fmt: skip
    fade = slider("fade", settings.fade * 100, 0.0, 100.0, "fade: %.0f %%", "fade: none") / 100
    tip(
        "Part of each limit over which splats fade out before it. Nothing pops any more when "
        "you move; a little more is missing.", ui_scale,
    )  # fmt: skip
    return replace(
        settings, max_pixels=pixels, max_distance=metres, min_pixels=least, fade=min(fade, 1.0)
    )


def _order(settings: RenderSettings, ui_scale: float) -> RenderSettings:
    order = choice("order", settings.order, ORDERS, [ORDER_NAMES[name] for name in ORDERS])
    tip(
        "Along the view is the order that splats were trained with. Distance to the eye does not "
        "change when you only turn, so a kept order lasts longer.", ui_scale,
    )  # fmt: skip
    bits = choice("keys", settings.key_bits, (32, 16), ["32-bit keys", "16-bit keys"])
    tip(
        "16 bits over the range of the frame sort in half the passes; splats that are nearly "
        "equally deep may swap.", ui_scale,
    )  # fmt: skip
    frames, degrees = _cadence(settings, ui_scale)
    return replace(
        settings, order=order, key_bits=bits, resort_frames=frames, resort_degrees=degrees
    )


def _cadence(settings: RenderSettings, ui_scale: float) -> tuple[int, float]:
    """resort_frames and resort_degrees; the end of the first slider leaves it to the turn."""
    place = min(settings.resort_frames, BY_TURN - 1) or BY_TURN
    text = "sort every frame" if place == 1 else f"sort every {place} frames"
    text = "sort by turning alone" if place == BY_TURN else text
    moved, new = labelled_slider("cadence", place, 1, BY_TURN, text)
    place = int(new)
    tip(
        "Keeps an order for some frames. Saves sorts while you move; edges shimmer where the "
        "order is old. At rest the picture is sorted anew.", ui_scale,
    )  # fmt: skip
    frames = settings.resort_frames
    if moved:
        frames = 0 if place == BY_TURN else place
    imgui.begin_disabled(frames == 1)
    degrees = slider(
        "turn", settings.resort_degrees, 0.0, 20.0, "and after %.1f\u00b0 of turning",
        "not because of turning",
    )  # fmt: skip
    imgui.end_disabled()
    tip(
        "A kept order is also made anew after the view has turned by so much." if frames != 1
        else "Each frame is sorted; there is no order to keep.", ui_scale,
    )  # fmt: skip
    if frames == 0 and degrees == 0:  # else nothing would ever sort
        degrees = 1.0
    return frames, degrees


def _color(settings: RenderSettings, ui_scale: float) -> RenderSettings:
    degrees = slider(
        "recolor", settings.recolor_degrees, 0.0, 30.0, "colours after %.1f\u00b0",
        "colours for every view",
    )  # fmt: skip
    tip(
        "Colours are computed again only after the eye has gone so far around an object. Saves "
        "the colour network; highlights lag behind. At rest they are right.", ui_scale,
    )  # fmt: skip
    _, skip = imgui.checkbox(item_label("only what is in view"), settings.skip_unseen)
    tip(
        "Anchors that no view sees keep the colours they had. Costs nothing in the picture; "
        "saves where most of a scene is outside.", ui_scale,
    )  # fmt: skip
    return replace(settings, recolor_degrees=degrees, skip_unseen=skip)


def _pixels(settings: RenderSettings, drawing: str, ui_scale: float) -> RenderSettings:
    percent = slider(
        "scale", settings.render_scale * 100, 25.0, 200.0, "render scale: %.0f %%"
    )  # fmt: skip
    tip("Of width and height: 50 % draws a quarter of the pixels; details blur.", ui_scale)
    radii = [said("sharp all over")]
    radii += [said("sharp within {degrees:.0f}\u00b0", degrees=r) for r in RADIUS_DEGREES.values()]
    fovea = choice("fovea", settings.foveation, FOVEATIONS, radii)
    tip(
        "Farther from the middle a quarter of the pixels are drawn. Pays where a scene fills a "
        "wide view.", ui_scale,
    )  # fmt: skip
    tiles = not drawing.startswith("quads")
    imgui.begin_disabled(tiles)
    labels = [said("blend into {name}", name=name) for name in TARGETS]
    target = choice("target", settings.target, TARGETS, labels)
    imgui.end_disabled()
    tip(
        "Tiles blend in float32 registers: there is no target to choose." if tiles
        else "What quads blend into. auto: 16 bits from 0 to the scene's brightest colour, 80 dB "
        "and more; 16-bit floats where no such colour is known, 35 to 60 dB. 8 bits band, 32-bit "
        "floats are exact.", ui_scale,
    )  # fmt: skip
    imgui.begin_disabled(not tiles)
    values = sorted({*STOPS, settings.min_transmittance})
    names = [said("pixel full at 1/{part:.0f}", part=1 / value) for value in values]
    through = choice("through", settings.min_transmittance, values, names)
    imgui.end_disabled()
    tip(
        "A pixel takes no more splats once so little light is left behind it. Saves blending in "
        "dense scenes; dark pixels change by as much at most." if tiles
        else "Quads blend every splat: there is nothing to stop.", ui_scale,
    )  # fmt: skip
    return replace(
        settings, render_scale=percent / 100, target=target, min_transmittance=through,
        foveation=fovea,
    )  # fmt: skip
