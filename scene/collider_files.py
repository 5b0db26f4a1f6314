"""The colliders that a scene file asks for: from mesh files or from the splats."""

from collections.abc import Mapping

from runtime_models.model import BadFile, Model
from scene.collider import Collider, Making, Told, collider_of_mesh, collider_of_model
from scene.scene_file import HULLS, SceneFile, SceneItem


def colliders_of(
    file: SceneFile, models: Mapping[str, Model], told: Told | None = None
) -> dict[str, Collider]:
    """The collider of each object that has one, by its name; kept beside the scene once made.

    Raises BadFile that names the object.
    """
    making, made, out = Making(beside=file.folder, told=told), {}, {}
    for item in file.all_items:
        if item.collider is not None:
            key = (item.collider, id(models[item.name]), item.x if item.collider == HULLS else 0)
            if key not in made:
                made[key] = one_collider(file, item, models[item.name], making)
            out[item.name] = made[key]
    return out


def one_collider(file: SceneFile, item: SceneItem, model: Model, making: Making) -> Collider:
    try:
        if item.collider == HULLS:
            return collider_of_model(model, item.x, making)
        return collider_of_mesh(file.path(item.collider), making)
    except BadFile as error:
        raise BadFile(f"object '{item.name}': 'collider': {error}") from None
