"""The runtime and our session with it, opened again where it is lost while somebody wears it."""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from math import ceil
from typing import Protocol

import moderngl

from shapeshift.app.terminal import say
from shapeshift.vr.openxr.instance import Instance, Lost, NoHeadset
from shapeshift.vr.openxr.session import Session

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
