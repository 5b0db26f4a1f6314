"""Where the eyes look: its action, what counts as a gaze, and where each eye sees it."""

import math
from types import SimpleNamespace as Thing

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.vr.openxr.instance import EYE_GAZE
from shapeshift.vr.openxr.tracked import PATH, PROFILE, Gaze, tangents_along

UPRIGHT = Thing(x=0.0, y=0.0, z=0.0, w=1.0)


class Refused(Exception):
    pass


class FakeRuntime:
    """As much of pyopenxr as a gaze uses, with a state that tests write."""

    ActionType = Thing(POSE_INPUT="pose")
    SpaceLocationFlags = Thing(ORIENTATION_VALID_BIT=1)
    exception = Thing(ErrorResult=Refused)

    def __init__(self, knows: bool = True) -> None:
        self.knows, self.active, self.flags = knows, True, 1
        self.turn, self.calls, self.bound = UPRIGHT, [], []

    def __getattr__(self, name):
        def note(*given, **named):
            self.calls.append(name)
            return (name, *given, *named.items())

        return note

    def suggest_interaction_profile_bindings(self, instance, asked):
        if not self.knows:
            raise Refused
        self.bound.append(asked)

    def get_action_state_pose(self, session, asked):
        return Thing(is_active=self.active)

    def locate_space(self, space, base, time_ns):
        place = Thing(x=0.0, y=0.0, z=0.0)
        return Thing(location_flags=self.flags, pose=Thing(orientation=self.turn, position=place))


def a_gaze(xr: FakeRuntime, extensions=(EYE_GAZE,)) -> Gaze:
    gaze = Gaze(Thing(xr=xr, handle="instance", extensions=extensions))
    gaze.open_space("session")
    return gaze


def test_it_is_asked_for_only_where_it_is_wanted():
    xr = FakeRuntime()
    gaze = a_gaze(xr)
    assert gaze.there and len(gaze.sets) == 1
    assert PROFILE in str(xr.bound) and PATH in str(xr.bound)
    assert gaze.direction("room", 5) is None
    gaze.wanted = True
    np.testing.assert_allclose(gaze.direction("room", 5), (0, 0, -1))
    half = math.radians(15)
    xr.turn = Thing(x=0.0, y=math.sin(half), z=0.0, w=math.cos(half))  # 30 degrees to the left
    np.testing.assert_allclose(gaze.direction("room", 5), (-0.5, 0, -math.sqrt(0.75)), atol=1e-12)
    gaze.close()
    assert xr.calls[-2:] == ["destroy_space", "destroy_action_set"]
    assert gaze.direction("room", 5) is None and not gaze.sets


def test_an_eye_that_is_not_followed_looks_straight_on():
    xr = FakeRuntime()
    gaze = a_gaze(xr)
    gaze.wanted = True
    for name, value in (
        ("active", False), ("flags", 0), ("turn", Thing(x=0.0, y=0.0, z=0.0, w=0.0)),
        ("turn", Thing(x=math.nan, y=0.0, z=0.0, w=1.0)),
    ):  # fmt: skip
        before = getattr(xr, name)
        setattr(xr, name, value)
        assert gaze.direction("room", 5) is None
        setattr(xr, name, before)
    assert gaze.direction("room", 5) is not None


@pytest.mark.parametrize("extensions, knows", [((), True), ((EYE_GAZE,), False)])
def test_a_runtime_without_it_is_not_asked(extensions, knows):
    xr = FakeRuntime(knows)
    gaze = a_gaze(xr, extensions)
    gaze.wanted = True
    assert not gaze.there and gaze.sets == [] and gaze.direction("room", 5) is None
    assert not {"create_action_space", "get_action_state_pose"} & set(xr.calls)
    gaze.close()


def test_tangents_are_the_eyes_own():
    """By the angles: a head turned by 20 degrees sees what is 50 aside 30 degrees aside."""
    half = math.radians(-10)
    eye = Pose(np.array([5.0, 1.0, 2.0]), np.array([math.cos(half), 0, math.sin(half), 0]))
    for aside in (50.0, 20.0, -40.0):
        a = math.radians(aside)
        seen = tangents_along(np.array([math.sin(a), 0.0, -math.cos(a)]), eye)
        assert seen == pytest.approx((math.tan(math.radians(aside - 20)), 0.0), abs=1e-12)
    straight = Pose(np.zeros(3), np.array([1.0, 0, 0, 0]))
    up = tangents_along(np.array([0.0, math.sin(0.3), -math.cos(0.3)]), straight)
    assert up == pytest.approx((0.0, math.tan(0.3)))
    for lost in (None, np.array([0, 0, 1.0]), np.array([1.0, 0, 0]), np.full(3, np.nan)):
        assert tangents_along(lost, straight) is None
    wide = math.radians(80.5)
    assert tangents_along(np.array([math.sin(wide), 0, -math.cos(wide)]), straight) is None
