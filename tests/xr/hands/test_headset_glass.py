"""The glass in a real session: each eye sees another stop through it, as the reference draws that
stop; its edge turned to the head hides it, and the panel chooses it.
"""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from shapeshift.scene.pose import Pose, View
from shapeshift.vr.frame import SIDES
from shapeshift.vr.glass import RIM_M
from tests.support.xr.person import CARRIES, FREE, SIZE, Person, open_panel, place, pose_of
from tests.support.xr.reference_eyes import BEHIND, ROUNDING, drawn, eyes_of, scene_at
from tests.support.xr.validation import complaints, switched_on

TILT = 0.35  # half of the angle by which the head looks down
UPRIGHT = (np.cos(0.5), np.sin(0.5), 0.0, 0.0)  # of a fist that holds it up: leaning ahead
ICE = 0.25  # x of the cube's stop


def distances(line: dict, eye: int) -> np.ndarray:
    """(H, W) metres of the room from the glass's middle where a pixel's ray meets its plane, row 0
    on top.  The plane is the hand's: its handle and the breadth of the hand lie in it.
    """
    row = line["views"][eye]
    view = View(pose_of(row), tuple(row["tangents"]), 0.05, 1000.0, SIZE)
    (left, right, down, up), (width, height) = view.tangents, SIZE
    x = left + (np.arange(width) + 0.5) * (right - left) / width
    y = up - (np.arange(height) + 0.5) * (up - down) / height
    x, y = np.meshgrid(x, y)
    matrix = view.world_from_eye.matrix()
    along = np.stack([x, y, -np.ones_like(x)], axis=2) @ matrix[:3, :3].T
    normal = pose_of(line["hands"]["left"]["grip"]).matrix()[:3, 1]
    middle = np.array(line["glass"]["middle"])
    metres = (middle - matrix[:3, 3]) @ normal / (along @ normal)
    meets = matrix[:3, 3] + along * metres[..., None] - middle
    return np.where(metres > 0, np.linalg.norm(meets, axis=2), np.inf)


@pytest.mark.slow
def test_each_eye_sees_the_stop_through_it_as_the_reference_draws_it(stand, start):
    pictures = stand.folder / "pictures"
    asked = ("--quality", "best", "--no-floor", "--no-hints", "--glass", "ICE")
    program = start(stand, *asked, "--pictures", str(pictures), **switched_on(stand.folder))
    with program.headset(stand.port) as remote:
        person = Person(program, remote)
        remote.head = Pose(
            np.array([-0.2, 1.2, -0.2]), np.array([np.cos(TILT), -np.sin(TILT), 0, 0])
        )
        remote.right.position = BEHIND
        remote.left.position, remote.left.wxyz = (-0.19, 0.85, -0.45), UPRIGHT
        line = person.until(lambda line: line["glass"] is not None, "a glass")
        person.line = line
        sight = person.in_room(place(line, "cube")) - np.array(line["head"]["position"])
        goal = line["head"]["position"] + 0.35 * sight - np.array(line["glass"]["middle"])
        person.move("left", np.add(remote.left.position, goal))
        line = person.frames(2)
        person.frame()  # its pictures follow its line
        remote.left.wxyz = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))  # its edge to the head
        person.until(lambda line: line["glass"] is None, "hidden")
        assert program.interrupt() == 130
    assert line["glass"]["stop"] == "ice" and line["objects"]["cube"]["x"] == 0.0
    plain = scene_at(line)
    ice = replace(plain, objects=tuple(
        replace(o, x=ICE) if o.name == "cube" else o for o in plain.objects
    ))  # fmt: skip
    changed = []
    for i, (side, eye) in enumerate(zip(SIDES, eyes_of(line), strict=True)):
        name = pictures / f"{side}-{line['frame']:05d}.png"
        seen = np.asarray(Image.open(name))[..., :3] / 255
        through, without = drawn(ice, eye), drawn(plain, eye)
        away, radius = distances(line, i), line["glass"]["radius_m"]
        slack = 0.005  # metres: two pixels
        inside = away < radius - RIM_M - slack
        # Half a step more than of a whole picture: a part has other tiles, in which blending ends
        # once hardly any light is left.
        assert np.abs(seen - through)[inside].max() < 2 * ROUNDING
        # Above it: its name hangs there alone, and below is the hand.
        outside = (away > 1.6 * radius) & (np.arange(SIZE[1])[:, None] < SIZE[1] // 3)
        assert np.abs(seen - without)[outside].max() < 1.5 * ROUNDING
        changed.append((np.abs(through - without).max(axis=2) > 0.1) & inside)
        rim = np.abs(away - radius) < 0.4 * RIM_M
        assert np.abs(seen - without)[rim].max(axis=1).mean() > 0.2, "metal"
    assert all(each.sum() > 50 for each in changed), "the cube is behind it"
    assert not np.array_equal(*changed), "each from its own place"
    assert not complaints(stand.folder)
    assert "Traceback" not in program.told()


@pytest.mark.slow
def test_the_panel_hands_it_out_and_takes_it_back(quick_person):
    person = quick_person
    left, right = person.controller("left"), person.controller("right")
    left.position, right.position = CARRIES, FREE
    person.frames(2)
    open_panel(person)
    person.frames(8)
    for name in ("Room", "Scale", "Touch"):  # folded, so that Look is not far down
        press(person, name)
    for name in ("Look", "Glass", "ice"):
        assert name in person.line["panel"]["buttons"], "|".join(person.line["panel"]["buttons"])
        press(person, name)
    assert person.line["glass"] is None, "not over the panel"
    open_panel(person)
    left.wxyz = UPRIGHT
    line = person.until(lambda line: line["glass"] is not None, "a glass")
    assert line["glass"]["stop"] == "ice"
    line = person.frames(2)
    before = np.array(line["glass"]["middle"])
    person.move("left", np.add(left.position, (0.1, 0.05, 0.0)))
    np.testing.assert_allclose(person.line["glass"]["middle"] - before, (0.1, 0.05, 0.0), atol=1e-4)
    left.wxyz = (1.0, 0.0, 0.0, 0.0)
    left.position = CARRIES
    open_panel(person)
    person.frames(8)
    press(person, "no glass")
    open_panel(person)
    left.wxyz = UPRIGHT
    assert person.frames(4)["glass"] is None


def press(person: Person, button: str) -> None:
    """Points at a button and pulls the trigger, where the panel has it."""
    if button not in person.line["panel"]["buttons"]:
        return
    person.point("right", np.array(person.line["panel"]["buttons"][button]))
    person.controller("right").trigger = 1.0
    person.until(lambda line: line["hands"]["right"]["trigger"] == 1.0, "a pull")
    person.controller("right").trigger = 0.0
    person.frames(4)


@pytest.mark.slow
def test_a_stop_that_is_not_there_is_told_before_the_session_begins(stand, start):
    program = start(stand, "--glass", "lava", "--frames", "3", reports=False)
    assert program.process.wait(60) == 2
    assert "--glass is lava, expected one of the stops: normal, ice" in program.told()
    assert "Traceback" not in program.told()
