"""The runtime and our session with it, opened again where it is lost while somebody wears it."""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from math import ceil
from typing import Protocol

import moderngl

from shapeshift.app.headset.xr_user import XrState
from shapeshift.app.terminal import say
from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import Frame
from shapeshift.vr.openxr.instance import Instance, Lost, NoHeadset
from shapeshift.vr.openxr.session import Session
from shapeshift.vr.play_space import PlaySpace, play_space_before, underfoot

EVERY_S = 1.0  # between two tries
REST_S = 0.05  # between two looks at the desk


Open = Callable[[Instance, moderngl.Context], Session]


class Wearer(Protocol):
    """What goes on in one session after another: XrApp."""

    leaving: bool

    @property
    def ends(self) -> str:
        """Why the person at the desk wants it to end; "" for not at all."""
        ...

    def loop(self, frames: int) -> None: ...
    def rest_at_desk(self) -> None: ...
    def go_on(self, session: Session) -> None: ...


class HeadsetLink:
    """`instance` and `session`: those in use now; `reopened`: how often.  Use it in a `with`.

    patience_s: how long a lost one is tried for.  insets: whether four views a frame are wanted
    now.  Raises NoHeadset, Lost where the first cannot be had.
    """

    def __init__(
        self, make: Open, patience_s: float, insets: Callable[[], bool] = lambda: False
    ) -> None:
        self._make, self._patience_s, self._insets = make, patience_s, insets
        self.reopened = 0
        self.session: Session
        self._ctx: moderngl.Context
        self._ends = ExitStack()  # of the session, then of its instance
        self.instance = self._find()

    @contextmanager
    def opened_on(self, ctx: moderngl.Context) -> Iterator[Session]:
        """A session on the context that is current, which it and those after it stay on."""
        self._ctx = ctx
        self.session = self._open()
        try:
            yield self.session
        finally:
            self._ends.close()

    def _find(self) -> Instance:
        return self._ends.enter_context(Instance(self._insets()))

    def _open(self) -> Session:
        return self._ends.enter_context(self._make(self.instance, self._ctx))

    def stay(self, wearer: Wearer, frames: int) -> str:
        """From the first frame to the last, in as many sessions as it takes.

        Returns why the desk ended it while there was none, else "".  Lost where it stays away.
        """
        while True:
            try:
                wearer.loop(frames)
                return ""
            except Lost as lost:
                if wearer.leaving or not self._reopen(str(lost), wearer):
                    raise
            if wearer.ends:
                return wearer.ends
            wearer.go_on(self.session)

    def _reopen(self, why: str, wearer: Wearer) -> bool:
        """Whether there is a session again, or the desk has ended the waiting for one."""
        patience_s = self._patience_s
        if not patience_s > 0:
            return False
        say(f"{why} Trying for {patience_s:g} seconds to go on.")
        lost = self.session
        self._ends.close()
        start = time.monotonic()
        for turn in range(1, ceil(patience_s / EVERY_S) + 1):
            while time.monotonic() < start + min(turn * EVERY_S, patience_s):
                time.sleep(REST_S)
                wearer.rest_at_desk()
                if wearer.ends:
                    return True
            if self._try(lost):
                self.reopened += 1
                say(f"{self.instance.runtime} is back; the session goes on.")
                return True
        return False

    def _try(self, lost: Session) -> bool:
        try:
            self.instance = self._find()
            self.session = self._open()
        except (NoHeadset, Lost):
            self._ends.close()
            return False
        self.session.follow(lost)
        return True

    def __enter__(self) -> "HeadsetLink":
        return self

    def __exit__(self, *failure) -> None:
        self._ends.close()


# From a lost session to the next one: the person stands where they stood, hands hold on.

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
