"""Adds the tool "Inspect" to the viewer: its section, keys, marks over the picture, reports."""

from dataclasses import dataclass, replace
from pathlib import Path

from shapeshift.app.editor.options import Options
from shapeshift.app.editor.panels.panel import Section
from shapeshift.app.editor.panels.sections.inspect_panel import InspectActions, draw_inspect
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.view_report import write_view_report
from shapeshift.app.editor.state.inspecting import Inspecting
from shapeshift.app.editor.state.parts.parts_tool import PartsTool
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.inspection.mouse_marks import KEYS, MouseMarks
from shapeshift.app.editor.window.inspection.picture_under import Seen
from shapeshift.app.editor.window.window import Window
from shapeshift.app.inspection.inspect_view import first_photo, inspect_view
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import BadFile

REPORT_PX = 1280  # longer side of a report's pictures


def attach_inspection(
    window: Window, state: EditorState, viewpoint: Viewpoint, hooks: Hooks, parts: PartsTool,
    seen: Seen, options: Options, folder: Path,
) -> Inspecting:  # fmt: skip
    """Adds it to the hooks; folder: of reports."""
    tool = Inspecting(state)
    mouse = MouseMarks(tool, state, window, viewpoint, parts, seen)
    reports = Reports(tool, state, viewpoint, seen, folder)
    actions = InspectActions(mouse.toggle, tool.auto, reports.write)
    hooks.event_handlers.insert(1, mouse.handle_event)  # handles in the picture see it before
    hooks.each_frame.append(mouse.each_frame)
    hooks.marks.append(mouse.draw)
    hooks.opened.append(mouse.forget)
    hooks.status.append(mouse.status)
    if options.screenshot is None:
        hooks.closing.append(tool.may_close)
    hooks.sections.append(
        Section(
            "Inspect",
            lambda scale: draw_inspect(tool, actions, seen.unit(), scale),
            opens=mouse.opens,
            shown=lambda: state.has_legend,
        )
    )
    hooks.keys["Inspect"] = list(KEYS)
    tool.opened()
    return tool


@dataclass
class Reports:
    """Reports of what is seen, one HTML file each, never over another."""

    tool: Inspecting
    state: EditorState
    viewpoint: Viewpoint
    seen: Seen
    folder: Path

    def write(self) -> None:
        """The view of now with all its marks."""
        tool, state, measured = self.tool, self.state, self.tool.measured
        if measured is None:
            return
        document, view = tool.document, self.viewpoint.view()
        part = min(1.0, REPORT_PX / max(view.size))
        width, height = (max(round(side * part), 1) for side in view.size)
        renderer = self.seen.renderer
        renderer.settings = RenderSettings(background=state.settings.background)
        photo = first_photo(document, measured)
        try:
            view = replace(view, size=(width, height))
            inspected = inspect_view(renderer, document, measured, photo, view)
            path = write_view_report(tool, measured, state.title, inspected, self.folder)
        except (BadFile, ValueError, OSError) as error:
            state.problem = said("No report was written: {error}", error=error)
            return
        finally:
            self.seen.forget()
        state.say(said("Saved {path}", path=path))
