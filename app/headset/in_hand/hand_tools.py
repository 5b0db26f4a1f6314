"""The tools that a hand of the headset can have, in their order; one of them has its trigger."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from shapeshift.app.document import Document
from shapeshift.app.editor.panels.outlines import moved, plane, segments
from shapeshift.app.editor.state.arrange import undo
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.parts.parts_tool import PartsTool
from shapeshift.app.editor.state.regions import Region
from shapeshift.app.editor.state.section_tool import TURNS, SectionHandle, SectionTool
from shapeshift.app.editor.state.user.settings import ProgramSettings
from shapeshift.app.editor.texts.table import said
from shapeshift.app.headset.in_hand.finger_brush import FingerBrush
from shapeshift.app.inspection.draw_values import MeasuredScene
from shapeshift.app.inspection.inspect_view import InspectedView
from shapeshift.app.inspection.window.inspecting import Inspecting
from shapeshift.app.inspection.window.probe import REPORT_PX, before_head
from shapeshift.app.inspection.window.ray_marks import Measure, RayMarks
from shapeshift.app.inspection.window.view_report import write_view_report
from shapeshift.app.paths import WorkFolders, config_folder
from shapeshift.runtime_models.files.json_fields import control_row
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import Scene
from shapeshift.scene.sections.section import (
    BoxShape,
    PlaneShape,
    held_by,
    moved_shape,
    plane_through,
)
from shapeshift.vr.frame import SIDES, Frame, Hand
from shapeshift.vr.locomotion import GRIPS_AT, LETS_GO_AT
from shapeshift.vr.panel import Carried
from shapeshift.vr.play_space import PlaySpace

# A hand that takes hold of a section or a region: it follows the hand, and stays when let go.

REACH_M = 0.10  # of the room, from the palm to what it takes
HANDLE_M = 0.05  # the same of a handle, which comes before the whole
GRID_PART = 0.6  # of the scene's radius: how far a plane is drawn to either side


@dataclass
class HeldShapes:
    """Keeps which hand holds what; `side` "": nothing is held."""

    editor: EditorState
    sections: SectionTool
    side: str = ""
    _shut: frozenset[str] = frozenset(SIDES)  # hands that have to open before they take
    _number: int = -1  # of the section that is held; -1: a region is
    _in_hand: PlaneShape | BoxShape | None = None  # of the hand that holds it whole
    _handle: SectionHandle | None = None  # or as it was when it was taken
    _start: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) of the palm, world
    _region: tuple[np.ndarray, np.ndarray] | None = None  # centre and normal in the hand's frame

    @property
    def shown(self) -> Region | None:
        """The region that hands can take: chosen on the panel, and one that has a place."""
        region = self.editor.regions.current
        if region is None or not region.is_placed:
            return None
        return region if region.index < len(self.editor.scene.objects) else None

    def act(self, frame: Frame, play_space: PlaySpace, carried: Carried) -> Frame:
        """Takes, carries, lets go; the frame with what it leaves of the hands."""
        before, hands = self._shut, frame.hands
        self._shut = frozenset(s for s in SIDES if closed(hands[s], s in before))
        if self.side and self._ends(hands[self.side]):
            self.side = ""
            self.editor.rest()
        if not self.side:
            for side in SIDES:
                busy = carried.taken and side == carried.pointer
                if (
                    side in self._shut - before
                    and not busy
                    and self._grasp(hands[side], play_space)
                ):
                    self.side = side
                    break
        if not self.side:
            return frame
        hand = hands[self.side]
        assert hand.grip is not None  # a hand without one holds nothing
        self._follow(play_space.pose(hand.grip))
        taken = replace(hand, squeeze=0.0, trigger=0.0 if hand.joints is not None else hand.trigger)
        return replace(frame, hands={**hands, self.side: taken})

    def near(self, hand: Hand, play_space: PlaySpace) -> bool:
        """Whether it would take something by a squeeze."""
        return hand.grip is not None and self._within(play_space.pose(hand.grip), play_space) != ""

    def _ends(self, hand: Hand) -> bool:
        if hand.grip is None or self.side not in self._shut:
            return True
        if self._number < 0:
            return self.shown is None
        return not self.sections.on or self.sections.number != self._number

    def _grasp(self, hand: Hand, play_space: PlaySpace) -> bool:
        if hand.grip is None:
            return False
        palm = play_space.pose(hand.grip)
        what = self._within(palm, play_space)
        hand_from_world = Pose.from_matrix(np.linalg.inv(palm.matrix()))
        self._in_hand = self._handle = self._region = None
        self._start = palm.position
        if what == "section":
            shape = self.sections.shape
            assert shape is not None  # one is near
            self._number = self.sections.number
            self._handle = self._handle_at(palm.position, HANDLE_M * play_space.scale)
            self._in_hand = moved_shape(shape, hand_from_world)
        elif what == "region":
            region, matrix = self.shown, hand_from_world.matrix()
            assert region is not None  # one is near
            world = self._world_from_region(region)
            at = matrix @ world @ np.append(region.centre, 1.0)
            self._number = -1
            self._region = at[:3], matrix[:3, :3] @ world[:3, :3] @ region.normal
        return what != ""

    def _handle_at(self, place: np.ndarray, reach: float) -> SectionHandle | None:
        """A side of a box, or the tip of a plane's arrow; the face of a plane is the whole."""
        handles = [h for h in self.sections.handles() if h.key == TURNS or self._is_box]
        near = [(float(np.linalg.norm(h.place - place)), h) for h in handles]
        found = min(near, key=lambda pair: pair[0], default=None)
        return found[1] if found is not None and found[0] <= reach else None

    @property
    def _is_box(self) -> bool:
        return isinstance(self.sections.shape, BoxShape)

    def _within(self, palm: Pose, play_space: PlaySpace) -> str:
        """What the palm can take: section, region, or "" for nothing."""
        reach, shape = REACH_M * play_space.scale, self.sections.shape
        if self.sections.on and shape is not None:
            away = self._away(shape, palm.position)
            handle = self._handle_at(palm.position, HANDLE_M * play_space.scale)
            if away <= reach or handle is not None:
                return "section"
        region = self.shown
        if region is not None:
            lines = moved(
                segments(region, self.editor.regions.radius), self._world_from_region(region)
            )
            middle = lines.reshape(-1, 3).mean(axis=0)
            places = np.concatenate([lines.reshape(-1, 3), lines.mean(axis=1), middle[None]])
            if np.linalg.norm(places - palm.position, axis=1).min() <= reach:
                return "region"
        return ""

    def _away(self, shape: PlaneShape | BoxShape, place: np.ndarray) -> float:
        """Metres of the world from a place (3,) to the part of a plane that is drawn, or to a box's
        surface.
        """
        if isinstance(shape, PlaneShape):
            normal, to = np.array(shape.normal), place - self.sections.pivot
            across = float(normal @ to)
            aside = np.linalg.norm(to - across * normal) - GRID_PART * self.editor.radius
            return float(np.hypot(across, max(float(aside), 0.0)))
        beyond = np.abs(shape.axes.T @ (place - np.array(shape.centre))) - np.array(shape.half)
        if (beyond <= 0).all():
            return float(-beyond.max())
        return float(np.linalg.norm(np.maximum(beyond, 0.0)))

    def _follow(self, palm: Pose) -> None:
        """What is held, where the hand is now."""
        tool = self.sections
        if self._region is not None:
            self._carry_region(palm)
            return
        current, shape = tool.current, tool.shape
        assert current is not None and shape is not None and self._in_hand is not None
        together = f"section {tool.number} in a hand"
        if self._handle is None:
            carried = held_by(replace(current, shape=self._in_hand), palm)
            tool.put_shape(carried.shape, together)
        elif isinstance(shape, PlaneShape):
            arrow = palm.position - tool.pivot
            if np.linalg.norm(arrow) > 1e-3:
                tool.put_shape(plane_through(tool.pivot, arrow), together)
        else:
            by = float((palm.position - self._start) @ self._handle.normal)
            tool.put_face(self._handle, self._handle.place + by * self._handle.normal, together)

    def _carry_region(self, palm: Pose) -> None:
        region = self.shown
        assert region is not None and self._region is not None
        region_from_hand = np.linalg.inv(self._world_from_region(region)) @ palm.matrix()
        centre, normal = self._region
        changes = {"centre": (region_from_hand @ np.append(centre, 1.0))[:3]}
        if region.kind == "half-space":
            turned = region_from_hand[:3, :3] @ normal
            changes["normal"] = turned / np.linalg.norm(turned)
        self.editor.regions.edit(self.editor.regions.chosen, **changes)

    def _world_from_region(self, region: Region) -> np.ndarray:
        return self.editor.scene.objects[region.index].world_from_object.matrix()

    def bring(self, place: np.ndarray, right: np.ndarray) -> None:
        """The section that is edited comes to a place (3,) of the world.  A plane stands upright
        there, and keeps what lies at the left; right (3,): of the head, in the world.
        """
        shape = self.sections.shape
        if isinstance(shape, PlaneShape):
            level = right * (1, 0, 1)
            upright = np.linalg.norm(level) > 1e-3
            self.sections.put_shape(plane_through(place, level if upright else right))
        elif shape is not None:
            self.sections.put_shape(replace(shape, centre=three(place)))
        self.editor.rest()

    def lines(self) -> np.ndarray:
        """(S, 2, 3) metres of the world: outlines of what hands can take."""
        parts, shape, region = [np.zeros((0, 2, 3))], self.sections.shape, self.shown
        if self.sections.on and isinstance(shape, PlaneShape):
            grid = plane(np.array(shape.normal), GRID_PART * self.editor.radius)[:-1]
            face, tip = self.sections.handles()
            parts += [self.sections.pivot + grid, np.array([[face.place, tip.place]])]
        elif self.sections.on and isinstance(shape, BoxShape):
            turned = np.eye(4)
            turned[:3, :3], turned[:3, 3] = shape.axes, shape.centre
            parts.append(moved(segments(Region("box", "", half=np.array(shape.half)), 0.0), turned))
        if region is not None:
            edges = segments(region, self.editor.regions.radius)
            parts.append(moved(edges, self._world_from_region(region)))
        return np.concatenate(parts)


def closed(hand: Hand, was: bool) -> bool:
    """Whether a hand squeezes, or is lost: it has to be seen open before it takes anything."""
    return hand.grip is None or hand.squeeze >= (LETS_GO_AT if was else GRIPS_AT)


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
