"""The controllers: one action set, their poses and buttons each frame, and what makes them buzz.

The only place where OpenXR's xyzw quaternions become our wxyz and back.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from shapeshift.scene.pose import UNIT_SLACK, Pose
from shapeshift.vr.frame import LOST, SIDES, Hand

SHORTEST_S, LONGEST_S = 0.005, 1.0  # of a pulse; runtimes take longer ones for stuck


def pose_of(posef: Any) -> Pose:
    """An xr.Posef as ours."""
    q, p = posef.orientation, posef.position
    return Pose(np.array([p.x, p.y, p.z], np.float64), np.array([q.w, q.x, q.y, q.z], np.float64))


def posef_of(pose: Pose) -> Any:
    """Ours as an xr.Posef."""
    import xr

    w, x, y, z = map(float, pose.wxyz)
    return xr.Posef(xr.Quaternionf(x, y, z, w), xr.Vector3f(*map(float, pose.position)))


class Hands:
    """Both controllers of one instance; attach to a session before it begins, close at the end.

    `refused` names the profiles that the runtime did not know: their controllers come as another.
    """

    def __init__(self, instance: Any) -> None:
        import xr

        self._instance, self._session = instance, None
        self._paths = {s: xr.string_to_path(instance, f"/user/hand/{s}") for s in SIDES}
        info = xr.ActionSetCreateInfo("touching", "Touching and moving")
        self._set = xr.create_action_set(instance, info)
        kinds = {name: xr.ActionType.POSE_INPUT for name in POSES}
        kinds |= {name: xr.ActionType.FLOAT_INPUT for name in NUMBERS}
        kinds |= {name: xr.ActionType.VECTOR2F_INPUT for name in PLANES}
        kinds |= {name: xr.ActionType.BOOLEAN_INPUT for name in CLICKS}
        kinds[HAPTIC] = xr.ActionType.VIBRATION_OUTPUT
        self._actions = {name: self._action(name, kind) for name, kind in kinds.items()}
        self.refused = [profile for profile in PROFILES if not self._suggest(profile)]
        self._asked = {
            (name, side): xr.ActionStateGetInfo(action, self._paths[side])
            for name, action in self._actions.items()
            for side in SIDES
        }
        self._spaces: dict[tuple[str, str], Any] = {}

    def _action(self, name: str, kind: Any) -> Any:
        import xr

        both = [self._paths[side] for side in SIDES]
        label = name.replace("_", " ").capitalize()
        info = xr.ActionCreateInfo(name, kind, subaction_paths=both, localized_action_name=label)
        return xr.create_action(self._set, info)

    def _suggest(self, profile: str) -> bool:
        import xr

        bindings = [
            xr.ActionSuggestedBinding(self._actions[name], xr.string_to_path(self._instance, path))
            for name, path in paths(profile)
        ]
        asked = xr.InteractionProfileSuggestedBinding(
            xr.string_to_path(self._instance, profile), suggested_bindings=bindings
        )
        try:
            xr.suggest_interaction_profile_bindings(self._instance, asked)
        except xr.PathUnsupportedError:
            return False
        return True

    def attach(self, session: Any, more: Sequence[Any] = ()) -> None:
        """Once, between the session's creation and its begin; more: action sets of others."""
        import xr

        self._session = session
        info = xr.SessionActionSetsAttachInfo(action_sets=[self._set, *more])
        xr.attach_session_action_sets(session, info)
        for name in POSES:
            for side in SIDES:
                info = xr.ActionSpaceCreateInfo(self._actions[name], self._paths[side])
                self._spaces[name, side] = xr.create_action_space(session, info)

    def read(
        self, play_space: Any, time_ns: int, focused: bool, more: Sequence[Any] = ()
    ) -> dict[str, Hand]:
        """Where the hands will be at a time of the runtime, and what is pressed now; more: action
        sets of others, which are to be synced in the same call.
        """
        import xr

        if not focused:
            return dict.fromkeys(SIDES, LOST)
        wanted = [xr.ActiveActionSet(each, xr.NULL_PATH) for each in (self._set, *more)]
        xr.sync_actions(self._session, xr.ActionsSyncInfo(active_action_sets=wanted))
        return {side: self._hand(side, play_space, time_ns) for side in SIDES}

    def _hand(self, side: str, play_space: Any, time_ns: int) -> Hand:
        grip = self._pose("grip", side, play_space, time_ns)
        if grip is None:
            return LOST
        aim = self._pose("aim", side, play_space, time_ns)
        squeeze, trigger = (self._number(name, side) for name in NUMBERS)
        stick, pad = (self._plane(name, side) for name in PLANES)
        click = {name: self._click(name, side) for name in CLICKS}
        direction, pressed = pressed_pad(*pad, click.pop("pad_click"))
        if direction != (0.0, 0.0):
            stick = direction
        click["primary"] |= pressed
        return Hand(
            True, grip, aim, squeeze, trigger, stick, click["stick_click"], click["primary"],
            click["secondary"], click["menu"],
        )  # fmt: skip

    def _pose(self, name: str, side: str, play_space: Any, time_ns: int) -> Pose | None:
        """None where the controller is off, unseen or has no number."""
        import xr

        if not xr.get_action_state_pose(self._session, self._asked[name, side]).is_active:
            return None
        where = xr.locate_space(self._spaces[name, side], play_space, time_ns)
        flag = xr.SpaceLocationFlags
        wanted = flag.POSITION_VALID_BIT | flag.ORIENTATION_VALID_BIT | flag.POSITION_TRACKED_BIT
        if where.location_flags & wanted != wanted:
            return None
        return checked(pose_of(where.pose))

    def _number(self, name: str, side: str) -> float:
        import xr

        state = xr.get_action_state_float(self._session, self._asked[name, side])
        return within(state.current_state, 0.0) if state.is_active else 0.0

    def _plane(self, name: str, side: str) -> tuple[float, float]:
        import xr

        state = xr.get_action_state_vector2f(self._session, self._asked[name, side])
        at = state.current_state
        return (within(at.x, -1.0), within(at.y, -1.0)) if state.is_active else (0.0, 0.0)

    def _click(self, name: str, side: str) -> bool:
        import xr

        state = xr.get_action_state_boolean(self._session, self._asked[name, side])
        return bool(state.is_active and state.current_state)

    def pulse(self, side: str, strength: float, seconds: float) -> None:
        """Buzzes a hand, 0 to 1; where the controller cannot, the runtime lets it be."""
        import xr

        if self._session is None:
            return
        lasts = min(max(seconds, SHORTEST_S), LONGEST_S)
        felt = xr.HapticVibration(
            duration=round(lasts * 1e9),
            frequency=xr.FREQUENCY_UNSPECIFIED,
            amplitude=within(strength, 0.0),
        )
        which = xr.HapticActionInfo(self._actions[HAPTIC], self._paths[side])
        xr.apply_haptic_feedback(self._session, which, felt)

    def profiles(self) -> dict[str, str]:
        """Of each side the controller that the runtime has bound; "" where there is none."""
        import xr

        bound = {}
        for side, path in self._paths.items():
            found = xr.get_current_interaction_profile(self._session, path).interaction_profile
            bound[side] = xr.path_to_string(self._instance, found) if found else ""
        return bound

    def detach(self) -> None:
        """Before the session ends for good."""
        import xr

        for space in self._spaces.values():
            xr.destroy_space(space)
        self._spaces, self._session = {}, None

    def close(self) -> None:
        """Before the instance goes."""
        import xr

        self.detach()
        xr.destroy_action_set(self._set)  # and its actions


def checked(pose: Pose) -> Pose | None:
    """The pose with a quaternion of length 1; None for what is no place."""
    length = math.hypot(*pose.wxyz)
    if not (all(map(math.isfinite, pose.position)) and abs(length - 1) <= UNIT_SLACK * 10):
        return None
    return Pose(pose.position, pose.wxyz / length)


def within(number: float, least: float) -> float:
    """least..1; what is no number rests at 0."""
    return min(max(float(number), least), 1.0) if math.isfinite(number) else 0.0


# Which button of which controller does what: a table of interaction profiles.  No OpenXR here.
#
# An action set has one action a meaning; the runtime converts a click to 0 or 1 where a number is
# wanted, and re-binds to controllers that are not listed.

POSES = ("grip", "aim")
NUMBERS = ("squeeze", "trigger")  # 0..1
PLANES = ("stick", "pad")  # -1..1, two of them
CLICKS = ("stick_click", "pad_click", "primary", "secondary", "menu")
HAPTIC = "pulse"

CENTRE = 0.35  # of a trackpad's radius: a press within is its button, farther out its direction

_ALWAYS = {"grip": "input/grip/pose", "aim": "input/aim/pose", HAPTIC: "output/haptic"}
_STICK = {"stick": "input/thumbstick", "stick_click": "input/thumbstick/click"}

# profile: action -> its path on either hand, or {side: path} where the hands differ
PROFILES: dict[str, Mapping[str, str | Mapping[str, str]]] = {
    "/interaction_profiles/valve/index_controller": {
        **_ALWAYS,
        **_STICK,
        "squeeze": "input/squeeze/value",
        "trigger": "input/trigger/value",
        "primary": "input/a/click",
        "secondary": {"right": "input/b/click"},
        "menu": {"left": "input/b/click"},  # it has no menu button
    },
    "/interaction_profiles/oculus/touch_controller": {
        **_ALWAYS,
        **_STICK,
        "squeeze": "input/squeeze/value",
        "trigger": "input/trigger/value",
        "primary": {"left": "input/x/click", "right": "input/a/click"},
        "secondary": {"left": "input/y/click", "right": "input/b/click"},
        "menu": {"left": "input/menu/click"},  # the right one is the system's
    },
    "/interaction_profiles/htc/vive_controller": {
        **_ALWAYS,
        "squeeze": "input/squeeze/click",
        "trigger": "input/trigger/value",
        "pad": "input/trackpad",
        "pad_click": "input/trackpad/click",
        "menu": "input/menu/click",
    },
    "/interaction_profiles/microsoft/motion_controller": {
        **_ALWAYS,
        **_STICK,
        "squeeze": "input/squeeze/click",
        "trigger": "input/trigger/value",
        "primary": "input/trackpad/click",
        "menu": "input/menu/click",
    },
    # One button: it takes hold where there is something within reach, else it acts.
    "/interaction_profiles/khr/simple_controller": {
        **_ALWAYS,
        "squeeze": "input/select/click",
        "trigger": "input/select/click",
        "menu": "input/menu/click",
    },
}


def paths(profile: str) -> list[tuple[str, str]]:
    """(action, whole path) of both hands."""
    rows = []
    for action, where in PROFILES[profile].items():
        sides = where if isinstance(where, Mapping) else {"left": where, "right": where}
        rows += [(action, f"/user/hand/{side}/{path}") for side, path in sides.items()]
    return rows


def pressed_pad(x: float, y: float, pressed: bool) -> tuple[tuple[float, float], bool]:
    """A trackpad as a stick and a button: it speaks while it is pressed, in its centre a button."""
    if not pressed:
        return (0.0, 0.0), False
    if not x * x + y * y > CENTRE * CENTRE:
        return (0.0, 0.0), True
    return (x, y), False
