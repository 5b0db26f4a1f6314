"""The panel's section "Performance": times and counts, the budget, every shortcut."""

from collections.abc import Mapping

from imgui_bundle import imgui

from shapeshift.app.editor.panels.sections.budget_panel import draw_budget
from shapeshift.app.editor.panels.sections.quality_panel import draw_quality
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import (
    ms_text,
    right_aligned,
    rows,
    subsection,
    tip,
)
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.frame_stats import FrameStatsView
from shapeshift.app.editor.state.messages import number
from shapeshift.app.editor.state.quality_controller import QualityController
from shapeshift.app.editor.texts.table import said
from shapeshift.renderer.debug.debug import REASON_TEXTS
from shapeshift.renderer.settings import CULL_REASONS, FrameStats

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
