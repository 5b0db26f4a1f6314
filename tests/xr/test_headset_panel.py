"""The panel in a real session: a hand takes the knob, the stick slides, buttons are pointed at."""

import numpy as np
import pytest
from PIL import Image

from shapeshift.scene.pose import Pose, View
from shapeshift.vr.frame import SIDES
from tests.support.xr.person import (
    CARRIES,
    FREE,
    SIZE,
    WHOLE_LIFE,
    Person,
    direction,
    in_front,
    open_panel,
    pixel_of,
    pose_of,
)

STOPS = {"normal": 0.0, "ice": 0.25, "fire": 0.5, "charcoal": 0.75}  # of the cube


@pytest.fixture
def reader(person: Person) -> Person:
    """Somebody who has the panel before the eyes, in the left hand."""
    person.controller("left").position = CARRIES
    person.controller("right").position = FREE
    line = person.frames(2)
    assert not line["panel"]["open"], "at first the scene is what one sees"
    open_panel(person)
    line = person.frames(8)  # it follows the hand
    assert line["panel"]["open"] and line["panel"]["hand"] == "left"
    assert (line["panel"]["object"], line["panel"]["shown"]) == ("cube", "normal")
    return person


def on_slider(line: dict, x: float) -> np.ndarray:
    """(3,) metres of the room."""
    first, last = map(np.array, line["panel"]["slider"])
    return first + x * (last - first)


def test_the_knob_is_grabbed_and_slides_the_modality(reader):
    reader.touch("right", in_front(reader.line, np.array(reader.line["panel"]["knob"])))
    reader.frames(2)
    line = reader.squeeze("right")
    assert line["held"]["right"] is None, "the knob is taken, not the world"
    assert line["layers"] == ["panel", "depth", "eyes"]
    started = len(reader.program.lines)
    along = 0.003 * direction(line)  # metres a frame
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
    press(reader, "Recentre")
    line = reader.until(lambda line: gone(line, before) < 1e-3, "back")
    assert not line["recentred"], "it was the person, not the runtime"


def gone(line: dict, before: dict) -> float:
    way = np.subtract(line["standing"]["position"], before["standing"]["position"])
    return float(np.linalg.norm(way))


@pytest.mark.slow
def test_exit_asks_once_more_and_ends_the_session(reader):
    press(reader, "Exit")
    line = reader.frames(5)
    assert reader.program.process.poll() is None
    assert "Exit" not in line["panel"]["buttons"]
    press(reader, "Really exit?")
    report = reader.program.end()
    assert (report["code"], report["ended"]) == (0, "from the panel")
    assert report["states"] == WHOLE_LIFE


@pytest.mark.slow
def test_the_menu_button_puts_it_away_and_takes_it_out(reader):
    open_panel(reader)
    assert not reader.line["panel"]["open"]
    open_panel(reader)
    assert reader.line["panel"]["open"] and reader.line["panel"]["hand"] == "left"


@pytest.mark.slow
def test_a_palm_that_is_turned_up_shows_it(person):
    """As one looks at a watch: fingers ahead, the palm to the sky."""
    hand = person.controller("left")
    hand.position, person.controller("right").position = CARRIES, FREE
    matrix = np.eye(4)
    matrix[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    hand.wxyz = tuple(Pose.from_matrix(matrix).wxyz)
    line = person.until(lambda line: line["panel"]["open"], "open")
    line = person.frames(8)
    knob, grip = (
        np.array(line["panel"]["knob"]),
        np.array(line["hands"]["left"]["grip"]["position"]),
    )
    assert knob[0] < grip[0] - 0.05, "outwards of the hand"
    eyes_at = line["head"]["position"][1]
    assert knob[1] < eyes_at, "below what one looks at"
    hand.wxyz = (1.0, 0.0, 0.0, 0.0)
    person.until(lambda line: not line["panel"]["open"], "closed")


@pytest.mark.slow
def test_the_floor_is_seen_and_its_switch_takes_it_away(stand, start):
    """Over the shoulder, where the scene has nothing at all."""
    pictures = stand.folder / "pictures"
    # No card may tell of late frames: a busy machine has them, and a card is seen behind, too.
    quiet = ("--quality", "best", "--no-hints")
    program = start(stand, *quiet, "--pictures", str(pictures))
    with program.headset(stand.port) as remote:
        person = Person(program, remote)
        remote.left.position, remote.right.position = CARRIES, FREE
        person.until(lambda line: line["focused"], "focused")
        open_panel(person)
        person.frames(8)
        before = person.line
        press(person, "grid on the floor")
        person.frames(4)
        open_panel(person)
        after = person.frames(2)
        remote.head = Pose(np.array([0.0, 1.6, 0.0]), np.array([0.0, 0.0, 1.0, 0.0]))
        behind = person.frames(3)
        person.frame()
        program.interrupt()

    def spread(line: dict, side: str) -> int:
        name = pictures / f"{side}-{line['frame']:05d}.png"
        return int(np.ptp(np.asarray(Image.open(name)).astype(int)[:, :, :3], axis=(0, 1)).max())

    assert not after["panel"]["open"]
    for side in SIDES:
        assert spread(behind, side) == 0, "switched off there is nothing behind the person"
        assert floor_of(np.asarray(Image.open(pictures / f"{side}-{before['frame']:05d}.png"))) > 30


def floor_of(picture: np.ndarray) -> int:
    """Pixels of the lower right corner, where no panel is, that are a little lighter than the
    background and grey.
    """
    rows, columns = picture.shape[:2]
    part = picture[rows // 2 :, columns * 3 // 4 :].astype(int)
    grey = np.ptp(part, axis=2) <= 4
    return int((grey & (part.mean(axis=2) > 26) & (part.mean(axis=2) < 90)).sum())


@pytest.mark.slow
def test_both_eyes_see_the_panel(stand, start):
    pictures = stand.folder / "pictures"
    program = start(stand, "--quality", "best", "--pictures", str(pictures))
    with program.headset(stand.port) as remote:
        person = Person(program, remote)
        remote.left.position, remote.right.position = CARRIES, (0.0, 1.4, 1.5)
        person.until(lambda line: line["focused"], "focused")
        open_panel(person)
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
