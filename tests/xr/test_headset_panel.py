"""The panel in a real session: a hand takes the knob, the stick slides, buttons are pointed at."""

import numpy as np
import pytest
from person import Person, pose_of
from PIL import Image
from test_headset_life import WHOLE_LIFE
from test_headset_pictures import SIZE, pixel_of

from scene.pose import View
from vr.frame import SIDES

BEFORE = 0.03  # metres from the panel, where a finger is close and does not press
CARRIES, FREE = (-0.05, 1.2, -0.45), (0.25, 1.25, -0.25)  # metres of the room
STOPS = {"normal": 0.0, "ice": 0.25, "fire": 0.5, "charcoal": 0.75}  # of the cube


@pytest.fixture
def reader(person: Person) -> Person:
    """Somebody who has the panel before the eyes, in the left hand."""
    person.controller("left").position = CARRIES
    person.controller("right").position = FREE
    line = person.frames(8)  # it follows the hand
    assert line["panel"]["open"] and line["panel"]["hand"] == "left"
    assert (line["panel"]["object"], line["panel"]["shown"]) == ("cube", "normal")
    return person


def on_slider(line: dict, x: float) -> np.ndarray:
    """(3,) metres of the room."""
    first, last = map(np.array, line["panel"]["slider"])
    return first + x * (last - first)


def direction(line: dict) -> np.ndarray:
    """(3,) of length 1: along the slider."""
    first, last = map(np.array, line["panel"]["slider"])
    return (last - first) / np.linalg.norm(last - first)


def in_front(line: dict, room: np.ndarray) -> np.ndarray:
    """A little towards who reads."""
    way = np.array(line["head"]["position"]) - room
    return room + BEFORE * way / np.linalg.norm(way)


def test_the_knob_is_grabbed_and_slides_the_modality(reader):
    reader.touch("right", in_front(reader.line, np.array(reader.line["panel"]["knob"])))
    reader.frames(2)
    line = reader.squeeze("right")
    assert line["held"]["right"] is None, "the knob is taken, not the world"
    started = len(reader.program.lines)
    along = 0.006 * direction(line)  # metres a frame
    while line["panel"]["shown"] != "fire" and line["objects"]["cube"]["x"] < 0.7:
        line = reader.move("right", np.add(reader.controller("right").position, along))
    line = reader.frames(3)
    assert (line["objects"]["cube"]["x"], line["panel"]["shown"]) == (STOPS["fire"], "fire")
    np.testing.assert_allclose(line["panel"]["knob"], on_slider(line, STOPS["fire"]), atol=1e-3)
    seen = {line["objects"]["cube"]["x"] for line in reader.program.lines[started:]}
    assert len(seen - set(STOPS.values())) > 5, "it slides, it does not jump"
    reader.squeeze("right", 0.0)
    line = reader.touch("right", in_front(line, on_slider(line, 1.0)))
    assert line["objects"]["cube"]["x"] == STOPS["fire"], "an open hand moves nothing"
    moved = np.subtract(
        line["standing"]["position"], reader.program.lines[0]["standing"]["position"]
    )
    assert np.linalg.norm(moved) == 0, "nor did it draw the world"


@pytest.mark.slow
def test_the_stick_slides_and_rests_at_every_stop(reader):
    stick = reader.controller("left")
    stick.stick = (1.0, 0.0)
    reader.until(lambda line: line["panel"]["shown"] == "ice", "ice")
    line = reader.frames(6)
    assert line["objects"]["cube"]["x"] == STOPS["ice"]
    stick.stick = (0.0, 0.0)
    reader.frames(2)
    stick.stick = (1.0, 0.0)
    line = reader.until(lambda line: line["panel"]["shown"] == "fire", "fire")
    assert line["standing"] == reader.program.lines[0]["standing"], "the panel's stick walks not"


def press(person: Person, button: str) -> dict:
    """Points at a button from afar and pulls the trigger."""
    hand = person.controller("right")
    person.point("right", np.array(person.line["panel"]["buttons"][button]))
    hand.trigger = 1.0
    line = person.until(lambda line: line["hands"]["right"]["trigger"] == 1.0, "a pull")
    hand.trigger = 0.0
    person.remote.send()
    return line


@pytest.mark.slow
def test_a_pointed_at_button_recentres(reader):
    before = reader.line
    reader.controller("left").stick = (0.0, 1.0)  # ahead: the stick walks
    reader.until(lambda line: gone(line, before) > 0.3, "walked")
    reader.controller("left").stick = (0.0, 0.0)
    reader.frames(3)
    press(reader, "recentre")
    line = reader.until(lambda line: gone(line, before) < 1e-3, "back")
    assert not line["recentred"], "it was the person, not the runtime"


def gone(line: dict, before: dict) -> float:
    way = np.subtract(line["standing"]["position"], before["standing"]["position"])
    return float(np.linalg.norm(way))


@pytest.mark.slow
def test_exit_asks_once_more_and_ends_the_session(reader):
    press(reader, "exit")
    reader.frames(5)
    assert reader.program.process.poll() is None
    press(reader, "exit")
    report = reader.program.end()
    assert (report["code"], report["ended"]) == (0, "from the panel")
    assert report["states"] == WHOLE_LIFE


@pytest.mark.slow
def test_the_menu_button_puts_it_away_and_takes_it_out(reader):
    with reader.pressing("left", "secondary"):  # an Index controller has no other for a menu
        pass
    assert not reader.line["panel"]["open"]
    with reader.pressing("left", "secondary"):
        pass
    assert reader.line["panel"]["open"] and reader.line["panel"]["hand"] == "left"


@pytest.mark.slow
def test_both_eyes_see_the_panel(stand, start):
    pictures = stand.folder / "pictures"
    program = start(stand, "--quality", "best", "--pictures", str(pictures))
    with program.headset(stand.port) as remote:
        person = Person(program, remote)
        remote.left.position, remote.right.position = CARRIES, (0.0, 1.4, 1.5)
        person.until(lambda line: line["focused"], "focused")
        shown = person.frames(10)
        with person.pressing("left", "secondary"):
            pass
        hidden = person.line
        person.frame()  # its pictures follow its line
        program.interrupt()
    assert shown["panel"]["open"] and not hidden["panel"]["open"]
    knob = np.array(shown["panel"]["knob"])
    for side, view in zip(SIDES, shown["views"], strict=True):
        eye = View(pose_of(view), tuple(view["tangents"]), 0.05, 1000.0, SIZE)
        at = pixel_of(eye, knob)
        there, not_there = (
            orange(np.asarray(Image.open(pictures / f"{side}-{frame['frame']:05d}.png")), at)
            for frame in (shown, hidden)
        )
        assert there > 5 and not_there == 0, side


def orange(picture: np.ndarray, at: tuple[int, int]) -> int:
    """Pixels of the knob's colour about a (column, row)."""
    near = picture[at[1] - 5 : at[1] + 6, at[0] - 5 : at[0] + 6].astype(int)
    return int((near[..., 0] > near[..., 2] + 60).sum())
