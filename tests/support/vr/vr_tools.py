"""Somebody whose hands have the tools of a headset's session: no runtime, no picture."""

from dataclasses import replace

import numpy as np

from shapeshift.app.headset.panel_picture import PANEL
from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import SIDES
from shapeshift.vr.panel import Carried
from shapeshift.vr.play_space import PlaySpace
from tests.support.vr.vr_hands import a_frame, hand_at
from tests.support.vr.vr_panel import a_state

AWAY = Carried(PANEL)
# A room that lies turned, elsewhere and half as large in the world.
ROOM = PlaySpace(Pose(np.array([0.3, -1.0, 0.2]), np.array([0.9238795, 0, 0.3826834, 0])), 2.0)


class Hands:
    """Both hands of somebody who has the tools of a state."""

    def __init__(self, state=None, room: PlaySpace = ROOM) -> None:
        self.state, self.room = state or a_state(), room
        self.tools, self.editor = self.state.tools, self.state.editor
        self.hands = {side: hand_at((0.0, 5.0, 0.0)) for side in SIDES}  # far from all
        self.act()

    def act(self, carried: Carried = AWAY, seconds: float = 1 / 72, **hands):
        self.hands |= hands
        frame = a_frame(**self.hands)
        return self.tools.act(frame, self.room, carried, self.editor.scene, seconds)

    def at(self, world, side: str = "right", **state) -> None:
        """That hand is at a place (3,) of the world."""
        matrix = self.room.world_from_play.matrix()
        place = matrix[:3, :3].T @ (np.asarray(world) - matrix[:3, 3]) / self.room.scale
        self.hands[side] = hand_at(place, **state)
        self.act()

    def squeeze(self, side: str = "right", how: float = 1.0):
        return self.act(**{side: replace(self.hands[side], squeeze=how)})
