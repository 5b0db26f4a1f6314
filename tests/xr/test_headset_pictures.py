"""What either eye sees in `launch.py vr`: the scene as the float64 reference draws it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app.document import DARK
from shapeshift.renderer.reference.reference import reference_image
from shapeshift.scene.document.read_scene_file import read_scene_file
from shapeshift.scene.document.scene_file import read_models, scene_of
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import Scene
from shapeshift.vr.frame import SIDES
from shapeshift.vr.locomotion.play_space import PlaySpace
from tests.support.xr.person import SIZE, pixel_of

SCENE = Path(__file__).resolve().parents[2] / "assets" / "touch.scene.json"
ROUNDING = 1 / 255  # of eight bits, and of six decimals in the lines
BEHIND = (0.0, 1.4, 1.5)  # where hands are not seen


def pose_of(row: dict) -> Pose:
    return Pose(np.array(row["position"]), np.array(row["wxyz"]))


def eyes_of(line: dict) -> list[View]:
    """Both eyes in the world."""
    play_space = PlaySpace(pose_of(line["standing"]), line["standing"]["scale"])
    return [
        play_space.view(View(pose_of(row), tuple(row["tangents"]), 0.05, 1000.0, SIZE))
        for row in line["views"]
    ]


def scene_at(line: dict) -> Scene:
    """The scene with every object where the line says, at its x."""
    file = read_scene_file(SCENE)
    scene = scene_of(*read_models(file))
    objects = [
        replace(
            obj,
            world_from_object=pose_of(line["objects"][obj.name]),
            x=line["objects"][obj.name]["x"],
        )
        for obj in scene.objects
    ]
    return replace(scene, objects=tuple(objects))


def drawn(scene: Scene, view: View) -> np.ndarray:
    """(H, W, 3) over the background."""
    image = reference_image(scene, view)
    return np.clip(image[..., :3] + (1 - image[..., 3:]) * DARK, 0, 1)


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
