"""Controllers as they are drawn in a real session: at first with their names, or for good."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.scene.pose import View
from shapeshift.vr.frame import SIDES
from tests.support.xr.person import CARRIES, FREE, SIZE, Person, open_panel, pixel_of, pose_of

HELD_UP = (0.12, 1.4, -0.35)  # metres of the room, where nothing is within reach
LEANING = (np.cos(0.45), np.sin(0.45), 0.0, 0.0)
NEAR_PX = 24  # from the grip: an Index' handle, which lights up as it is squeezed


def lit(pictures: Path, line: dict, eye: int) -> int:
    """Pixels about the right grip in the colour of what is pressed."""
    row = line["views"][eye]
    view = View(pose_of(row), tuple(row["tangents"]), 0.05, 1000.0, SIZE)
    column, at = pixel_of(view, np.array(line["hands"]["right"]["grip"]["position"]))
    picture = np.asarray(Image.open(pictures / f"{SIDES[eye]}-{line['frame']:05d}.png"))
    near = picture[at - NEAR_PX : at + NEAR_PX, column - NEAR_PX : column + NEAR_PX].astype(int)
    red, green, blue = near[..., 0], near[..., 1], near[..., 2]
    return int(((red > 120) & (red > 1.25 * green) & (green > 1.3 * blue)).sum())


def squeezed(person: Person, pictures: Path) -> list[int]:
    """What of the hand is lit in either eye's picture while it squeezes, less what is without."""
    hand = person.controller("right")
    hand.position, hand.wxyz = HELD_UP, LEANING
    rest = person.frames(3)
    person.squeeze("right")
    line = person.frames(2)
    person.squeeze("right", 0.0)  # its pictures are there
    return [lit(pictures, line, eye) - lit(pictures, rest, eye) for eye in range(2)]


@pytest.mark.slow
def test_while_buttons_are_named_a_hand_is_the_controller_that_it_holds(stand, start):
    pictures = stand.folder / "pictures"
    program = start(stand, "--quality", "best", "--no-depth", "--pictures", str(pictures))
    with program.headset(stand.port) as remote:
        person = Person(program, remote)
        remote.left.position = CARRIES
        person.until(lambda line: line["focused"], "focused")
        assert min(squeezed(person, pictures)) > 60
        program.interrupt()
    assert "Traceback" not in program.told()


@pytest.mark.slow
def test_gloves_are_exchanged_for_controllers_and_that_is_kept(stand, start):
    pictures = stand.folder / "pictures"
    asked = ("--quality", "best", "--no-depth", "--no-hints", "--pictures", str(pictures))
    program = start(stand, *asked)
    with program.headset(stand.port) as remote:
        person = Person(program, remote)
        remote.left.position = CARRIES
        person.until(lambda line: line["focused"], "focused")
        assert max(squeezed(person, pictures)) < 10, "gloves"
        remote.right.position, remote.right.wxyz = FREE, (1.0, 0.0, 0.0, 0.0)
        open_panel(person)
        person.frames(8)
        for name in ("Room", "Touch"):
            press(person, name)
        remote.right.stick = (0.0, -1.0)
        person.until(lambda line: "Comfort" in line["panel"]["buttons"], "scrolled")
        remote.right.stick = (0.0, 0.0)
        person.frames(4)
        press(person, "Comfort")
        remote.right.stick = (0.0, -1.0)
        person.until(lambda line: "Controllers" in line["panel"]["buttons"], "scrolled")
        remote.right.stick = (0.0, 0.0)
        person.frames(4)
        press(person, "Controllers")
        open_panel(person)
        assert min(squeezed(person, pictures)) > 60
        program.interrupt()
    kept = json.loads((stand.folder / "config" / "shapeshift" / "headset.json").read_text())
    assert kept["hand_model"] == "controllers"
    assert "Traceback" not in program.told()


def press(person: Person, button: str) -> None:
    """Points at a button and pulls the trigger."""
    person.point("right", np.array(person.line["panel"]["buttons"][button]))
    person.controller("right").trigger = 1.0
    person.until(lambda line: line["hands"]["right"]["trigger"] == 1.0, "a pull")
    person.controller("right").trigger = 0.0
    person.frames(4)
