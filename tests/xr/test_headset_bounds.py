"""What stops somebody who walks, in a real session: the edges of the room, and obstacles."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.scene.pose import Pose, View
from tests.support.xr.known_room import SIZE_M
from tests.support.xr.person import SIZE, Person, pixel_of, place, pose_of
from tests.support.xr.validation import complaints, switched_on

INTERRUPTED = 130  # exit code
PROGRAM = Path(__file__).resolve().parents[1] / "support" / "xr" / "known_room.py"
STEP_M = 0.1  # of a head from frame to frame
BLUE = 60  # display values, so much more than red: of an edge, and of nothing else at the place


def walk(person: Person, goal: np.ndarray) -> list[dict]:
    """The head goes to a place (3,) of the room in a line."""
    start = np.array(person.line["head"]["position"])
    steps = max(1, round(float(np.linalg.norm(goal - start)) / STEP_M))
    lines = []
    for step in range(1, steps + 1):
        at = start + step / steps * (goal - start)
        person.remote.head = Pose(at, person.remote.head.wxyz)
        lines.append(person.frame())
    return lines


@pytest.mark.slow
def test_edges_of_the_room_are_seen_near_them_and_the_table_is_no_place_for_a_head(stand, start):
    pictures = stand.folder / "pictures"
    asked = ("--quality", "best", "--no-hints", "--pictures", str(pictures))
    program = start(stand, *asked, program=PROGRAM, **switched_on(stand.folder))
    with program.headset(stand.port) as remote:
        person = Person(program, remote)
        remote.left.there = remote.right.there = False
        person.until(lambda line: line["focused"], "focused")
        assert person.line["area"]["size_m"] == list(SIZE_M) and person.line["dark"] == 0
        edge = np.array([0.0, 1.6, -SIZE_M[1] / 2])  # its upper line ahead
        blue = []
        for z in (0.0, -0.7):
            walk(person, np.array([0.0, 1.7, z]))
            line = person.frames(2)
            person.frame()  # its picture is written
            row = line["views"][0]
            blue.append(bluest(pictures / f"left-{line['frame']:05d}.png", row, edge))
        assert blue[0] < 5 and blue[1] > BLUE, blue
        cube = person.in_room(place(person.line, "cube"))
        beside = np.add(cube, (-0.12, 0.3, 0.0))
        above = walk(person, beside)
        inside = walk(person, beside - (0.0, 0.36, 0.0))
        assert max(line["dark"] for line in above) == 0 < inside[-1]["dark"]
        assert max(line["dark"] for line in inside) > 0.9
        assert walk(person, beside)[-1]["dark"] == 0
        assert program.interrupt() == INTERRUPTED, program.told()[-800:]
    assert not complaints(stand.folder)
    assert "Traceback" not in program.told()


def bluest(path: Path, row: dict, room: np.ndarray) -> int:
    """How much more blue than red there is in the column of a place (3,) of the room."""
    view = View(pose_of(row), tuple(row["tangents"]), 0.05, 1000.0, SIZE)
    column, line = pixel_of(view, room)
    pixels = np.asarray(Image.open(path))[..., :3].astype(int)
    near = pixels[max(line - 3, 0) : line + 4, column]
    return int((near[..., 2] - near[..., 0]).max())
