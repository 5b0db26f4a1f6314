"""Where the eyes look, as a headset that follows them says it (XR_EXT_eye_gaze_interaction)."""

import math
from typing import Any

import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.vr.openxr.hands import checked, pose_of
from shapeshift.vr.openxr.instance import EYE_GAZE, Instance

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
