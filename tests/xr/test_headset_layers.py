"""What `launch.py vr` hands to a real runtime: eyes, how deep they are, the panel as a layer."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.scene.pose import Pose, View
from tests.support.xr.person import SIZE, Person, open_panel, pixel_of
from tests.support.xr.validation import complaints, switched_on

INTERRUPTED = 130  # exit code
PROGRAM = Path(__file__).resolve().parents[1] / "support" / "xr" / "show_depth.py"
GLOVE = 150  # display values, least of a glove's that light falls on


def eye_of(line: dict, which: int) -> View:
    """An eye in the room."""
    row = line["views"][which]
    pose = Pose(np.array(row["position"]), np.array(row["wxyz"]))
    return View(pose, tuple(row["tangents"]), 0.05, 1000.0, SIZE)


def picture_of(folder, line: dict, side: str) -> np.ndarray:
    """(H, W, 3)."""
    return np.asarray(Image.open(folder / f"{side}-{line['frame']:05d}.png"))[..., :3].astype(int)


@pytest.mark.slow
def test_hands_go_behind_the_table_and_the_panel_is_a_layer(stand, start):
    pictures = stand.folder / "pictures"
    asked = ("--quality", "best", "--no-hints", "--pictures", str(pictures))
    program = start(stand, *asked, **switched_on(stand.folder))
    with program.headset(stand.port) as remote:
        tilt = 0.35  # half of the angle, downwards
        turned = np.array([np.cos(tilt), -np.sin(tilt), 0, 0])
        remote.head = Pose(np.array([0.0, 1.5, 0.0]), turned)
        person = Person(program, remote)
        person.until(lambda line: line["focused"], "focused")
        assert person.line["layers"] == ["depth", "eyes"]
        cube = np.array(person.line["objects"]["cube"]["position"])
        over, under = np.add(cube, (0.1, 0.3, 0.0)), np.add(cube, (0.1, -0.3, 0.0))
        glove = []
        for place in (over, under):
            person.put("right", place)
            line = person.frames(2)
            palm = np.array(line["hands"]["right"]["grip"]["position"])
            person.frame()  # its picture is written
            column, row = pixel_of(eye_of(line, 0), palm)
            near = picture_of(pictures, line, "left")[row - 8 : row + 9, column - 8 : column + 9]
            glove.append((near.min(axis=2) > GLOVE).mean())
        assert glove[0] > 0.1 and glove[1] == 0, glove
        open_panel(person)
        assert person.frames(3)["layers"] == ["panel", "depth", "eyes"]
        assert program.interrupt() == INTERRUPTED, program.told()[-800:]
    assert program.end()["depth"] == "DEPTH_COMPONENT32F"
    assert not complaints(stand.folder)
    assert "Traceback" not in program.told()


@pytest.mark.parametrize("drawing", ["tiles", pytest.param("quads", marks=pytest.mark.slow)])
def test_the_runtime_has_the_depth_of_rays_through_ellipsoids(stand, drawing):
    """In metres of the room, though the world looks half as large."""
    told = stand.tell(PROGRAM, drawing)
    assert told["layers"] == ["depth", "eyes"] and told["format"] == "DEPTH_COMPONENT32F"
    for eye in told["eyes"]:
        assert eye["solid"] > 0.05 and 0.3 < eye["nearest_m"] < 3
        # As of the pictures of depth, in test_depth_pictures.
        assert eye["median"] < 1e-3 and eye["most"] < 0.01
        assert eye["open"] == 1.0  # far, where nothing is
