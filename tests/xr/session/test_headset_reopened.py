"""A session that is lost goes on in the next: scene, x, place and what hands hold stay."""

from pathlib import Path

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from tests.support.xr.person import CUBE_TOP_M, Person, place, pose_of
from tests.support.xr.xr_stand import PATIENCE_S

PROGRAM = Path(__file__).resolve().parents[2] / "support" / "xr" / "lose_session.py"
NO_HEADSET, INTERRUPTED = 4, 130  # exit codes


def eye_in_world(line: dict) -> np.ndarray:
    """(4, 4) world_from_head at the true scale."""
    return pose_of(line["standing"]).matrix() @ pose_of(line["head"]).matrix()


@pytest.mark.slow
def test_a_runtime_that_comes_back_finds_all_as_it_was(served, start):
    asked = ("--quality", "best", "--no-depth", "--reopen", str(PATIENCE_S))
    program = start(served, *asked)
    with program.headset(served.port) as remote:
        person = Person(program, remote)
        person.until(lambda line: line["focused"], "focused")
        remote.head = Pose(np.array([0.3, 1.6, 0.1]), np.array([1.0, 0, 0, 0]))
        person.frames(3)
        person.take("right", "cube", CUBE_TOP_M)
        person.reach("right", np.add(person.palm("right"), (0, 0.1, 0)))
        before = person.frames(10)
        hand = remote.right
    served.kill_runtime()
    served.revive_runtime()
    with program.headset(served.port) as remote:
        # Tracking begins elsewhere, as where a headset lies when its runtime starts.
        shift = np.array([0.5, 0.0, -0.4])
        remote.head = Pose(np.array([0.3, 1.6, 0.1]) + shift, np.array([1.0, 0, 0, 0]))
        remote.right = hand
        hand.position = tuple(np.array(hand.position) + shift)
        person = Person(program, remote)
        person.until(lambda line: line["focused"] and "LOST" not in line["state"], "focused anew")
        after = person.frames(12)
        assert after["held"]["right"] == "cube", after["held"]
        np.testing.assert_allclose(eye_in_world(after), eye_in_world(before), atol=1e-4)
        np.testing.assert_allclose(place(after, "cube"), place(before, "cube"), atol=0.01)
        for name, row in before["objects"].items():
            assert after["objects"][name]["x"] == row["x"]
        remote.right.squeeze = 0.0
        person.until(lambda line: line["held"]["right"] is None, "let go")
        assert program.interrupt() == INTERRUPTED, program.told()[-800:]
    report = program.end()
    states = report["states"]
    assert report["reopened"] == 1 and states.count("FOCUSED") >= 2
    assert states[: states.index("LOST")][-1] == "FOCUSED"
    # Ctrl-C may come between a frame and its line.
    assert report["frames"] - len(program.lines) in (0, 1)
    seen = [line["seen_s"] for line in program.lines]
    assert seen == sorted(seen)
    told = program.told()
    assert told.count("Trying for") == 1 and told.count("the session goes on") == 1
    assert "Traceback" not in told


@pytest.mark.slow
@pytest.mark.parametrize("how", ["LOSS_PENDING", "INSTANCE_LOSS_PENDING", "SESSION_LOST"])
def test_whichever_way_it_is_lost(stand, start, how):
    settings = {"SHAPESHIFT_TEST_LOSS": how}
    program = start(stand, "--no-depth", "--frames", "60", program=PROGRAM, **settings)
    with program.headset(stand.port) as remote:
        remote.send()
        program.until(lambda line: line["focused"], "focused")
        program.until(lambda line: line["frame"] > 26, "the second session")
    report = program.end()
    assert (report["code"], report["ended"], report["reopened"]) == (0, "frames", 1)
    assert report["states"].count("READY") == 2 and report["frames"] >= 60
    assert program.told().count("Trying for 10 seconds to go on.") == 1
    assert "Traceback" not in program.told()


@pytest.mark.slow
def test_one_that_stays_away_is_said_once_and_then_as_ever(served, start):
    program = start(served, "--frames", "1000000", "--no-depth", "--reopen", "2")
    with program.headset(served.port) as remote:
        remote.send()
        program.until(lambda line: line["focused"], "focused")
        served.kill_runtime()
        report = program.end()
    assert (report["code"], report["ended"], report["reopened"]) == (NO_HEADSET, "runtime lost", 0)
    told = program.told()
    assert told.count("Trying for 2 seconds to go on.") == 1
    (last,) = [line for line in told.splitlines() if line.startswith("shapeshift")]
    assert "went away" in last and "Traceback" not in told
