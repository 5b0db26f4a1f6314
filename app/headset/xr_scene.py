"""Opens what is to be seen in a headset as a world of objects: a scene file, or one scene alone."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.app.opening import PATIENCE_S, ReadingOptions, open_model, progress_after, sentence
from shapeshift.app.scene_files import open_scene_file
from shapeshift.app.subject import control_of_text, file_at, pace_of
from shapeshift.app.terminal import say
from shapeshift.runtime_models.model import Model
from shapeshift.scene.cameras.framing import (
    default_background,
    default_view,
    frame_points,
    scene_points,
)
from shapeshift.scene.colliders.collider_files import colliders_of
from shapeshift.scene.document.scene_file import SceneFile, SceneItem, first_view, is_scene_file
from shapeshift.scene.pose import Pose
from shapeshift.scene.world.world import World

HZ = 90  # steps of the physics a second
BACKGROUND = (0.075, 0.078, 0.085)  # display sRGB, behind objects: as in the window
ANY_SIZE = (640, 360)  # of a view that only says where to stand


@dataclass(frozen=True)
class XrScene:
    """A world, and from where it is looked at first."""

    world: World
    models: dict[str, Model]
    eye: Pose  # world_from_eye
    floor_y: float | None  # metres, world; None: the scene says nothing about a floor
    background: tuple[float, float, float]

    @property
    def centre(self) -> np.ndarray:
        """(3,) metres: the middle of what there is now."""
        return frame_points(*scene_points(self.world.drawn()))[0]


def open_xr(path: Path, options: ReadingOptions, x: str = "") -> XrScene:
    """Reads the scene with progress and findings on stderr.

    x: where the sliders stand, in words; "": as the scene says.  Raises BadFile, UsageError.
    """
    if not is_scene_file(path):
        return open_alone(path, options, x)
    file, models, scene = open_scene_file(path, options)
    file = file_at(file, models, x) if x else file
    with progress_after(PATIENCE_S) as told:
        colliders = colliders_of(file, models, told)
    world = World(file, models, colliders, hz=HZ)
    for finding in world.findings:
        say(sentence(finding))
    eye = first_view(file, scene, ANY_SIZE).world_from_eye
    return XrScene(world, models, eye, file.floor_y, BACKGROUND)


def open_alone(path: Path, options: ReadingOptions, x: str = "") -> XrScene:
    """One model that nothing can touch, where its file has it."""
    model = open_model(path, options)
    first = min((stop.x for stop in model.stops), default=0.0)
    start = control_of_text(x, model.stops, pace=pace_of(model)) if x else first
    item = SceneItem(name=path.stem or path.name, model=str(path), x=start, static=True)
    file = SceneFile(folder=Path(), items=(item,), gravity_m_s2=0.0)
    world = World(file, {item.name: model}, {}, hz=HZ)
    eye = default_view(model, ANY_SIZE).world_from_eye
    background = default_background(model, BACKGROUND)
    return XrScene(world, {item.name: model}, eye, None, background)
