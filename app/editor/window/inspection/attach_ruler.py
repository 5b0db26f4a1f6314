"""Adds the tool "Measure" to the viewer: its section, keys, lines over the picture, reports."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from shapeshift.app.drawing import make_folder
from shapeshift.app.editor.panels.inspection.ruler_panel import RulerActions, draw_ruler
from shapeshift.app.editor.panels.panel import Section
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.view_report import free_path
from shapeshift.app.editor.state.inspecting import Inspecting
from shapeshift.app.editor.state.parts.parts_tool import PartsTool
from shapeshift.app.editor.state.ruler import Ruler
from shapeshift.app.editor.state.user.settings import ProgramSettings
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.inspection.attach_inspection import REPORT_PX
from shapeshift.app.editor.window.inspection.mouse_ruler import KEYS, MouseRuler
from shapeshift.app.editor.window.inspection.picture_under import Seen
from shapeshift.app.editor.window.window import Window
from shapeshift.app.inspection.inspect_view import length_words
from shapeshift.app.inspection.length_report import SeenLengths, length_report
from shapeshift.app.inspection.report_pdf import write_report
from shapeshift.app.paths import file_name
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.inspection.lengths import UNITS


def attach_ruler(
    window: Window, state: EditorState, viewpoint: Viewpoint, hooks: Hooks, parts: PartsTool,
    seen: Seen, inspecting: Inspecting, settings: ProgramSettings, keep: Callable[[], None],
    folder: Path,
) -> Ruler:  # fmt: skip
    """Adds it to the hooks, after the tool "Inspect"; folder: of reports."""

    def unit() -> str:
        return settings.lengths if settings.lengths in UNITS else "m"

    def choose_unit(name: str) -> None:
        settings.lengths = name
        keep()

    ruler = Ruler(inspecting)
    mouse = MouseRuler(ruler, inspecting, state, window, viewpoint, parts, seen, unit)
    reports = LengthReports(inspecting, state, viewpoint, seen, unit, folder)
    actions = RulerActions(mouse.toggle, inspecting.keep, reports.write, unit, choose_unit)
    hooks.event_handlers.insert(1, mouse.handle_event)
    hooks.each_frame.append(mouse.each_frame)
    hooks.marks.append(mouse.draw)
    hooks.opened.append(mouse.forget)
    hooks.status.append(mouse.status)
    hooks.sections.append(
        Section("Measure", lambda scale: draw_ruler(ruler, actions, scale), opens=mouse.opens)
    )
    hooks.keys["Measure"] = list(KEYS)
    return ruler


@dataclass
class LengthReports:
    """Reports of what was measured in what is seen, one HTML file each, never over another."""

    inspecting: Inspecting
    state: EditorState
    viewpoint: Viewpoint
    seen: Seen
    unit: Callable[[], str]
    folder: Path

    def write(self) -> None:
        """The view of now with all lengths."""
        state, inspecting, view = self.state, self.inspecting, self.viewpoint.view()
        part = min(1.0, REPORT_PX / max(view.size))
        width, height = (max(round(side * part), 1) for side in view.size)
        view = replace(view, size=(width, height))
        renderer = self.seen.renderer
        renderer.settings = RenderSettings(background=state.settings.background)
        try:
            renderer.update(state.scene)
            renderer.draw([view])
            picture = renderer.resolved(0).copy()
            scene = (inspecting.source or Path(state.title)).name
            measured = length_words(inspecting.file, self.unit())
            seen = SeenLengths(picture, view, measured, inspecting.file.scale)
            report = length_report(state.title, scene, seen, inspecting.document.origin)
            make_folder(self.folder)
            path = free_path(self.folder, file_name(state.title))
            write_report(report, path)
        except (BadFile, ValueError, OSError) as error:
            state.problem = said("No report was written: {error}", error=error)
            return
        finally:
            self.seen.forget()
        state.say(said("Saved {path}", path=path))
