"""The rectangle that is free to walk in, as the person has drawn it for the runtime."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import IDENTITY
from shapeshift.vr.frame import Area
from shapeshift.vr.openxr.hands import pose_of, posef_of
from shapeshift.vr.openxr.instance import LOCAL_FLOOR, PASSTHROUGH, Instance, NoHeadset

# The room: which of the runtime's reference spaces play space is, and where the head is in it.

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


LEAST_M = 0.3  # of a side: less is nothing that one could walk in


class Bounds:
    """Asked once, and again when the runtime moves an origin: the person may have drawn anew."""

    def __init__(self, instance: Instance, session: Any) -> None:
        self._xr, self._session = instance.xr, session
        self._stage = open_stage(instance, session)
        self._size: tuple[float, float] | None = None
        self.ask()

    def ask(self) -> None:
        if self._stage is None:
            return
        xr, self._size = self._xr, None
        try:
            rect = xr.get_reference_space_bounds_rect(self._session, xr.ReferenceSpaceType.STAGE)
        except xr.exception.SpaceBoundsUnavailable:
            return
        size = float(rect.width), float(rect.height)
        if all(math.isfinite(side) and side >= LEAST_M for side in size):
            self._size = size

    def area(self, play: Space, time_ns: int) -> Area | None:
        """At a time of the runtime; None where it does not know it."""
        if self._stage is None or self._size is None:
            return None
        found = locate(self._xr, self._stage, play, time_ns)
        if found is None or not (found[1] and found[2]):
            return None
        return Area(found[0], self._size)


# The room itself below our pictures, as a vendor's runtime shows it (XR_FB_passthrough): a layer
# of its own, where there is no environment blend mode for it.


class Passthrough:
    """Off until a frame shows it; `there`: whether it can.  Close before the session ends.

    wanted: False where the runtime blends pictures by their alpha, which needs none of this.
    """

    def __init__(self, instance: Instance, session: Any, wanted: bool) -> None:
        self._xr, self._session = instance.xr, session
        self._feature: Any | None = None
        self._layer: Any | None = None
        self._runs = False
        if wanted and PASSTHROUGH in instance.extensions:
            self._open()

    @property
    def there(self) -> bool:
        return self._layer is not None

    def _open(self) -> None:
        """Both handles, or none where the headset has no such cameras or the user forbids them."""
        xr = self._xr
        try:
            self._feature = xr.create_passthrough_fb(self._session, xr.PassthroughCreateInfoFB())
            info = xr.PassthroughLayerCreateInfoFB(
                self._feature, xr.PassthroughFlagsFB.NONE,
                xr.PassthroughLayerPurposeFB.RECONSTRUCTION,
            )  # fmt: skip
            self._layer = xr.create_passthrough_layer_fb(self._session, info)
        except xr.exception.ErrorResult:
            self.close()

    def layer(self, shown: bool) -> Any | None:
        """What a frame puts below all other layers; the cameras rest where it is not shown."""
        if not self.there:
            return None
        if shown != self._runs:
            self._switch(shown)
        if not (self._runs and self.there):
            return None
        return self._xr.CompositionLayerPassthroughFB(layer_handle=self._layer)

    def _switch(self, on: bool) -> None:
        """A runtime that no longer can is asked no more."""
        xr = self._xr
        try:
            if on:
                xr.passthrough_start_fb(self._feature)
                xr.passthrough_layer_resume_fb(self._layer)
            else:
                xr.passthrough_layer_pause_fb(self._layer)
                xr.passthrough_pause_fb(self._feature)
            self._runs = on
        except xr.exception.ErrorResult:
            self.close()

    def changed(self, flags: int) -> None:
        """After an event of the runtime's: it wants another one, or has none any more."""
        states = self._xr.PassthroughStateChangedFlagsFB
        if not self.there:
            return
        if flags & int(states.NON_RECOVERABLE_ERROR_BIT):
            self.close()
        elif flags & int(states.REINIT_REQUIRED_BIT):
            self.close()
            self._open()

    def close(self) -> None:
        """Gives both back, also what was lost with the runtime."""
        xr = self._xr
        layer, feature = self._layer, self._feature
        self._layer = self._feature = None
        self._runs = False
        for handle, end in (
            (layer, xr.destroy_passthrough_layer_fb), (feature, xr.destroy_passthrough_fb),
        ):  # fmt: skip
            try:
                if handle is not None:
                    end(handle)
            except xr.exception.ErrorResult:
                pass
