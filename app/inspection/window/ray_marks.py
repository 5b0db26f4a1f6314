"""Marks by a hand's ray: what it meets in degrees and metres, spots, lengths, and their removal."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from shapeshift.app.editor.texts.table import said
from shapeshift.app.inspection.draw_values import MeasuredScene
from shapeshift.app.inspection.mark_options import free_name
from shapeshift.app.inspection.window.inspecting import Inspecting
from shapeshift.app.inspection.window.probe import along_ray, before_head, middle_of
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.inspection.contours import contour_lines
from shapeshift.scene.inspection.lengths import Measurement, Point, Scale, measure
from shapeshift.scene.inspection.marks import MOST_MARKS, Mark
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import Scene
from shapeshift.vr.frame import Frame, Hand
from shapeshift.vr.panel import Carried
from shapeshift.vr.play_space import PlaySpace

PRESSED, LET_GO = 0.6, 0.4  # of a trigger
POINTS_EVERY_S, SEES_EVERY_S = 0.15, 0.5  # so often the ray, and what the head sees, are measured
NEAR_DEG, NEAR_M = 1.5, 0.01  # so near to the ray a mark is meant; metres of the room
BEHIND = 0.05  # of the ray's length: a mark so far behind what it meets is hidden
SPOTS, LENGTHS = "spots", "lengths"  # what a pull of the trigger begins
Measure = Callable[[MeasuredScene | None, Scene, View], ValuePicture]


@dataclass(frozen=True, eq=False)
class Pointed:
    """What the ray met when it was measured last."""

    value: float  # NaN where less than half is covered
    metres: float  # of the world along the ray
    place: np.ndarray  # (3,) world
    picture: ValuePicture


@dataclass
class RayMarks:
    """Keeps what the desktop's `Inspecting` knows up to date, and lays marks into it."""

    tool: Inspecting
    measure: Measure | None = None  # None: nothing can be drawn
    pulls: str = SPOTS
    pointed: Pointed | None = None
    under: str = ""  # name of the mark that the ray means
    first: Point | None = None  # of a length whose second end is waited for
    lengths: dict[str, Measurement] = field(default_factory=dict)  # by mark, of this session
    contours: tuple[tuple[str, np.ndarray], ...] = ()  # kind, (S, 2, 3) metres of the world
    wants_auto: bool = False
    _down: bool = True  # a trigger that is down when the tool is taken has to be let go first
    _pointed_s: float = -np.inf  # of the session, when it was measured
    _saw_s: float = -np.inf
    _marks: tuple[Mark, ...] = ()  # that were read last
    _drawn_of: tuple = ()

    def act(self, frame: Frame, play_space: PlaySpace, carried: Carried, scene: Scene) -> Frame:
        """While the tool is on: what the pointing hand means; the frame with what it leaves."""
        side = carried.pointer
        hand = frame.hands[side]
        if not self.tool.on:
            self.forget()
            return frame
        try:
            self._see(frame, play_space, scene)
            if hand.aim is None or carried.on_panel:
                self.pointed, self.under, self._down = None, "", True
                return frame
            self._act(hand, frame.seen_s, play_space, scene)
        except BadFile as error:
            self.tool.on = False
            self.tool.fail(said("There is no room to measure: {error}", error=error))
            return frame
        squeeze = hand.squeeze if hand.joints is None else 0.0  # a pinch is both
        left = replace(hand, trigger=0.0, squeeze=squeeze, secondary=False)
        return replace(frame, hands={**frame.hands, side: left})

    def forget(self) -> None:
        """The tool is put away."""
        self.pointed, self.under, self.first, self._down = None, "", None, True
        self._pointed_s = self._saw_s = -np.inf
        self.contours, self._drawn_of = (), ()

    def _act(self, hand: Hand, now_s: float, play_space: PlaySpace, scene: Scene) -> None:
        assert hand.aim is not None  # act has seen to it
        pressed = hand.trigger > (LET_GO if self._down else PRESSED)
        begins = pressed and not self._down
        self._down = pressed
        if begins or now_s - self._pointed_s >= POINTS_EVERY_S or now_s < self._pointed_s:
            self._point(hand.aim, now_s, play_space, scene)
        aim = play_space.pose(hand.aim)
        self.under = self._mark_at(aim, play_space.scale)
        if not begins:
            return
        if self.under and hand.secondary:
            self.tool.delete(self.under)
            self.under = ""
        elif self.pulls == LENGTHS:
            self._end()
        elif self.under:
            self.tool.chosen = self.under
        elif self.pointed is not None and self.tool.measured is not None:
            width, height = self.pointed.picture.view.size
            self.tool.lay("spot", (width / 2, height / 2), (0, 0), self.pointed.picture)

    def _point(self, aim: Pose, now_s: float, play_space: PlaySpace, scene: Scene) -> None:
        if self.measure is None:
            return
        self._pointed_s = now_s
        picture = self.measure(self.tool.measured, scene, along_ray(aim, play_space))
        picture = self.tool.corrected(picture)
        self.pointed = Pointed(*middle_of(picture), picture)

    def _see(self, frame: Frame, play_space: PlaySpace, scene: Scene) -> None:
        """What marks read and where isotherms lie, as the head has it before it."""
        tool, measured = self.tool, self.tool.measured
        if measured is None or self.measure is None:
            return
        due = frame.seen_s - self._saw_s >= SEES_EVERY_S or frame.seen_s < self._saw_s
        due |= tool.file.marks is not self._marks
        asks = bool(tool.file.marks or tool.file.isotherms) or self.wants_auto
        if asks and due:
            self._saw_s, self._marks = frame.seen_s, tool.file.marks
            tool.saw(self.measure(measured, scene, before_head(frame.head, play_space)))
        if self.wants_auto and tool.picture is not None:
            self.wants_auto = False
            tool.auto()
        drawn_of = (tool.picture, tool.file.isotherms)
        if tool.picture is not None and self._drawn_of != drawn_of:
            self._drawn_of = drawn_of
            lines = ((each.kind, contour_lines(tool.picture, each)) for each in drawn_of[1])
            self.contours = tuple(lines)

    def _mark_at(self, aim: Pose, scale: float) -> str:
        """The mark that a ray of the world means; "": none."""
        start, along = aim.position, -aim.matrix()[:3, 2]
        hidden = np.inf
        if self.pointed is not None and np.isfinite(self.pointed.metres):
            hidden = self.pointed.metres * (1 + BEHIND)
        near: list[tuple[float, str]] = []
        for mark in self.tool.file.marks:
            to = mark.place - start
            metres = float(to @ along)
            aside = float(np.linalg.norm(to - metres * along))
            slack = max(metres * np.tan(np.radians(NEAR_DEG)), NEAR_M * scale)
            if 0 < metres <= hidden + NEAR_M * scale and aside <= slack:
                near.append((aside / slack, mark.name))
        return min(near)[1] if near else ""

    def _end(self) -> None:
        """One end of a length: of the mark that the ray means, else of the surface."""
        picked = self._picked()
        if picked is None:
            return
        if self.first is None:
            self.first = picked
            return
        first, self.first = self.first, None
        tool, names = self.tool, [mark.name for mark in self.tool.file.marks]
        name = free_name("line", names)
        try:
            if len(names) >= MOST_MARKS:
                raise ValueError(f"{MOST_MARKS:,} marks are the most that fit one file.")
            found = measure("distance", [first, picked], Scale(tool.file.metres_per_unit))
            mark = Mark(name, "line", np.stack([first.metres, picked.metres]))
        except ValueError as error:
            tool.note(str(error))
            return
        self.lengths[name] = found
        tool.chosen = name
        marks = (*tool.file.marks, mark)
        tool.edit(replace(tool.file, marks=marks), what=f"add {mark.name}")

    def _picked(self) -> Point | None:
        if self.pointed is None or not np.isfinite(self.pointed.metres):
            self.tool.note(said("Nothing is there that covers half of the ray."))
            return None
        picture = self.pointed.picture
        width, height = picture.view.size
        there = picture.picked((width / 2, height / 2))
        found = [m for m in self.tool.file.marks if m.name == self.under and m.kind == "spot"]
        return Point(found[0].place, there.covariance) if found else there
