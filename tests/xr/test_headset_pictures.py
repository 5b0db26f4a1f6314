"""What either eye sees in `launch.py vr`: the scene as the float64 reference draws it."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import SIDES
from tests.support.xr.person import pixel_of
from tests.support.xr.reference_eyes import BEHIND, ROUNDING, drawn, eyes_of, scene_at


@pytest.fixture
def seen(stand, start) -> tuple[dict, list[np.ndarray]]:
    """A frame's line and the pictures of both eyes, (H, W, 3) 0..1, from near the cube."""
    pictures = stand.folder / "pictures"
    asked = ("--frames", "12", "--quality", "best", "--no-floor", "--no-hints")
    program = start(stand, *asked, "--pictures", str(pictures))
    with program.headset(stand.port) as remote:
        tilt = 0.35  # half of the angle, downwards
        remote.head = Pose(
            np.array([-0.2, 1.2, -0.2]), np.array([np.cos(tilt), -np.sin(tilt), 0, 0])
        )
        remote.left.position = remote.right.position = BEHIND
        remote.send()
        report = program.end()
    assert report["code"] == 0, program.told()
    line = [line for line in program.lines if line["drawn"]][-1]
    names = [pictures / f"{side}-{line['frame']:05d}.png" for side in SIDES]
    return line, [np.asarray(Image.open(name))[..., :3] / 255 for name in names]


def test_both_eyes_see_the_scene_as_the_reference_draws_it(seen):
    line, pictures = seen
    eyes = eyes_of(line)
    scene = scene_at(line)
    empty = replace(scene, objects=tuple(o for o in scene.objects if o.name != "cube"))
    cube = np.array(line["objects"]["cube"]["position"])
    columns = []
    for eye, picture in zip(eyes, pictures, strict=True):
        wanted = drawn(scene, eye)
        assert np.abs(picture - wanted).max() < 1.5 * ROUNDING
        column, row = pixel_of(eye, cube)
        columns.append(column)
        without = drawn(empty, eye)[row, column]
        assert np.abs(picture[row, column] - without).max() > 20 * ROUNDING, "no cube there"
    # What is before both eyes lies farther left in the right one, whose frustum leans to the right.
    assert columns[1] < columns[0] - 20
