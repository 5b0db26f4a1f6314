"""What moves on a page, by its scripts alone: beside Python's twins, and physics."""

import json
import subprocess
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.stop_weights import StopBlend
from shapeshift.scene.control import SNAP, Shift, Sweep
from shapeshift.scene.pose import Pose, View, perspective
from tests.support.web.page_scenes import PACE, STOPS

SCRIPT = Path(__file__).resolve().parents[1] / "support" / "web" / "motion.mjs"
BLEND = StopBlend(STOPS, PACE)
STARTS, STEP_S, STEPS = (0.0, 0.1, 0.4, 0.8, 1.0), 0.11, 200  # more than a round of 13.2 s
TARGET = np.array([0, 0.2, 0])  # that the camera of motion.mjs looks at


@pytest.fixture(scope="module")
def told(node) -> dict:
    """All that motion.mjs does."""
    number = {stop.name: s for s, stop in enumerate(STOPS)}
    pace = [{"start": number[p.start], "end": number[p.end], "blend": p.blend} for p in PACE]
    asked = {"stops": [asdict(stop) for stop in STOPS], "pace": pace, "starts": STARTS,
             "step_s": STEP_S, "steps": STEPS}  # fmt: skip
    done = subprocess.run(
        [node, str(SCRIPT)], input=json.dumps(asked), capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


def test_playing_is_that_of_the_viewer(told):
    for start, found in zip(STARTS, told["sweeps"], strict=True):
        sweep = Sweep.over(BLEND)
        sweep.resume_at(start)
        wanted = [BLEND.weights(sweep.advance(STEP_S)) for _ in range(STEPS)]
        np.testing.assert_allclose(found, wanted, atol=1e-12, err_msg=str(start))


def test_a_shift_and_a_knob_are_those_of_the_viewer(told):
    for k, (weights, over) in enumerate(told["shift"]):
        shift = Shift(STOPS[0].x, STOPS[2].x, BLEND, k / 10)
        np.testing.assert_allclose(weights, BLEND.weights(shift.control), atol=1e-12)
        assert over == shift.over
    assert SNAP == 0.02 and told["snapped"] == [0.379, 0.4, 0.4, 0.4, 0.421, 0.7]


def pixel_of(pose: dict, place: np.ndarray) -> np.ndarray:
    """(2,) column and row, from above, of a place (3,) in a picture of 480 x 400."""
    eye = Pose(np.array(pose["position"]), np.array(pose["wxyz"]))
    view = View(eye, perspective(0.8, (480, 400)), 0.01, 100, (480, 400))
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    x, y, z = (camera_from_world @ np.append(place, 1.0))[:3]
    return np.array([fx * x / z + cx, fy * y / z + cy])


def test_what_lies_before_the_middle_follows_a_drag(told):
    for by, drag in zip(((40, 0), (0, 30), (-25, -10)), told["orbits"], strict=True):
        eye = np.array(drag["before"]["position"])
        near = TARGET + 0.3 * (eye - TARGET)
        moved = pixel_of(drag["after"], near) - pixel_of(drag["before"], near)
        assert moved @ by > 0.9 * np.linalg.norm(moved) * np.linalg.norm(by)  # within 25 degrees
        away = [np.linalg.norm(np.array(drag[k]["position"]) - TARGET) for k in drag]
        assert away[0] == pytest.approx(away[1])  # it goes round
    pan = told["pan"]
    moved = pixel_of(pan["after"], TARGET) - pixel_of(pan["before"], TARGET)
    np.testing.assert_allclose(moved, (40, -20), atol=1e-6)  # it stays under the pointer


def test_nobody_is_turned_over_the_pole(told):
    wxyz = np.array(told["steep"]["after"]["wxyz"])
    assert Pose(np.zeros(3), wxyz).matrix()[1, 1] > 0  # its up is up


def test_sharpness_falls_only_where_frames_are_late(told):
    kept, little, late, later = told["scales"]
    assert kept == little == 1 and 0.5 <= later < late < 1


def test_a_stick_turns_once_and_to_its_side(told):
    """Radians to the left, as in vr/locomotion.py."""
    right, left, little = told["turns"]
    assert right == [pytest.approx(-np.pi / 6)] and left == [pytest.approx(np.pi / 6)]
    assert little == []


def test_things_fall_as_newton_says_and_fly_as_hands_moved(told):
    # Half a second in steps of 1/120 s: g t (t + 1/120) / 2 of symplectic Euler.
    fallen = 9.81 * 0.5 * (0.5 + 1 / 120) / 2
    np.testing.assert_allclose(told["fell"], (0.5, 5 - fallen, 0), atol=1e-9)
    assert told["lies"] == [pytest.approx(0.2, abs=0.01), 0]  # half its height over the floor
    slow, fast = told["thrown"]
    np.testing.assert_allclose(slow, (3, 0, 0), atol=1e-9)
    np.testing.assert_allclose(fast, (12, 0, 0), atol=1e-9)  # MOST_SPEED
