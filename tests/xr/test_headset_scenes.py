"""Without taking it off: another scene, a start and a picture, in a real session."""

import json

import numpy as np
import pytest
from PIL import Image

from shapeshift.app.editor.state.user.recent import RecentFiles
from shapeshift.app.editor.state.user.recent_pictures import RecentPictures
from shapeshift.scene.pose import Pose
from tests.support.three_stops import three_stop_package
from tests.support.xr.person import CARRIES, FREE, Person, open_panel
from tests.support.xr.validation import complaints, switched_on

INTERRUPTED = 130  # exit code
MOST_FRAMES = 200  # of a scroll


def press(person: Person, label: str) -> None:
    """Scrolls until an item is in sight, points at it and pulls the trigger."""
    hand = person.controller("right")
    for _ in range(MOST_FRAMES):
        if label in person.line["panel"]["buttons"]:
            break
        hand.stick = (0.0, -1.0)
        person.frame()
    hand.stick = (0.0, 0.0)
    person.frames(4)
    person.point("right", np.array(person.line["panel"]["buttons"][label]))
    hand.trigger = 1.0
    person.until(lambda line: line["hands"]["right"]["trigger"] == 1.0, "a pull")
    hand.trigger = 0.0
    person.frames(4)


@pytest.mark.slow
def test_another_scene_a_start_and_a_picture(stand, start):
    config, documents = stand.folder / "config" / "shapeshift", stand.folder / "documents"
    other = three_stop_package(stand.folder / "three.shift")
    RecentFiles(config).add(other)
    looks = np.zeros((54, 96, 3))
    looks[:, :48] = (0.2, 0.5, 0.9)
    RecentPictures(config).keep(other, looks, [other])
    pictures = stand.folder / "pictures"
    pictured = ("--pictures", str(pictures), "--no-hints", "--quality", "best")
    settings = switched_on(stand.folder) | {"XDG_DOCUMENTS_DIR": str(documents)}
    program = start(stand, *pictured, **settings)
    with program.headset(stand.port) as remote:
        remote.left.position, remote.right.position = CARRIES, FREE
        person = Person(program, remote)
        person.until(lambda line: line["focused"], "focused")
        remote.head = Pose(np.array([0.3, 1.6, 0.1]), np.array([1.0, 0, 0, 0]))
        open_panel(person)
        person.frames(8)
        for label in ("Touch", "Room", "Scenes", "Record frames"):
            press(person, label)
        person.frames(12)
        for label in ("Stop recording", "Take a picture", "Start from here"):
            press(person, label)
        eye = person.line["standing"], person.line["head"]
        saved = documents / "Shapeshift" / "scenes" / "touch.scene.json"
        person.until(lambda line: saved.exists(), "saved")
        view = json.loads(saved.read_text())["view"]
        press(person, "three.shift")
        line = person.until(lambda line: line["scene"] == "three.scene.json", "another scene")
        line = person.frames(8)
        assert set(line["objects"]) == {"three"} and line["panel"]["open"]
        assert line["panel"]["object"] == "three" and line["standing"]["scale"] == 1.0
        assert program.interrupt() == INTERRUPTED, program.told()[-800:]
    w, _, y, _ = eye[0]["wxyz"]  # a room stands level
    turn = 2 * np.arctan2(y, w)
    away = np.array(eye[1]["position"])
    c, s = np.cos(turn), np.sin(turn)
    world = np.array([c * away[0] + s * away[2], away[1], c * away[2] - s * away[0]])
    np.testing.assert_allclose(view["eye"], world + eye[0]["position"], atol=1e-3)
    (taken,) = (documents / "Shapeshift" / "pictures").glob("*.png")
    seen = np.asarray(Image.open(taken)).astype(int)
    last = sorted(pictures.glob("left-*.png"))[-1]
    assert seen.shape == np.asarray(Image.open(last)).shape and np.ptp(seen) > 100
    recorded = documents / "Shapeshift" / "pictures" / "recording-001"
    frames = sorted(recorded.glob("*.png"))
    assert len(frames) >= 5 and (recorded / "frames.csv").exists()
    assert np.asarray(Image.open(frames[-1])).shape == seen.shape
    assert RecentFiles.read(config).paths == (other,), "a measured run keeps no list"
    assert not complaints(stand.folder)
    assert "Traceback" not in program.told()
