"""Events of a runtime, in pyopenxr's own structures, as ours."""

import ctypes

import pytest

from shapeshift.vr.openxr.events import (
    ControllersChanged,
    GoingAway,
    MaskChanged,
    Recentred,
    StateChanged,
    poll_events,
    read_event,
)

xr = pytest.importorskip("xr", reason="pyopenxr is not installed", exc_type=ImportError)


def buffer_of(event) -> object:
    """The event as the runtime writes it: over the start of a buffer."""
    buffer = xr.EventDataBuffer()
    ctypes.memmove(ctypes.byref(buffer), ctypes.byref(event), ctypes.sizeof(event))
    return buffer


def recentring(kind: object) -> object:
    return xr.EventDataReferenceSpaceChangePending(
        reference_space_type=kind, change_time=1_234_567_890_123
    )


@pytest.mark.parametrize(
    ("event", "ours"),
    [
        (xr.EventDataSessionStateChanged(state=xr.SessionState.READY), StateChanged("READY")),
        (xr.EventDataSessionStateChanged(state=xr.SessionState.LOSS_PENDING),
         StateChanged("LOSS_PENDING")),
        (recentring(xr.ReferenceSpaceType.LOCAL_FLOOR), Recentred("LOCAL_FLOOR", 1234567890123)),
        (recentring(xr.ReferenceSpaceType.STAGE), Recentred("STAGE", 1234567890123)),
        (recentring(xr.ReferenceSpaceType.VIEW), Recentred("", 1234567890123)),
        (xr.EventDataInteractionProfileChanged(), ControllersChanged()),
        (xr.EventDataVisibilityMaskChangedKHR(), MaskChanged()),
        (xr.EventDataInstanceLossPending(), GoingAway()),
        (xr.EventDataEventsLost(), None),
    ],
)  # fmt: skip
def test_each_event_is_read(event, ours):
    assert read_event(xr, buffer_of(event)) == ours


def test_a_state_of_a_later_version_does_no_harm():
    event = xr.EventDataSessionStateChanged(state=xr.SessionState.READY)
    event._state = 77
    assert read_event(xr, buffer_of(event)) is None


def test_all_that_wait_are_taken_in_order(monkeypatch):
    waiting = [
        buffer_of(xr.EventDataSessionStateChanged(state=state))
        for state in (xr.SessionState.IDLE, xr.SessionState.READY)
    ]
    waiting.insert(1, buffer_of(xr.EventDataEventsLost()))

    def poll(instance):
        if not waiting:
            raise xr.exception.EventUnavailable
        return waiting.pop(0)

    monkeypatch.setattr(xr, "poll_event", poll)
    assert poll_events(xr, None) == [StateChanged("IDLE"), StateChanged("READY")]
    assert poll_events(xr, None) == []
