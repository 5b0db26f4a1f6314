"""A frame as it is for who wears the headset: how high they are, and which hands they have."""

from dataclasses import replace

from shapeshift.app.headset.worn_settings import KeptSettings
from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import Frame
from shapeshift.vr.locomotion.height import lift_of, lifted
from shapeshift.vr.one_hand import alone
from shapeshift.vr.openxr.spaces import EYE_HEIGHT_M
from shapeshift.vr.panel.carried import Palm


class Fitting:
    """Keeps by how much the room is raised: it is measured at Recentre, and stays until the next.

    `lift_m`: metres.
    """

    def __init__(self, settings: KeptSettings) -> None:
        self._settings, self.lift_m = settings, 0.0
        self._next_m = 0.0  # from the next frame on
        self._posture = settings.now.posture
        self._palm = Palm()

    def measure(self, head: Pose) -> None:
        """Of the head as the last frame had it, raised; from the next frame on it holds."""
        y = float(head.position[1]) - self.lift_m
        self._posture = self._settings.now.posture
        self._next_m = lift_of(self._posture, y, EYE_HEIGHT_M)

    def worn(self, frame: Frame, seconds: float) -> tuple[Frame, bool]:
        """The frame, and whether the room has another height since the one before."""
        moves = self._next_m != self.lift_m
        self.lift_m = self._next_m
        frame = lifted(frame, self.lift_m)
        if moves:
            frame = replace(frame, recentred=True)
        if self._posture != self._settings.now.posture:
            self.measure(frame.head)
        if side := self._settings.now.one_hand:
            frame, self._palm = alone(frame, side, self._palm, seconds)
        return frame, moves
