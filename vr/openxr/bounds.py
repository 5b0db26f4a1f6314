"""The rectangle that is free to walk in, as the person has drawn it for the runtime."""

import math
from typing import Any

from shapeshift.vr.frame import Area
from shapeshift.vr.openxr.instance import Instance
from shapeshift.vr.openxr.spaces import Space, locate, open_stage

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
