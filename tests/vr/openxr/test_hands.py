"""Controllers without a runtime: the table of bindings, turns, and a stand-in for OpenXR."""

import math
import re
import sys
from types import SimpleNamespace as Thing

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import LOST, SIDES
from shapeshift.vr.openxr.hands import (
    CLICKS,
    HAPTIC,
    NUMBERS,
    PLANES,
    POSES,
    PROFILES,
    Hands,
    checked,
    paths,
    pose_of,
    pressed_pad,
    within,
)

# What each controller has, from the OpenXR specification 1.0, section 6.4.
HAS = {
    "khr/simple_controller": "select/click menu/click",
    "valve/index_controller": "a/click b/click squeeze/value trigger/value thumbstick "
    "thumbstick/click trackpad",
    "htc/vive_controller": "squeeze/click menu/click trigger/click trigger/value trackpad "
    "trackpad/click",
    "microsoft/motion_controller": "menu/click squeeze/click trigger/value thumbstick "
    "thumbstick/click trackpad trackpad/click",
    "oculus/touch_controller": "squeeze/value trigger/value thumbstick thumbstick/click",
}
ONE_SIDED = {
    "left": {"oculus/touch_controller": "x/click y/click menu/click"},
    "right": {"oculus/touch_controller": "a/click b/click"},  # its system button is not ours
}


def test_every_binding_is_a_path_that_the_controller_has():
    assert {profile.removeprefix("/interaction_profiles/") for profile in PROFILES} == set(HAS)
    for profile in PROFILES:
        name = profile.removeprefix("/interaction_profiles/")
        for action, path in paths(profile):
            side, kind, rest = re.fullmatch(
                r"/user/hand/(left|right)/(input|output)/(.+)", path
            ).groups()
            if kind == "output":
                assert (action, rest) == (HAPTIC, "haptic")
            elif action in POSES:
                assert rest == f"{action}/pose"
            else:
                assert rest in (HAS[name] + " " + ONE_SIDED[side].get(name, "")).split()


def test_every_controller_can_grab_act_and_buzz_and_opens_the_panel():
    for profile in PROFILES:
        rows = paths(profile)
        for action in (*POSES, *NUMBERS, HAPTIC):
            assert {path.split("/")[3] for name, path in rows if name == action} == set(SIDES)
        assert any(name == "menu" for name, _ in rows)
        assert {name for name, _ in rows} <= {*POSES, *NUMBERS, *PLANES, *CLICKS, HAPTIC}
        if not profile.endswith("simple_controller"):
            assert any(name in PLANES for name, _ in rows)


@pytest.mark.parametrize(
    "x, y, pressed, said",
    [
        (0.9, 0.1, False, ((0, 0), False)),
        (0.9, 0.1, True, ((0.9, 0.1), False)),
        (0.1, -0.1, True, ((0, 0), True)),
        (math.nan, 0.1, True, ((0, 0), True)),
    ],
)
def test_a_trackpad_speaks_when_pressed(x, y, pressed, said):
    assert pressed_pad(x, y, pressed) == said


def test_what_is_no_pose_is_none():
    good = Pose(np.zeros(3), np.array([1.0005, 0, 0, 0]))
    assert math.hypot(*checked(good).wxyz) == pytest.approx(1, abs=1e-15)
    for position, wxyz in (
        ([np.nan, 0, 0], [1, 0, 0, 0]),
        ([0, np.inf, 0], [1, 0, 0, 0]),
        ([0, 0, 0], [0, 0, 0, 0]),
        ([0, 0, 0], [np.nan, 0, 0, 1]),
    ):
        assert checked(Pose(np.array(position, float), np.array(wxyz, float))) is None


def test_numbers_stay_within_and_nan_rests():
    told = [within(n, -1.0) for n in (math.nan, math.inf, -2, 2, 0.25)]
    assert told == [0, 0, -1, 1, 0.25]


class FakeRuntime:
    """As much of pyopenxr as hands use, with a state that tests write."""

    NULL_PATH = FREQUENCY_UNSPECIFIED = 0
    ActionType = Thing(
        POSE_INPUT="pose", FLOAT_INPUT="f", VECTOR2F_INPUT="2f", BOOLEAN_INPUT="b",
        VIBRATION_OUTPUT="v",
    )  # fmt: skip
    SpaceLocationFlags = Thing(
        ORIENTATION_VALID_BIT=1, POSITION_VALID_BIT=2, ORIENTATION_TRACKED_BIT=4,
        POSITION_TRACKED_BIT=8,
    )  # fmt: skip

    class PathUnsupportedError(Exception):
        pass

    def __init__(self):
        self.calls, self.pulses, self.unknown = [], [], ()
        self.values = {}  # (action, side) -> value
        self.active, self.flags = set(SIDES), 15
        self.where = Thing(orientation=Thing(x=0, y=0, z=0.6, w=0.8), position=Thing(x=1, y=2, z=3))
        for name in ("ActionSetCreateInfo", "ActionSpaceCreateInfo", "ActionSuggestedBinding",
                     "ActionStateGetInfo", "HapticActionInfo", "ActiveActionSet"):  # fmt: skip
            setattr(self, name, lambda *a: a)
        for name in ("SessionActionSetsAttachInfo", "ActionsSyncInfo", "HapticVibration"):
            setattr(self, name, lambda **named: named)
        for name in ("create_action_set", "attach_session_action_sets", "sync_actions",
                     "destroy_space", "destroy_action_set"):  # fmt: skip
            setattr(self, name, lambda *a, name=name: self.calls.append(name) or name)

    def string_to_path(self, instance, text):
        return text

    def ActionCreateInfo(self, name, kind, **named):
        return name

    def create_action(self, action_set, info):
        return info

    def create_action_space(self, session, info):
        return info

    def InteractionProfileSuggestedBinding(self, path, suggested_bindings):
        return path

    def suggest_interaction_profile_bindings(self, instance, path):
        if path in self.unknown:
            raise self.PathUnsupportedError

    def state(self, session, asked):
        action, path = asked
        side = path.rsplit("/", 1)[1]
        return Thing(
            is_active=side in self.active, current_state=self.values.get((action, side), 0)
        )

    get_action_state_pose = get_action_state_float = get_action_state_boolean = state

    def get_action_state_vector2f(self, session, asked):
        told = self.state(session, asked)
        x, y = told.current_state or (0, 0)
        return Thing(is_active=told.is_active, current_state=Thing(x=x, y=y))

    def locate_space(self, space, base, time_ns):
        return Thing(location_flags=self.flags, pose=self.where)

    def apply_haptic_feedback(self, session, which, felt):
        self.pulses.append((which[1], felt))


@pytest.fixture
def runtime(monkeypatch):
    fake = FakeRuntime()
    monkeypatch.setitem(sys.modules, "xr", fake)
    return fake


@pytest.fixture
def hands(runtime):
    made = Hands("instance")
    made.attach("session")
    return made


def test_a_hand_is_read_with_w_first(runtime, hands):
    runtime.values = {("squeeze", "right"): 0.5, ("stick", "right"): (0.25, -1.5)}
    runtime.values[("primary", "right")] = True
    right = hands.read("room", 5, True)["right"]
    assert right.active and right.grip.wxyz.tolist() == [0.8, 0, 0, 0.6]
    assert right.grip.position.tolist() == [1, 2, 3]
    assert (right.squeeze, right.stick, right.primary) == (0.5, (0.25, -1), True)
    assert hands.read("room", 5, True)["left"].squeeze == 0


def test_a_trackpad_stands_for_stick_and_button(runtime, hands):
    runtime.values = {("pad", "left"): (0, 0.9), ("pad_click", "left"): True}
    assert hands.read("room", 5, True)["left"].stick == (0, 0.9)
    runtime.values[("pad", "left")] = (0.1, 0)
    left = hands.read("room", 5, True)["left"]
    assert left.stick == (0, 0) and left.primary


def test_unseen_inactive_and_unfocused_hands_are_lost(runtime, hands):
    for flags in (0, 1, 2, 3, 7, 11 - 1):
        runtime.flags = flags
        assert hands.read("room", 5, True)["left"] is LOST
    runtime.flags = 15
    runtime.active = {"left"}
    told = hands.read("room", 5, True)
    assert told["right"] is LOST and told["left"].active
    runtime.calls.clear()
    assert hands.read("room", 5, False) == dict.fromkeys(SIDES, LOST)
    assert "sync_actions" not in runtime.calls  # not ours to ask for then
    runtime.where = Thing(orientation=Thing(x=0, y=0, z=0, w=0), position=Thing(x=0, y=0, z=0))
    assert hands.read("room", 5, True)["left"] is LOST


def test_pulses_have_a_length_and_a_strength(runtime, hands):
    hands.pulse("left", 2.0, 9.0)
    hands.pulse("right", math.nan, 0.0)
    lengths = [(path[-5:], felt["duration"], felt["amplitude"]) for path, felt in runtime.pulses]
    assert lengths == [("/left", 10**9, 1.0), ("right", 5_000_000, 0.0)]
    hands.close()
    hands.pulse("left", 1.0, 0.1)  # after the session there is nothing to buzz
    assert len(runtime.pulses) == 2


def test_an_unknown_profile_is_told_and_the_others_stay(runtime):
    runtime.unknown = ("/interaction_profiles/htc/vive_controller",)
    assert Hands("instance").refused == list(runtime.unknown)


def test_there_and_back_through_the_library():
    xr = pytest.importorskip("xr", reason="pyopenxr is not installed")
    from shapeshift.vr.openxr.hands import posef_of

    pose = Pose(np.array([1.0, -2, 3]), np.array([0.5, -0.5, 0.5, 0.5]))
    posef = posef_of(pose)
    assert isinstance(posef, xr.Posef) and posef.orientation.w == 0.5 == -posef.orientation.x
    back = pose_of(posef)
    assert np.array_equal(back.position, pose.position) and np.array_equal(back.wxyz, pose.wxyz)
