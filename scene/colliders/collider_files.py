"""The colliders that a scene file asks for: from mesh files or from the splats."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.model import BadFile, Model
from shapeshift.scene.colliders.collider import (
    Collider,
    Making,
    Progress,
    collider_of_mesh,
    collider_of_model,
)
from shapeshift.scene.colliders.quick_ground import mended
from shapeshift.scene.colliders.standing import Plane
from shapeshift.scene.document.scene_file import BACKGROUND, HULLS, SceneFile, SceneItem

BACKGROUND_FACES = 10_000  # it stays where it is: the physics looks only at those near a body


def colliders_of(
    file: SceneFile,
    models: Mapping[str, Model],
    progress: Progress | None = None,
    rough: bool = False,
) -> dict[str, Collider]:
    """The collider of each object that has one, by its name; kept in the user's cache.

    rough: one hull where no pieces were made before.  Raises BadFile that names the object.
    """
    making = Making(progress=progress, rough=rough)
    made: dict[tuple, Collider] = {}
    out: dict[str, Collider] = {}
    for item in file.all_items:
        if item.collider is not None:
            key = collider_key(item, models[item.name])
            if key not in made:
                made[key] = one_collider(file, item, models[item.name], making)
            out[item.name] = made[key]
    return out


def collider_key(item: SceneItem, model: Model) -> tuple:
    """Equal of items that have one collider: of one model at one x, or one mesh file."""
    made_of = (id(model), item.x) if item.collider == HULLS else ()
    return (item.collider, item.name == BACKGROUND, *made_of)


def one_collider(
    file: SceneFile, item: SceneItem, model: Model, making: Making,
    stood_on: Sequence[tuple[np.ndarray, Plane]] = (),
) -> Collider:  # fmt: skip
    """The object's collider; the background's is a mesh of more faces that leaves rooms open.

    stood_on: corners (V, 3) metres, world, of things that stand on it, and the plane of each.
    """
    if item.name == BACKGROUND:
        making = replace(making, hollow=True, faces=BACKGROUND_FACES)
    try:
        if item.collider == HULLS:
            mend = (lambda columns: mended(columns, item.pose, stood_on)) if stood_on else None
            return collider_of_model(model, item.x, making, mend=mend)
        assert item.collider is not None, "asked of items that have one"
        return collider_of_mesh(file.path(item.collider), making)
    except BadFile as error:
        raise BadFile(f"object '{item.name}': 'collider': {error}") from None
