"""What an eye of `launch.py vr` should see: the float64 reference at what a line says."""

from dataclasses import replace

import numpy as np

from shapeshift.app.document import DARK
from shapeshift.renderer.reference import reference_image
from shapeshift.scene.document.read_scene_file import read_scene_file
from shapeshift.scene.document.scene_file import read_models, scene_of
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene
from shapeshift.vr.play_space import PlaySpace
from tests.support.touch_scene import TOUCH as SCENE
from tests.support.xr.person import SIZE, pose_of

ROUNDING = 1 / 255  # of eight bits, and of six decimals in the lines
BEHIND = (0.0, 1.4, 1.5)  # where hands are not seen


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
