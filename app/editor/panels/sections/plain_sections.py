"""Sections of the panel that need no more than the state and what was measured."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from imgui_bundle import imgui

from shapeshift.app.editor.panels.panel import Section
from shapeshift.app.editor.panels.sections.quality_panel import draw_quality
from shapeshift.app.editor.panels.sections.regions_panel import draw_regions
from shapeshift.app.editor.panels.sections.stops_panel import draw_stops
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import (
    choice,
    item_label,
    labelled_slider,
    ms_text,
    right_aligned,
    rows,
    slider,
    subsection,
    tip,
)
from shapeshift.app.editor.state.arrange import edit
from shapeshift.app.editor.state.editor_state import AS_FILED, EditorState
from shapeshift.app.editor.state.frame_stats import FrameStatsView
from shapeshift.app.editor.state.messages import number
from shapeshift.app.editor.state.quality_controller import QualityController
from shapeshift.app.editor.texts.table import said
from shapeshift.renderer.colors.palette import PALETTES
from shapeshift.renderer.debug.debug import REASON_TEXTS
from shapeshift.renderer.settings import CULL_REASONS, DEBUG_VIEWS, FrameStats
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.appearance import NEUTRAL, Appearance, Color, Sky, plain_color
from shapeshift.scene.document import edits


def plain_sections(
    state: EditorState,
    draw_settings: Callable[[float], None],
    dial: QualityController,
    readings: FrameStatsView,
) -> list[Section]:
    """Stops, look, regions, settings, performance."""
    return [
        Section("Stops", lambda scale: draw_stops(state, scale), open_first=True),
        Section("Look", lambda scale: draw_look(state, scale), open_first=True),
        Section(
            "Regions",
            lambda scale: draw_regions(state, scale),
            open_first=bool(state.regions.items),
        ),
        Section("Settings", draw_settings),
        Section(
            "Performance",
            lambda scale: draw_performance(state, dial, readings, scale),
            open_first=dial.wanted,
        ),
    ]


# The panel's section "Look": palette, picture or debug view, appearance, background.

TWO_STOPS = ("one stop", "two stops beside a line", "heat over shape")
MOST_DETAIL = 3.0
PALETTE_TIP = (
    "The colours in which a stop shows its values. In all but turbo and rainbow lighter "
    "is hotter (in black-hot darker), also for eyes that confuse colours; viridis and cividis are "
    "made for them."
)
DEBUG_NAMES = {
    "": "picture",
    "culls": "what is culled, and why",
    "birdseye": "the same from above",
    "overdraw": "overdraw",
    "depth": "depth",
    "object": "objects",
    "ellipses": "splats as ellipses",
    "points": "splats as points",
    "rings": "splats as rings",
}


def draw_two_stops(state: EditorState, ui_scale: float) -> None:
    """One stop, two beside a line, or heat over the shape of the other."""
    split, index = state.split, state.sliders[0]
    now = TWO_STOPS[1 + split.over] if split.on else TWO_STOPS[0]
    chosen = choice("two stops", now, TWO_STOPS, TWO_STOPS)
    tip("Another stop at once: keys C and Shift+C. Its knob is blue.", ui_scale)
    if chosen == TWO_STOPS[0] and split.on:
        split.on = False
    elif chosen != now:
        obj, way = state.scene.objects[index], state.shifts.get(index)
        split.toggle(obj, chosen == TWO_STOPS[2], way)
    if split.on and split.over:
        split.detail = slider("detail", split.detail, 0.0, MOST_DETAIL, "shape: %.2f")
        tip("How much of the photo's edges shows through the colours of heat.", ui_scale)


def draw_look(state: EditorState, ui_scale: float) -> None:
    """Palette and debug view are neither saved with a scene nor undone, the rest is both."""
    imgui.push_item_width(-1)
    if state.has_palettes:
        names = [AS_FILED, *PALETTES]
        labels = [said("heat: as filed"), *(said("heat: {name}", name=name) for name in PALETTES)]
        chosen = choice("palette", state.palette, names, labels, names=True)
        tip(PALETTE_TIP, ui_scale)
        if chosen != state.palette:
            state.choose_palette(chosen)
    names = [said("show: {what}", what=said(DEBUG_NAMES[name])) for name in DEBUG_VIEWS]
    debug = choice("debug", state.settings.debug, DEBUG_VIEWS, names, names=True)
    tip("The picture, or what it is made of. Key G goes through these, Shift+G back.", ui_scale)
    if debug != state.settings.debug:
        state.settings = replace(state.settings, debug=debug)
    if state.split.possible and state.sliders:
        draw_two_stops(state, ui_scale)
    if state.scene.objects:
        draw_appearance(state, ui_scale)
        draw_background(state, ui_scale)
    imgui.pop_item_width()


# Of the panel's section "Look": exposure, gamma, tint and opacity, and what is behind everything.
#
# All of it is of the scene file: undone, and saved with it.

SLIDERS = {  # name -> least, most, what stands over it, logarithmic, what it does
    "exposure": (-4.0, 4.0, "exposure: %+.2f stops", False,
                 "Stops of light: 1 doubles it. Measured heat keeps its colours."),
    "gamma": (0.25, 4.0, "gamma: %.2f", True,
              "Above 1 dark tones are brighter, below 1 darker. Black and white stay."),
    "opacity": (0.0, 1.0, "opacity: %.2f", False, "Of every splat; at 0 nothing is seen."),
}  # fmt: skip
PICKED = imgui.ColorEditFlags_.no_inputs
CLEAR_SKY = Sky((0.36, 0.56, 0.85), (0.86, 0.91, 0.96), (0.42, 0.40, 0.37))
PARTS = {
    "zenith": "The colour straight above.",
    "horizon": "The colour level with the eye.",
    "ground": "The colour straight below.",
}


def draw_appearance(state: EditorState, ui_scale: float) -> None:
    """Of the chosen object where there is one, else of the whole scene."""
    item = edits.find(state.edited.file, state.chosen)
    of_scene = state.edited.file.appearance
    lit = (of_scene if item is None else item.appearance) != NEUTRAL
    if not subsection("Exposure, gamma, tint, opacity", lit):
        return
    name, now = ("", of_scene) if item is None else (item.name, item.appearance)
    imgui.push_id(f"appearance {name}")
    imgui.text_disabled(said("of {name}", name=name) if name else said("of the whole scene"))
    for field, (least, most, text, logarithmic, what) in SLIDERS.items():
        flags = imgui.SliderFlags_.always_clamp
        flags |= imgui.SliderFlags_.logarithmic if logarithmic else 0
        moved, value = labelled_slider(field, getattr(now, field), least, most, text, flags)
        tip(what, ui_scale)
        if moved:
            _appear(state, name, _with(now, field, round(value, 4)), field)
    tint = _picked("tint", now.tint, "A colour that is multiplied with all of its own.", ui_scale)
    if tint != now.tint:
        _appear(state, name, replace(now, tint=tint), "tint")
    if now != NEUTRAL:
        imgui.same_line()
        if imgui.button(item_label("As it was")):
            _appear(state, name, NEUTRAL, "")
        tip("No exposure, gamma 1, no tint, opacity 1.", ui_scale)
    imgui.pop_id()


def draw_background(state: EditorState, ui_scale: float) -> None:
    """One colour, or those of a sky."""
    now = state.settings.background
    changed, on = imgui.checkbox(item_label("sky"), isinstance(now, Sky))
    tip("Behind the scene a sky over a ground instead of one colour.", ui_scale)
    if changed:
        _put_sky(state, CLEAR_SKY if on else _plain(plain_color(now)), "")
        return
    if isinstance(now, Sky):
        for number, (part, what) in enumerate(PARTS.items()):
            if number:
                imgui.same_line()
            color = _picked(part, getattr(now, part), what, ui_scale)
            if color != getattr(now, part):
                _put_sky(state, replace(now, **{part: color}), part)
        return
    imgui.same_line()
    color = _picked("background", now, "The colour behind the scene.", ui_scale)
    if color != now:
        _put_sky(state, _plain(color), "background")


def _picked(name: str, color: Color, what: str, ui_scale: float) -> Color:
    """A field of a colour; a click opens where another one is chosen."""
    changed, chosen = imgui.color_edit3(item_label(name), list(color), PICKED)
    tip(said("{what} Click it to choose another.", what=said(what)), ui_scale)
    return three(min(max(part, 0.0), 1.0) for part in chosen) if changed else color


def _plain(color: Color) -> Sky:
    return Sky(color, color, color)


def _with(now: Appearance, field: str, value: float) -> Appearance:
    """With another exposure, gamma or opacity."""
    if field == "exposure":
        return replace(now, exposure=value)
    return replace(now, gamma=value) if field == "gamma" else replace(now, opacity=value)


def _appear(state: EditorState, name: str, appearance: Appearance, field: str) -> None:
    file = edits.set_appearance(state.edited.file, name, appearance)
    what = f"{field or 'look'} of {name or 'the scene'}"
    edit(state, file, what, f"{what} {name}" if field else "")


def _put_sky(state: EditorState, sky: Sky, part: str) -> None:
    file = edits.set_sky(state.edited.file, sky)
    edit(state, file, part or "sky", f"sky {part}" if part else "")


# The panel's section "Performance": times and counts, the budget, every shortcut.

Vec = imgui.ImVec2


def draw_performance(
    state: EditorState, dial: QualityController, readings: FrameStatsView, ui_scale: float
) -> None:
    """The frame in two lines, then five headings that fold."""
    _frame(readings, ui_scale)
    measured = dial.wanted or dial.measuring or dial.choice is not None
    headings = (
        ("Budget", measured, lambda: draw_budget(state, dial, ui_scale)),
        ("Quality", False, lambda: draw_quality(state, readings, ui_scale)),
        ("Passes", False, lambda: _passes(readings.stats.ms, ui_scale)),
        ("Counts", False, lambda: _counts(readings, ui_scale)),
        ("Machine", False, lambda: rows(readings.machine.items(), share=0.34)),
    )
    for name, lit, draw in headings:
        if subsection(name, lit, muted=False):
            imgui.indent(8 * ui_scale)
            imgui.push_id(name)
            draw()
            imgui.pop_id()
            imgui.unindent(8 * ui_scale)


def _frame(readings: FrameStatsView, ui_scale: float) -> None:
    """Its time, and how much of the scene it drew."""
    ms = readings.meter.ms
    if not ms > 0:
        return
    rate = said("at rest") if readings.idle else f"{1e3 / ms:.0f} fps"
    mode = said("fly" if readings.flying else "orbit")
    imgui.text(f"{ms_text(ms)} ms")
    tip("The whole frame, median of the last second. At rest nothing is drawn.", ui_scale)
    imgui.same_line()
    imgui.text_disabled(f"{rate}  \u2013  {mode}")
    stats = readings.stats
    imgui.text(number(stats.drawn))
    imgui.same_line()
    imgui.text_disabled(said("of {count} splats drawn", count=number(stats.splats)))


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


def _counts(readings: FrameStatsView, ui_scale: float) -> None:
    """Splats by the gate that they failed; how often work was done that not all frames need."""
    _splats(readings.stats)
    meter, now = readings.meter, readings.now
    shapes, colors = (meter.per_second(f"{what}_runs", now) for what in ("geometry", "color"))
    rows(
        [
            ("slowest of a second", f"{ms_text(meter.slowest_ms)} ms"),
            ("sorts a second", f"{meter.per_second('sorts', now):.0f}"),
            ("age of the order", said("{count} frames", count=readings.stats.order_age)),
            ("age of these counts", said("{count} frames", count=readings.stats.age)),
            ("shapes decoded a second", f"{shapes:.0f}"),
            ("colours decoded a second", f"{colors:.0f}"),
            ("of all frames", f"{number(meter.geometry_runs)}, {number(meter.color_runs)}"),
        ]
    )
    tip("Networks run when x changes (shapes) or when the eye has moved (colours).", ui_scale)


def _splats(stats: FrameStats) -> None:
    """Why splats were not drawn: the first gate that each failed; of hidden ones none was asked."""
    counts = [("in the scene", stats.splats), ("drawn", stats.drawn)]
    known = [why for why in CULL_REASONS if why in stats.culled]
    for why in known:
        counts.append((said("culled: {why}", why=said(REASON_TEXTS[why])), stats.culled[why]))
    counts += [(said("hidden behind others"), stats.hidden)] if stats.hidden else []
    rows([(name, number(count)) for name, count in counts])


# The panel's section "Budget": a dial for the frame time, a floor for the likeness.

MS_RANGE = (2.0, 200.0)
DB_RANGE = (20.0, 80.0)


def draw_budget(state: EditorState, dial: QualityController, ui_scale: float) -> None:
    """Moves the dial, starts and stops measuring, says what was chosen and what it costs."""
    imgui.push_item_width(-1)
    flags = imgui.SliderFlags_
    moved, ms = labelled_slider(
        "target", dial.target_ms, *MS_RANGE, "a frame in at most %.1f ms",
        flags.logarithmic | flags.always_clamp,
    )  # fmt: skip
    tip("Whole frame. A headset of 90 Hz needs 11 ms.", ui_scale)
    changed, db = labelled_slider(
        "floor", dial.floor_db, *DB_RANGE, "as the exact picture to %.0f dB"
    )
    tip(
        "PSNR against the exact picture. 30 dB is visible, 40 dB hardly, 50 dB is not.", ui_scale
    )  # fmt: skip
    imgui.pop_item_width()
    if moved or changed:
        dial.target_ms, dial.floor_db = ms, db
        if dial.rows:
            dial.choose()
            state.settings = dial.applied(state.settings)
    if dial.measuring:
        _progress(dial, ui_scale)
    else:
        if imgui.button(
            item_label("Measure again" if dial.rows else "Measure and choose"), imgui.ImVec2(-1, 0)
        ):
            dial.wanted = True
        tip(
            "Times a dozen settings on this scene, on this machine, around this view. Then the "
            "dials above choose at once.", ui_scale,
        )  # fmt: skip
    _, dial.dynamic = imgui.checkbox(item_label("fewer pixels while moving"), dial.dynamic)
    tip(
        "Dynamic resolution: where frames are slower than the dial says, moving pictures get "
        "fewer pixels, never below the floor once it is measured. At rest all are drawn.",
        ui_scale,
    )
    if dial.choice is not None:
        imgui.push_text_wrap_pos(0)
        imgui.text_unformatted(dial.choice.sentence)
        imgui.pop_text_wrap_pos()


def _progress(dial: QualityController, ui_scale: float) -> None:
    """How far it is, and the way out."""
    gap = imgui.get_style().item_spacing.x
    width = imgui.get_content_region_avail().x
    button = 76 * ui_scale
    imgui.progress_bar(dial.progress, imgui.ImVec2(width - button - gap, 0), said("measuring"))
    imgui.same_line()
    if imgui.button(item_label("Cancel"), imgui.ImVec2(button, 0)):
        dial.cancel()
