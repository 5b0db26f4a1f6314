"""The joints of hands without controllers, where the runtime sees them (XR_EXT_hand_tracking)."""

import ctypes
import math
from typing import Any

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.vr.bare_hand import JOINTS, BareHand, bare_hand
from shapeshift.vr.frame import LOST, SIDES, Hand
from shapeshift.vr.openxr.instance import HAND_TRACKING, Instance

LARGEST_M = 0.1  # radius of a joint that can be believed


class HandTrackers:
    """A tracker a hand; none where the runtime has none.  Close before the session ends."""

    def __init__(self, instance: Instance, session: Any) -> None:
        xr = self._xr = instance.xr
        self._trackers: dict[str, Any] = {}
        self._bare: dict[str, BareHand] = {}
        if HAND_TRACKING not in instance.extensions:
            return
        # pyopenxr's own call has no room for the joints.
        address = xr.get_instance_proc_addr(instance.handle, "xrLocateHandJointsEXT")
        self._find = ctypes.cast(address, xr.PFN_xrLocateHandJointsEXT)
        for side, hand in zip(SIDES, (xr.HandEXT.LEFT, xr.HandEXT.RIGHT), strict=True):
            try:
                info = xr.HandTrackerCreateInfoEXT(hand)
                self._trackers[side] = xr.create_hand_tracker_ext(session, info)
            except xr.exception.ErrorResult:
                pass  # it knows the extension and this headset sees no hands

    @property
    def there(self) -> bool:
        return bool(self._trackers)

    def hand(self, side: str, play_space: Any, time_ns: int, head: Pose) -> Hand:
        """As it is at a time of the runtime; LOST where it is not seen."""
        joints = self._locate(side, play_space, time_ns)
        if joints is None:
            self._bare.pop(side, None)
            return LOST
        before = self._bare.get(side)
        self._bare[side] = bare_hand(side, joints, head, before is not None and before.button)
        return self._bare[side].hand

    def _locate(self, side: str, play_space: Any, time_ns: int) -> np.ndarray | None:
        """(26, 4): place and radius, metres of the room; None where any of it is not known."""
        if side not in self._trackers:
            return None
        xr = self._xr
        asked = xr.HandJointsLocateInfoEXT(play_space, time_ns)
        found = xr.HandJointLocationsEXT(joint_locations=[xr.HandJointLocationEXT()] * JOINTS)
        result = self._find(self._trackers[side], ctypes.byref(asked), ctypes.byref(found))
        problem = xr.check_result(result)
        if problem.is_exception():
            raise problem
        if not found.is_active:
            return None
        placed = int(xr.SpaceLocationFlags.POSITION_VALID_BIT)
        rows = np.zeros((JOINTS, 4))
        for row, joint in zip(rows, found.joint_locations, strict=True):
            if not int(joint.location_flags) & placed:
                return None
            at = joint.pose.position
            row[:] = at.x, at.y, at.z, joint.radius
        believed = np.isfinite(rows).all() and (np.abs(rows[:, 3]) <= LARGEST_M).all()
        apart = math.dist(rows[0, :3], rows[1, :3]) if believed else 0.0
        return rows if apart > 1e-3 else None  # all in one place is no hand

    def close(self) -> None:
        for tracker in self._trackers.values():
            try:
                self._xr.destroy_hand_tracker_ext(tracker)
            except self._xr.exception.ErrorResult:
                pass  # lost with the runtime
        self._trackers.clear()
