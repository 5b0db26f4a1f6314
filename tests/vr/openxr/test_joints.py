"""Joints of a runtime that are not to be believed, and a headset that sees no hands."""

import ctypes
from types import SimpleNamespace

import numpy as np
import pytest

from shapeshift.vr.frame import LOST, SIDES
from shapeshift.vr.openxr.instance import HAND_TRACKING
from shapeshift.vr.openxr.tracked import LARGEST_M, HandTrackers
from tests.support.vr.vr_hands import HEAD

xr = pytest.importorskip("xr", reason="pyopenxr is not installed", exc_type=ImportError)
PLACED = int(xr.SpaceLocationFlags.POSITION_VALID_BIT)


def fan() -> list[list[float]]:
    """[x, y, z, radius, flags] of 26 joints, apart from each other."""
    places = np.random.default_rng(5).normal(size=(26, 3)) * 0.05 + (0.2, 1.2, -0.4)
    return [[*place, 0.01, PLACED] for place in places.tolist()]


class Camera:
    """A runtime as HandTrackers asks it; `rows` as of fan()."""

    def __init__(self, rows, active: bool = True, sees: bool = True, known: bool = True) -> None:
        self.closed, self.result = 0, 0

        def locate(tracker, asked, found) -> int:
            found.contents.is_active = active
            assert found.contents.joint_count == 26  # the specification's, else it is an error
            for joint, row in zip(found.contents.joint_locations, rows, strict=True):
                joint.pose.position = xr.Vector3f(*row[:3])
                joint.radius, joint.location_flags = row[3], int(row[4])
            return self.result

        def create(session, info):
            if not sees:
                raise xr.exception.FeatureUnsupportedError
            return xr.HandTrackerEXT()

        def destroy(tracker) -> None:
            self.closed += 1

        self._locate = xr.PFN_xrLocateHandJointsEXT(locate)
        mine = {name: getattr(xr, name) for name in vars(xr)}
        mine |= {
            "create_hand_tracker_ext": create,
            "destroy_hand_tracker_ext": destroy,
            "get_instance_proc_addr": lambda handle, name: ctypes.cast(
                self._locate, ctypes.c_void_p
            ),
        }
        extensions = (HAND_TRACKING,) if known else ()
        self.instance = SimpleNamespace(
            xr=SimpleNamespace(**mine), handle=None, extensions=extensions
        )
        self.trackers = HandTrackers(self.instance, None)

    def hand(self, side: str = "right"):
        return self.trackers.hand(side, None, 0, HEAD)


def test_a_hand_that_is_seen_has_its_joints():
    rows = fan()
    camera = Camera(rows)
    assert camera.trackers.there
    for side in SIDES:
        hand = camera.hand(side)
        np.testing.assert_allclose(hand.joints, np.array(rows)[:, :4], rtol=1e-6)  # float32
        assert hand.active and np.isfinite(hand.aim.matrix()).all()
    camera.trackers.close()
    assert camera.closed == 2 and camera.hand() is LOST


@pytest.mark.parametrize(
    ("column", "value"),
    [(0, np.nan), (1, np.inf), (2, -np.inf), (3, np.nan), (3, LARGEST_M * 1.01), (4, 0)],
)
@pytest.mark.parametrize("joint", [0, 25])
def test_one_joint_that_is_no_place_is_no_hand(joint, column, value):
    rows = fan()
    rows[joint][column] = value
    assert Camera(rows).hand() is LOST


def test_what_is_not_there_is_lost():
    assert Camera(fan(), active=False).hand() is LOST
    assert Camera([[0.0, 1.0, 0.0, 0.01, PLACED]] * 26).hand() is LOST  # all in one place
    for camera in (Camera(fan(), sees=False), Camera(fan(), known=False)):
        assert not camera.trackers.there and camera.hand() is LOST


def test_a_runtime_that_goes_away_says_so():
    camera = Camera(fan())
    camera.result = int(xr.Result.ERROR_SESSION_LOST)
    with pytest.raises(xr.exception.SessionLostError):
        camera.hand()
