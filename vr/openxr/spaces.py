"""The room: which of the runtime's reference spaces play space is, and where the head is in it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import IDENTITY
from shapeshift.vr.openxr.hands import pose_of, posef_of
from shapeshift.vr.openxr.instance import LOCAL_FLOOR, Instance, NoHeadset

# The order of wanting: what has a floor, and the origin where the user last asked for it, first.
KINDS = ("LOCAL_FLOOR", "STAGE", "LOCAL")
EYE_HEIGHT_M = 1.6  # of somebody who stands: where LOCAL, whose zero is the eye, has its floor


@dataclass(frozen=True)
class Space:
    """A reference space of the runtime, or play space made of it."""

    handle: Any
    kind: str  # one of KINDS, or VIEW


def choose_kind(offered: set[str]) -> str:
    """The best of KINDS; ValueError where there is none, which OpenXR forbids."""
    for kind in KINDS:
        if kind in offered:
            return kind
    raise ValueError(f"a runtime must offer LOCAL space; this one has {sorted(offered)}.")


def moved_by(changed: str, kind: str) -> bool:
    """Whether play space of that kind moves when the runtime recentres `changed`."""
    return changed == kind or {changed, kind} == {"LOCAL", "LOCAL_FLOOR"}


def open_play_space(instance: Instance, session: Any) -> Space:
    """Play space: y = 0 is the floor, as the runtime knows it or as a standing eye suggests."""
    xr = instance.xr
    offered = _offered(xr, session)
    if LOCAL_FLOOR not in instance.extensions:
        offered.discard("LOCAL_FLOOR")
    try:
        kind = choose_kind(offered)
    except ValueError as none:
        raise NoHeadset(f"{instance.runtime}: {none}") from None
    down = Pose(np.array([0.0, -EYE_HEIGHT_M, 0.0]), IDENTITY.wxyz)
    return _open(xr, session, kind, down if kind == "LOCAL" else IDENTITY)


def open_head_space(instance: Instance, session: Any) -> Space:
    """Between the eyes."""
    return _open(instance.xr, session, "VIEW", IDENTITY)


def open_stage(instance: Instance, session: Any) -> Space | None:
    """The middle of the room that is free to walk in; None where there is no such thing."""
    xr = instance.xr
    return _open(xr, session, "STAGE", IDENTITY) if "STAGE" in _offered(xr, session) else None


def _offered(xr, session: Any) -> set[str]:
    """Of KINDS."""
    known = {int(each) for each in xr.enumerate_reference_spaces(session)}
    return {kind for kind in KINDS if int(getattr(xr.ReferenceSpaceType, kind)) in known}


def locate(xr, space: Space, base: Space, time_ns: int) -> tuple[Pose, bool, bool] | None:
    """base_from_space, whether its place and whether its turn are known; None: neither is."""
    found = xr.locate_space(space.handle, base.handle, time_ns)
    placed, turned = valid(xr.SpaceLocationFlags, found.location_flags)
    return (pose_of(found.pose), placed, turned) if placed or turned else None


def valid(flags, bits: int) -> tuple[bool, bool]:
    """Whether a position and whether an orientation can be believed."""
    bits = int(bits)
    placed = bool(bits & int(flags.POSITION_VALID_BIT))
    return placed, bool(bits & int(flags.ORIENTATION_VALID_BIT))


def _open(xr, session: Any, kind: str, pose: Pose) -> Space:
    info = xr.ReferenceSpaceCreateInfo(getattr(xr.ReferenceSpaceType, kind), posef_of(pose))
    return Space(xr.create_reference_space(session, info), kind)
