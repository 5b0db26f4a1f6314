"""Where the eyes look, as a headset that follows them says it (XR_EXT_eye_gaze_interaction)."""

import ctypes
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from shapeshift.scene.pose import Pose, look_at
from shapeshift.vr.frame import LOST, SIDES, Hand
from shapeshift.vr.openxr.hands import checked, pose_of
from shapeshift.vr.openxr.instance import EYE_GAZE, HAND_TRACKING, Instance

PROFILE = "/interaction_profiles/ext/eye_gaze_interaction"
PATH = "/user/eyes_ext/input/gaze_ext/pose"
MOST_ASIDE = math.tan(math.radians(80.0))  # a gaze farther from straight on is none


class Gaze:
    """One action, asked for while `wanted`; nothing where the runtime knows no such thing.

    `sets`: of actions, to be attached with those of the hands and synced with them.
    """

    def __init__(self, instance: Instance) -> None:
        self._xr, self.wanted = instance.xr, False
        self._set: Any | None = None
        self._session: Any | None = None
        self._space: Any | None = None
        if EYE_GAZE in instance.extensions:
            self._open(instance.handle)

    @property
    def there(self) -> bool:
        return self._set is not None

    @property
    def sets(self) -> list[Any]:
        return [] if self._set is None else [self._set]

    def _open(self, instance: Any) -> None:
        xr = self._xr
        try:
            made = xr.create_action_set(instance, xr.ActionSetCreateInfo("looking", "Looking"))
            info = xr.ActionCreateInfo(
                "gaze", xr.ActionType.POSE_INPUT, localized_action_name="Gaze"
            )
            self._action = xr.create_action(made, info)
            path = xr.string_to_path(instance, PATH)
            asked = xr.InteractionProfileSuggestedBinding(
                xr.string_to_path(instance, PROFILE),
                suggested_bindings=[xr.ActionSuggestedBinding(self._action, path)],
            )
            xr.suggest_interaction_profile_bindings(instance, asked)
        except xr.exception.ErrorResult:
            return  # it knows the extension and not this path
        self._set = made

    def open_space(self, session: Any) -> None:
        """Once, after the sets are attached."""
        if self.there:
            info = self._xr.ActionSpaceCreateInfo(self._action)
            self._session, self._space = session, self._xr.create_action_space(session, info)

    def direction(self, play_space: Any, time_ns: int) -> np.ndarray | None:
        """(3,) along the gaze in the room; None where it is not wanted or not known."""
        xr = self._xr
        if self._space is None or not self.wanted:
            return None
        asked = xr.ActionStateGetInfo(self._action)
        if not xr.get_action_state_pose(self._session, asked).is_active:
            return None
        where = xr.locate_space(self._space, play_space, time_ns)
        if not int(where.location_flags) & int(xr.SpaceLocationFlags.ORIENTATION_VALID_BIT):
            return None
        pose = checked(pose_of(where.pose))
        return None if pose is None else -pose.matrix()[:3, 2]

    def detach(self) -> None:
        """Before the session ends for good."""
        if self._space is not None:
            self._xr.destroy_space(self._space)
            self._space = None

    def close(self) -> None:
        """Before the instance goes."""
        self.detach()
        if self._set is not None:
            self._xr.destroy_action_set(self._set)
            self._set = None


def tangents_along(direction: np.ndarray | None, eye: Pose) -> tuple[float, float] | None:
    """Where an eye sees a direction of the room: tangents to the right and up."""
    if direction is None:
        return None
    right, up, back = eye.matrix()[:3, :3].T @ direction
    if not back < 0:
        return None
    x, y = float(right / -back), float(up / -back)
    return (x, y) if math.hypot(x, y) <= MOST_ASIDE else None


# The joints of hands without controllers, where the runtime sees them (XR_EXT_hand_tracking).

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


# A hand without a controller: what its joints say of grip, ray, squeeze, trigger and button.
#
# Joints are those of XR_EXT_hand_tracking, in metres of the room. Thumb and index finger together
# are trigger and squeeze at once, as the one button of a simple controller: they take what is
# within reach, else act on what the ray meets, else hold the world. A fist is the squeeze alone,
# thumb and middle finger together aim a jump, and a palm that is turned up opens the panel.

JOINTS = 26
PALM, WRIST, THUMB_TIP = 0, 1, 5
INDEX_PROXIMAL, INDEX_TIP = 7, 10
MIDDLE_PROXIMAL, MIDDLE_TIP = 12, 15
LITTLE_PROXIMAL = 22
# Knuckle to tip of index, middle, ring and little finger.
FINGERS = ((7, 8, 9, 10), (12, 13, 14, 15), (17, 18, 19, 20), (22, 23, 24, 25))
TOGETHER_M, APART_M = 0.016, 0.042  # of two fingertips: all of a pinch, nothing of it
HOLDS_M, LEAVES_M = 0.020, 0.032  # of thumb and middle finger: a button goes down, comes up
STRAIGHT, CURLED = 0.92, 0.55  # from knuckle to tip, of the length of the bones between
PALM_M = 0.03  # before the joint in the palm: what a fist holds
FIST = 0.5  # of a squeeze: its thumb lies on the index finger and pinches nothing
SHOULDER_M = np.array([0.17, -0.22, 0.03])  # from the head: right, up, back


@dataclass(frozen=True)
class BareHand:
    """A hand as its joints say, and whether its button was down, for the next frame."""

    hand: Hand
    button: bool = False


def bare_hand(side: str, joints: np.ndarray, head: Pose, button: bool = False) -> BareHand:
    """Of joints (26, 4), place and radius, metres of the room; head: play_from_head."""
    places = joints[:, :3]
    squeeze = curl(places)
    fist = squeeze > FIST
    index_m, middle_m = (
        float(np.linalg.norm(places[THUMB_TIP] - places[tip])) for tip in (INDEX_TIP, MIDDLE_TIP)
    )
    # Of a thumb at both fingers the nearer one counts.
    button = not fist and (middle_m < LEAVES_M if button else middle_m < min(HOLDS_M, index_m))
    pinch = 0.0 if fist or button else pinched(index_m)
    grip, aim = grip_pose(side, places), aim_pose(side, places, head)
    squeeze = 0.0 if button else max(squeeze, pinch)
    return BareHand(Hand(True, grip, aim, squeeze, pinch, primary=button, joints=joints), button)


def grip_pose(side: str, places: np.ndarray) -> Pose:
    """play_from_grip as a controller's: fingers to -Y, the thumb at -Z, the right hand's back at
    +X; in the middle of what a fist holds.
    """
    back = _unit(places[WRIST] - places[MIDDLE_PROXIMAL])  # +Y
    along = places[LITTLE_PROXIMAL] - places[INDEX_PROXIMAL]
    along = _unit(along - back * (along @ back))  # +Z
    across = np.cross(back, along)  # +X
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([across, back, along], axis=1)
    out = 1.0 if side == SIDES[0] else -1.0  # +X comes out of the left palm
    matrix[:3, 3] = places[PALM] + across * (out * PALM_M)
    return Pose.from_matrix(matrix)


def aim_pose(side: str, places: np.ndarray, head: Pose) -> Pose:
    """play_from_aim: from the shoulder through the knuckle of the index finger, which a pinch does
    not move.
    """
    back = head.matrix()[:3, 2] * (1, 0, 1)
    back = _unit(back) if np.linalg.norm(back) > 1e-3 else np.array([0.0, 0.0, 1.0])
    right = np.cross([0.0, 1.0, 0.0], back)
    x, y, z = SHOULDER_M
    shoulder = head.position + right * (x if side == SIDES[1] else -x) + back * z
    shoulder = shoulder + np.array([0.0, y, 0.0])
    knuckle = places[INDEX_PROXIMAL]
    along = _unit(knuckle - shoulder)
    # Straight up or down any other direction will do for its upper side.
    upper = (0.0, 1.0, 0.0) if abs(along[1]) < 0.99 else (float(back[0]), 0.0, float(back[2]))
    return look_at(knuckle, knuckle + along, upper)


def curl(places: np.ndarray) -> float:
    """0..1: how much of a fist it is; none with a finger that points."""
    parts = []
    for finger in FINGERS:
        bones = places[list(finger)]
        length = float(np.linalg.norm(np.diff(bones, axis=0), axis=1).sum())
        straight = float(np.linalg.norm(bones[-1] - bones[0])) / max(length, 1e-6)
        parts.append((STRAIGHT - straight) / (STRAIGHT - CURLED))
    return min(max(min(parts[0], sum(parts[1:]) / len(parts[1:])), 0.0), 1.0)


def pinched(gap_m: float) -> float:
    """0..1 of two fingertips so far apart."""
    return float(np.clip((APART_M - gap_m) / (APART_M - TOGETHER_M), 0, 1))


def _unit(vector: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vector)
    return vector / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
