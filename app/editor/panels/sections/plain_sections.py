"""Sections of the panel that need no more than the state and what was measured."""

from collections.abc import Callable

from shapeshift.app.editor.panels.panel import Section
from shapeshift.app.editor.panels.sections.look_panel import draw_look
from shapeshift.app.editor.panels.sections.performance_panel import draw_performance
from shapeshift.app.editor.panels.sections.regions_panel import draw_regions
from shapeshift.app.editor.panels.sections.stops_panel import draw_stops
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.frame_stats import FrameStatsView
from shapeshift.app.editor.state.quality_controller import QualityController


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
