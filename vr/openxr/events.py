"""What the runtime tells between frames, in our own words."""

import ctypes
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class StateChanged:
    state: str  # READY, FOCUSED, ...


@dataclass(frozen=True)
class Recentred:
    """The origin of a reference space moves at a time of the runtime's clock."""

    space: str
    time_ns: int


@dataclass(frozen=True)
class ControllersChanged:
    pass


@dataclass(frozen=True)
class MaskChanged:
    """What an eye's lens does not show is another part of its picture."""


@dataclass(frozen=True)
class PassthroughChanged:
    """The vendor's own view of the room has failed, or is to be made anew."""

    flags: int  # of XrPassthroughStateChangedFlagsFB


@dataclass(frozen=True)
class GoingAway:
    """The runtime itself ends soon."""


Event = StateChanged | Recentred | ControllersChanged | MaskChanged | PassthroughChanged | GoingAway


def poll_events(xr, instance: Any) -> list[Event]:
    """All that have come since the last call; those of no meaning to us are left out."""
    events: list = []
    while True:
        try:
            buffer = xr.poll_event(instance)
        except xr.exception.EventUnavailable:
            return events
        event = read_event(xr, buffer)
        if event is not None:
            events.append(event)


def read_event(xr, buffer) -> Event | None:
    """An event buffer as one of ours; None for one that means nothing to us."""
    kinds, kind = xr.StructureType, int(buffer._type)
    if kind == int(kinds.EVENT_DATA_SESSION_STATE_CHANGED):
        number = int(_as(buffer, xr.EventDataSessionStateChanged)._state)
        names = {int(state): state.name for state in xr.SessionState}
        return StateChanged(names[number]) if number in names else None
    if kind == int(kinds.EVENT_DATA_REFERENCE_SPACE_CHANGE_PENDING):
        pending = _as(buffer, xr.EventDataReferenceSpaceChangePending)
        names = {int(getattr(xr.ReferenceSpaceType, name)): name
                 for name in ("LOCAL_FLOOR", "STAGE", "LOCAL")}  # fmt: skip
        space = names.get(int(pending._reference_space_type), "")
        return Recentred(space, int(pending.change_time))
    if kind == int(kinds.EVENT_DATA_INTERACTION_PROFILE_CHANGED):
        return ControllersChanged()
    if kind == int(kinds.EVENT_DATA_VISIBILITY_MASK_CHANGED_KHR):
        return MaskChanged()
    if kind == int(kinds.EVENT_DATA_PASSTHROUGH_STATE_CHANGED_FB):
        return PassthroughChanged(int(_as(buffer, xr.EventDataPassthroughStateChangedFB)._flags))
    if kind == int(kinds.EVENT_DATA_INSTANCE_LOSS_PENDING):
        return GoingAway()
    return None


def _as(buffer, kind):
    return ctypes.cast(ctypes.byref(buffer), ctypes.POINTER(kind)).contents


# The life of a session as OpenXR draws it: what to do when the runtime says a state.  Pure.

BEGIN, END = "begin", "end"  # what has to be done at once
LOST = "LOST"  # of ours, no state of the runtime's: what follows is another session


@dataclass
class Life:
    """Takes the runtime's states one after the other."""

    states: list[str] = field(default_factory=list)  # all that the runtime has named
    running: bool = False  # begun and not ended: frames have to be made
    lost: bool = False  # the runtime takes the session away

    @property
    def state(self) -> str:
        return self.states[-1] if self.states else ""

    @property
    def over(self) -> bool:
        return self.lost or self.state == "EXITING"

    @property
    def focused(self) -> bool:
        """Whether hands act on us: else a menu of the runtime has them."""
        return self.state == "FOCUSED"

    def enter(self, state: str) -> str:
        """Notes a state; returns BEGIN, END or "" for nothing to do."""
        self.states.append(state)
        if state == "READY":
            self.running = True
            return BEGIN
        if state == "STOPPING":
            self.running = False
            return END
        if state == "LOSS_PENDING":
            self.lost, self.running = True, False
        return ""
