"""Objects of the scene that is shown: as opened, as the world has them, in a palette."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shapeshift.app.document import DARK
from shapeshift.app.editor.state.files.edited_file import first_stop
from shapeshift.app.editor.state.files.opened import Source
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import Model
from shapeshift.scene.appearance import Sky, behind_of
from shapeshift.scene.cameras.framing import default_background
from shapeshift.scene.document.edits import free_name
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import IDENTITY, Scene, SceneObject


def scene_of(sources: Sequence[Source], x: float | None = None) -> Scene:
    """The scene of what has been opened: each at x or its first stop, in the first one's place."""
    objects: list[SceneObject] = []
    for source in sources:
        path, model = source.path, source.model
        moved = origin_of(model) - origin_of(sources[0].model)
        pose = Pose(moved, IDENTITY.wxyz) if moved.any() else IDENTITY
        start = first_stop(model).x if x is None else x
        name = path.name if path.is_dir() else path.stem
        name = free_name({obj.name for obj in objects}, name)
        objects.append(SceneObject(name, model, pose, x=start))
    return Scene(tuple(objects))


def stood_as(obj: SceneObject, other: SceneObject | None) -> SceneObject:
    """The object where another of its name is; the very same where nothing differs."""
    if other is None:
        return obj
    here, there = obj.world_from_object, other.world_from_object
    same = (*here.position, *here.wxyz) == (*there.position, *there.wxyz)
    if same and obj.x == other.x:
        return obj
    return replace(obj, world_from_object=there, x=other.x)


def with_background(settings: RenderSettings, sky: Sky | None, scene: Scene) -> RenderSettings:
    """The settings with a file's sky behind everything, else what its first model was trained
    before.
    """
    behind = behind_of(sky) or settings.background
    if sky is None and scene.objects:
        behind = default_background(scene.objects[0].model, DARK)
    return replace(settings, background=behind)


def origin_of(model: Model) -> np.ndarray:
    """(3,) metres that were taken off a model's places."""
    return np.array(getattr(model, "origin", (0.0, 0.0, 0.0)), np.float64)


def with_palette(model: Model, name: str) -> Model:
    """The model with another palette on those value stops that have one."""
    stops = [replace(stop, palette=name) if stop.palette else stop for stop in model.stops]
    return replace(model, stops=tuple(stops))
