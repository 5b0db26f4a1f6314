"""A hand that takes hold of a section or a region: it follows the hand, and stays when let go."""

from dataclasses import dataclass, field, replace

import numpy as np

from shapeshift.app.editor.panels.outlines import moved, plane, segments
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.regions import Region
from shapeshift.app.editor.state.section_tool import TURNS, SectionHandle, SectionTool
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.pose import Pose
from shapeshift.scene.sections.section import (
    BoxShape,
    PlaneShape,
    held_by,
    moved_shape,
    plane_through,
)
from shapeshift.vr.frame import SIDES, Frame, Hand
from shapeshift.vr.locomotion.locomotion import GRIPS_AT, LETS_GO_AT
from shapeshift.vr.locomotion.play_space import PlaySpace
from shapeshift.vr.panel.carried import Carried

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
