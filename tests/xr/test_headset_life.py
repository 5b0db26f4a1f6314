"""`launch.py vr` on a real runtime: its life from READY to EXITING, and what ends it before."""

import json
import math

import numpy as np
import pytest

from shapeshift.app import cli
from shapeshift.scene.pose import Pose
from tests.support.xr.person import WHOLE_LIFE
from tests.support.xr.remote import EYE_DEGREES, EYES_APART_M
from tests.support.xr.validation import complaints, switched_on

NO_HEADSET, INTERRUPTED = 4, 130  # exit codes
PERIOD_S = 0.05  # of the null compositor


def test_a_session_lives_from_ready_to_exiting(stand, start):
    program = start(stand, "--frames", "25", **switched_on(stand.folder))
    with program.headset(stand.port) as remote:
        remote.head = Pose(
            np.array([0.1, 1.7, 0.2]), np.array([math.cos(0.1), 0, math.sin(0.1), 0])
        )
        remote.right.position, remote.right.stick = (0.3, 1.2, -0.4), (0.75, -0.5)
        remote.left.there = False
        remote.send()
        line = program.until(
            lambda line: line["focused"] and line["hands"]["right"]["stick"][0] > 0.5, "seen"
        )
        report = program.end()
    assert report["code"] == 0, program.told()
    assert report["states"] == WHOLE_LIFE
    assert (report["ended"], report["space"]) == ("frames", "LOCAL_FLOOR")
    assert report["headset"] == "Monado: Remote HMD"
    assert report["frames"] == len(program.lines) >= 25
    assert set(report["profiles"].values()) == {"/interaction_profiles/valve/index_controller"}
    assert not complaints(stand.folder)
    check_eyes(line)
    right = line["hands"]["right"]
    assert right["active"] and right["stick"] == [0.75, -0.5]
    np.testing.assert_allclose(right["grip"]["position"], (0.3, 1.2, -0.4), atol=1e-5)
    lost = line["hands"]["left"]
    assert not lost["active"] and lost["grip"] is None
    assert not any(
        line["hands"]["right"]["active"] for line in program.lines if not line["focused"]
    )
    check_times([line["seen_s"] for line in program.lines])


def check_eyes(line: dict) -> None:
    """Off-centre frusta and both eyes where the script put the head."""
    turn = Pose(np.zeros(3), np.array(line["head"]["wxyz"])).matrix()[:3, :3]
    np.testing.assert_allclose(line["head"]["position"], (0.1, 1.7, 0.2), atol=1e-5)
    np.testing.assert_allclose(turn[:, 2], (math.sin(0.2), 0, math.cos(0.2)), atol=1e-5)
    for view, (left, right, up, down), side in zip(
        line["views"], EYE_DEGREES, (-0.5, 0.5), strict=True
    ):
        wanted = [math.tan(math.radians(angle)) for angle in (left, right, down, up)]
        np.testing.assert_allclose(view["tangents"], wanted, atol=1e-5)
        away = np.array(view["position"]) - line["head"]["position"]
        np.testing.assert_allclose(away, turn[:, 0] * side * EYES_APART_M, atol=1e-5)


def check_times(seen_s: list[float]) -> None:
    """Time is the runtime's: frames are seen a whole number of its periods apart."""
    periods = np.diff(seen_s[2:]) / PERIOD_S  # the first ones come before it has a rhythm
    assert (periods > 0.5).all()
    np.testing.assert_allclose(periods, np.round(periods), atol=0.1)


@pytest.mark.slow
def test_recentring_brings_the_person_back_before_the_scene(served, start):
    program = start(served, "--frames", "1000000", **switched_on(served.folder))
    with program.headset(served.port) as remote:
        remote.send()
        before = program.until(lambda line: line["focused"], "focused")
        remote.head = Pose(
            np.array([0.6, 1.6, 0.4]), np.array([math.cos(0.5), 0, math.sin(0.5), 0])
        )
        remote.send()
        away = program.until(lambda line: line["head"]["position"][0] > 0.5, "away")
        served.recentre()
        after = program.until(lambda line: line["recentred"], "recentred")
        later = program.until(lambda line: line["frame"] > after["frame"] + 2, "later")
    for line in (after, later):
        np.testing.assert_allclose(eye_in_world(line), eye_in_world(before), atol=1e-4)
    assert np.linalg.norm(eye_in_world(away)[:3, 3] - eye_in_world(before)[:3, 3]) > 0.6
    assert not later["recentred"]
    assert program.interrupt() == INTERRUPTED, program.told()
    report = json.loads((served.folder / "report.json").read_text())
    assert (report["recentrings"], report["ended"]) == (1, "interrupted")
    assert not complaints(served.folder)


def eye_in_world(line: dict) -> np.ndarray:
    """(4, 4) world_from_head at the true scale."""
    room, head = (
        Pose(np.array(line[name]["position"]), np.array(line[name]["wxyz"]))
        for name in ("standing", "head")
    )
    return room.matrix() @ head.matrix()


@pytest.mark.slow
def test_a_runtime_that_goes_away_is_one_sentence(served, start):
    program = start(served, "--frames", "1000000", "--reopen", "0")
    with program.headset(served.port) as remote:
        remote.send()
        program.until(lambda line: line["focused"], "focused")
        served.kill_runtime()
        report = program.end()
    assert (report["code"], report["ended"]) == (NO_HEADSET, "runtime lost")
    assert len(report["eyes"]) == 2 and report["depth"]  # what was known of it, it still says
    assert report["states"][-1] == "FOCUSED"
    said = [line for line in program.told().splitlines() if line.startswith("shapeshift")]
    assert len(said) == 1 and "Monado" in said[0] and "went away" in said[0], said
    assert "Traceback" not in program.told()


@pytest.mark.parametrize("manifest", ["absent", "not json", "no library"])
def test_without_a_runtime_it_is_one_sentence(tmp_path, monkeypatch, capfd, manifest):
    """In this process: nothing of the runtime is loaded, and its loader's own words are none."""
    pytest.importorskip("xr", reason="pyopenxr is not installed", exc_type=ImportError)
    path = tmp_path / "runtime.json"
    runtime = {"name": "none", "library_path": str(tmp_path / "none.so")}
    texts = {
        "not json": "runtime",
        "no library": json.dumps({"file_format_version": "1.0.0", "runtime": runtime}),
    }
    if manifest in texts:
        path.write_text(texts[manifest])
    monkeypatch.setenv("XR_RUNTIME_JSON", str(path))
    assert cli.main(["vr", "--frames", "5"]) == NO_HEADSET
    out, said = capfd.readouterr()
    assert out == "" and len(said.splitlines()) == 1 and said.startswith("shapeshift vr: "), said
    assert str(path) in said and "SteamVR" in said
