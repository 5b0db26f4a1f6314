"""The tools that a hand of the headset can have, in their order; one of them has its trigger."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from shapeshift.app.document import Document
from shapeshift.app.editor.state.arrange import undo
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.view_report import write_view_report
from shapeshift.app.editor.state.inspecting import Inspecting
from shapeshift.app.editor.state.parts.parts_tool import PartsTool
from shapeshift.app.editor.state.section_tool import SectionTool
from shapeshift.app.editor.state.user.settings import ProgramSettings
from shapeshift.app.editor.texts.table import said
from shapeshift.app.headset.in_hand.finger_brush import FingerBrush
from shapeshift.app.headset.in_hand.held_shapes import HeldShapes
from shapeshift.app.headset.in_hand.probe import REPORT_PX, before_head
from shapeshift.app.headset.in_hand.ray_marks import Measure, RayMarks
from shapeshift.app.inspection.draw_values import MeasuredScene
from shapeshift.app.inspection.inspect_view import InspectedView
from shapeshift.app.paths import WorkFolders, config_folder
from shapeshift.runtime_models.files.json_fields import control_row
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene
from shapeshift.scene.sections.section import PlaneShape
from shapeshift.vr.frame import Frame
from shapeshift.vr.locomotion.play_space import PlaySpace
from shapeshift.vr.panel.carried import Carried

Inspect = Callable[[Document, MeasuredScene, View], InspectedView]
AHEAD_M, BELOW_M = 0.45, 0.2  # of the room, from the head: where a section is brought to
DECIMALS = 6


@dataclass
class HandTools:
    """What the desktop's tools know, and what hands do to them; `unit`: of temperatures, wanted."""

    editor: EditorState
    parts: PartsTool
    unit: str = ""
    sections: SectionTool = field(init=False)
    inspecting: Inspecting = field(init=False)
    shapes: HeldShapes = field(init=False)
    brush: FingerBrush = field(init=False)
    marks: RayMarks = field(init=False)
    inspect: Inspect | None = None  # None: nothing can be drawn
    wants_report: bool = False  # of what the head has before it in the next frame
    folder: Path | None = None  # of reports; None: the exports
    _pulled: str = ""  # which of them had the trigger in the frame before
    _before: tuple[np.ndarray, np.ndarray] | None = None  # a place before the head, its right

    def __post_init__(self) -> None:
        self.sections, self.inspecting = SectionTool(self.editor), Inspecting(self.editor)
        self.shapes = HeldShapes(self.editor, self.sections)
        self.brush = FingerBrush(self.editor)
        self.marks = RayMarks(self.inspecting)

    def open(self, measure: Measure, inspect: Inspect | None = None) -> None:
        """A scene that was opened, with the marks beside it."""
        self.marks.measure, self.inspect = measure, inspect
        self.unit = ProgramSettings.read(config_folder()).temperature
        self.inspecting.opened()

    def act(
        self, frame: Frame, play_space: PlaySpace, carried: Carried, shown: Scene, seconds: float
    ) -> Frame:
        """What hands do with them in a frame; the frame with what they leave.  shown: as drawn."""
        self._one_trigger()
        matrix = play_space.pose(frame.head).matrix()
        ahead = frame.head.position - AHEAD_M * frame.head.matrix()[:3, 2]
        place = play_space.point(ahead - np.array([0.0, BELOW_M, 0.0]))
        self._before = place, matrix[:3, 0]
        frame = self.shapes.act(frame, play_space, carried)
        frame = self.brush.act(frame, play_space, carried, seconds)
        frame = self.marks.act(frame, play_space, carried, shown)
        self.editor.record_regions()
        if self.wants_report:
            self.wants_report = False
            self._report(before_head(frame.head, play_space, REPORT_PX))
        return frame

    def _report(self, view: View) -> None:
        """One HTML file of a view with all its marks; the session waits for it."""
        tool, measured = self.inspecting, self.inspecting.measured
        if measured is None or self.inspect is None:
            return
        folder, title = self.folder or WorkFolders.of().exports, self.editor.title
        try:
            inspected = self.inspect(tool.document, measured, view)
            path = write_view_report(tool, measured, title, inspected, folder)
        except (BadFile, ValueError, OSError) as error:
            tool.fail(said("No report was written: {error}", error=error))
            return
        tool.note(said("Saved {path}", path=path))

    def _one_trigger(self) -> None:
        """What was taken last has it; the others are put away."""
        on = {
            name: tool.on
            for name, tool in (
                ("parts", self.parts), ("paint", self.brush), ("marks", self.inspecting),
            )
        }  # fmt: skip
        taken = [name for name, is_on in on.items() if is_on and name != self._pulled]
        if taken or not on.get(self._pulled, False):
            self._pulled = taken[0] if taken else ""
        if on["parts"] and self._pulled != "parts":
            self.parts.toggle()
        self.brush.on = on["paint"] and self._pulled == "paint"
        self.inspecting.on = on["marks"] and self._pulled == "marks"

    def bring(self) -> None:
        """The section that is edited comes before the eyes."""
        if self._before is not None:
            self.shapes.bring(*self._before)

    def undo(self) -> str:
        """Takes the last edit of the scene or its regions back; what it was, "" for none."""
        return undo(self.editor)

    def key(self) -> tuple:
        """What the panel tells of them; equal as long as its picture is right."""
        tool, marks, editor = self.inspecting, self.marks, self.editor
        return (
            self.sections.on, self.sections.number, self.sections.sections, self.shapes.side,
            editor.regions.version, editor.regions.chosen, self.brush.on, self.brush.erases,
            round(self.brush.radius_m, 3), tool.on, tool.file, tool.chosen, marks.pulls,
            marks.first is None, id(tool.readings), editor.settings.heat_ends,
            editor.edited.history.at,
        )  # fmt: skip

    def row(self) -> dict:
        """What a line of a report says of them: metres of the world."""
        tool, marks, brush = self.inspecting, self.marks, self.brush
        shape, pointed = self.sections.shape, marks.pointed
        painted = (r.painted for r in self.editor.regions.items if r.painted is not None)
        cut = None
        if shape is not None:
            plane = isinstance(shape, PlaneShape)
            numbers = (*shape.normal, shape.offset_m) if isinstance(shape, PlaneShape) else (
                *shape.centre, *shape.half)  # fmt: skip
            current = self.sections.current
            beyond = current.beyond if current is not None else None
            cut = {
                "kind": "plane" if plane else "box",
                "numbers": [round(float(n), DECIMALS) for n in numbers],
                "beyond": None if beyond is None else control_row(beyond, DECIMALS),
            }
        return {
            "has": self._pulled,
            "section": cut,
            "holds": self.shapes.side,
            "brush_m": round(brush.radius_m, DECIMALS) if brush.on else None,
            "painted": int(sum(int(each.sum()) for each in painted)),
            "value": known(pointed.value) if pointed is not None else None,
            "metres": known(pointed.metres) if pointed is not None else None,
            "under": marks.under,
            "marks": {
                mark.name: {
                    "place": [round(float(n), DECIMALS) for n in mark.place],
                    "value": known(tool.readings[mark.name].mean)
                    if mark.name in tool.readings
                    else None,
                }
                for mark in tool.file.marks
            },
        }


def known(number: float) -> float | None:
    """A number for JSON; None where there is none."""
    return round(float(number), DECIMALS) if np.isfinite(number) else None
