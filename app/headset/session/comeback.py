"""From a lost session to the next one: the person stands where they stood, hands hold on."""

from shapeshift.app.headset.xr_user import XrState
from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import Frame
from shapeshift.vr.locomotion.play_space import PlaySpace
from shapeshift.vr.locomotion.stance import play_space_before, underfoot

PATIENCE_S = 3.0  # for hands that held something, once the runtime gives hands at all


class Comeback:
    """Until it is `over` the world stands still, so that nothing falls out of hands unseen.

    `placed`: the room has its place again.

    same_room: the origin of play space is a place of the room's, which the next session has too.
    """

    def __init__(self, state: XrState, head: Pose, same_room: bool) -> None:
        before = state.play_space
        self._eye, self._scale = before.pose(head), before.scale
        self._level = float(before.point(underfoot(head))[1])
        self._holding = [side for side, name in state.user.touched.held.items() if name is not None]
        self._kept = before if same_room else None
        self.placed, self._waited_s, self.over = False, 0.0, False

    def place(self, frame: Frame) -> PlaySpace | None:
        """Once, of the first frame that knows the head: where the room is now."""
        if self.placed or not frame.drawn:
            return None
        self.placed = True
        return self._kept or play_space_before(self._eye, frame.head, self._level, self._scale)

    def rests(self, frame: Frame, seconds: float) -> bool:
        """Whether the world still waits for this frame's hands."""
        if not self.placed:
            return True
        if self._holding and self._waited_s < PATIENCE_S:
            self._waited_s += seconds if frame.focused else 0.0
            back = all(frame.hands[side].active for side in self._holding)
            if not (frame.focused and back):
                return True
        self.over = True
        return False
