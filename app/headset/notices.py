"""What is said to who wears the headset: that frames are late, at the lower edge of the view."""

from collections import deque

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.vr.card import Card
from shapeshift.vr.panel.plane import facing

WITHIN_S, LATE = 2.0, 3  # so many frames late in that time; fewer are nobody's business
SHOWN_S, QUIET_S = 4.0, 30.0  # so long it is said, and then not for so long
BEGINS_S = 5.0  # of a session, in which programs are compiled and files are read
BELOW = np.array([0.0, -0.22, -0.55])  # metres, of the head: below what one looks at
ADVICE = {"best": ": try Auto", "balanced": ": try Auto or Fast"}  # by the quality that is chosen


class Late:
    """Watches how many periods of the display saw no frame of ours."""

    def __init__(self) -> None:
        self._dropped: deque[tuple[float, int]] = deque()  # when, and how many until then
        self._since_s: float | None = None  # when it was said last
        self._began_s: float | None = None

    def watch(self, now_s: float, dropped: int) -> bool:
        """Whether it is to be said now."""
        if self._began_s is None:
            self._began_s = now_s
        if now_s < self._began_s + BEGINS_S:
            return False
        seen = self._dropped
        seen.append((now_s, dropped))
        while seen[0][0] < now_s - WITHIN_S:
            seen.popleft()
        late = seen[-1][1] - seen[0][1] >= LATE
        if late and (self._since_s is None or now_s - self._since_s > QUIET_S):
            self._since_s = now_s
        return self._since_s is not None and now_s - self._since_s < SHOWN_S


def late_card(head: Pose, quality: str) -> Card:
    """The words for it, where they do not stand over what one looks at."""
    place = head.position + head.matrix()[:3, :3] @ BELOW
    return Card((f"Frames are late{ADVICE.get(quality, '')}",), facing(place, head), 0.9)
