"""Sitting, and one controller alone, in a real session; what the panel sets is there again."""

import json

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from tests.support.xr.person import CARRIES, FREE, WHOLE_LIFE, Person
from tests.support.xr.validation import complaints, switched_on

INTERRUPTED = 130  # exit code
SITS_M = 1.1  # of the eyes


@pytest.mark.slow
def test_who_sits_and_has_one_hand_does_all_with_it(stand, start):
    settings = stand.folder / "config" / "shapeshift" / "headset.json"
    settings.parent.mkdir(parents=True)
    settings.write_text(json.dumps({"hands": "right", "turning": "smooth"}))
    (settings.parent / "settings.json").write_text(json.dumps({"language": "de"}))
    asked = ("--quality", "best", "--posture", "seated")
    program = start(stand, *asked, **switched_on(stand.folder))
    with program.headset(stand.port) as remote:
        remote.head = Pose(np.array([0.0, SITS_M, 0.0]), np.array([1.0, 0, 0, 0]))
        remote.left.position, remote.right.position = CARRIES, FREE
        person = Person(program, remote)
        line = person.until(lambda line: line["focused"] and line["lift_m"] > 0, "raised")
        line = person.frames(3)
        np.testing.assert_allclose(line["head"]["position"][1], 1.6, atol=1e-4)
        np.testing.assert_allclose(line["lift_m"], 1.6 - SITS_M, atol=1e-4)
        assert not line["hands"]["left"]["active"] and line["hands"]["right"]["active"]
        first = line["standing"]["position"]
        remote.right.stick = (0.0, 1.0)
        person.until(lambda line: gone(line, first) > 0.3, "walked")
        remote.right.stick = (0.0, 0.0)
        with person.pressing("right", "stick_click"):
            pass
        line = person.frames(4)
        assert line["panel"]["open"] and line["panel"]["hand"] == "left"
        person.point("right", np.array(line["panel"]["buttons"]["Zentrieren"]))
        remote.right.trigger = 1.0
        person.until(lambda line: line["hands"]["right"]["trigger"] == 1.0, "a pull")
        remote.right.trigger = 0.0
        line = person.until(lambda line: gone(line, first) < 1e-3, "back")
        assert program.interrupt() == INTERRUPTED, program.told()[-800:]
    assert program.end()["states"] == WHOLE_LIFE
    assert json.loads(settings.read_text()) == {"hands": "right", "turning": "smooth"}
    assert not complaints(stand.folder)
    assert "Traceback" not in program.told()


def gone(line: dict, first: list[float]) -> float:
    return float(np.linalg.norm(np.subtract(line["standing"]["position"], first)))
