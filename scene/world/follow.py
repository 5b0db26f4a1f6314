"""Makes a living world match an edited scene file: what was not edited goes on as it was."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace

from shapeshift.runtime_models.model import Model
from shapeshift.scene.document.scene_file import (
    SceneFile,
    SceneItem,
    labelled,
    machine_of,
    object_of,
)
from shapeshift.scene.world.reactions import start
from shapeshift.scene.world.rigid_object import RigidObject
from shapeshift.scene.world.settle import is_still, let_down, shift_shape
from shapeshift.scene.world.world import World

BODY = (
    "model",
    "mode",
    "up",
    "flip",
    "collider",
    "static",
    "floats",
    "mass_kg",
    "friction",
    "restitution",
)
ANSWERS = ("states", "ring", "reactions")


def follow(world: World, file: SceneFile, models: Mapping[str, Model], colliders: Mapping) -> None:
    """Objects come, go, change and take another order or name as the file says.

    Only what differs from the item that the world knows is touched: a body that has fallen stays
    where it lies until its own pose is edited.  Raises BadFile, with the world half changed, for
    what `read_models` and the world would have refused.
    """
    wanted = {item.name: item for item in file.all_items}
    rename(world, wanted)
    for name in [name for name in world.objects if name not in wanted]:
        world.remove(name)
    exact: list[str] = []  # that get their exact body now
    for label, item in labelled(file):
        if item.name not in world.objects:
            world.add(item, models[item.name], colliders.get(item.name), label)
        else:
            exact += change(world, item, models[item.name], colliders.get(item.name))
        obj = world.objects[item.name]
        if obj.drawn.label != label:
            world.objects[item.name] = replace(obj, drawn=replace(obj.drawn, label=label))
    world.objects = {name: world.objects[name] for name in wanted}
    if exact:
        seat(world, exact)


def rename(world: World, wanted: Mapping[str, SceneItem]) -> None:
    """An object that is gone and one that is new, alike but for the name, are the same."""
    gone = [name for name in world.objects if name not in wanted]
    for item in [item for name, item in wanted.items() if name not in world.objects]:
        same = [n for n in gone if changed(world.objects[n].item, item) == {"name"}]
        if same:
            gone.remove(same[0])
            obj = world.objects.pop(same[0])
            drawn = replace(obj.drawn, name=item.name)
            world.objects[item.name] = replace(obj, item=item, drawn=drawn)
            if obj.body is not None:
                world.names[obj.body] = item.name


def change(world: World, item: SceneItem, model: Model, collider) -> list[str]:
    """One object becomes what its item says now; its name where it got another body meanwhile."""
    old = world.objects[item.name]
    new = changed(old.item, item)
    exact: list[str] = []
    if old.collider is not None and collider is not None and collider is not old.collider:
        if not new & set(BODY):
            other_pieces(world, old, model, collider)
            exact.append(item.name)
    if not new:
        return exact
    label = world.objects[item.name].drawn.label
    if new & set(BODY):
        stand_in(world, world.objects[item.name], item, model, collider)
    if new & {"selectors"}:
        drawn = object_of(item, world.objects[item.name].drawn.model, label)
        world.objects[item.name] = replace(world.objects[item.name], drawn=drawn)
    if new & set(ANSWERS):
        obj = world.objects[item.name]
        machine = machine_of(item, model)
        reaction_state = start(machine, obj.reaction_state.x)
        world.objects[item.name] = replace(obj, machine=machine, reaction_state=reaction_state)
    if new & {"position", "wxyz"}:
        world.move_object(item.name, item.pose)
    if "x" in new:
        world.control(item.name, item.x)
    if "visible" in new:
        world.show(item.name, item.visible)
    world.objects[item.name] = replace(world.objects[item.name], item=item)
    return exact


def seat(world: World, names: Sequence[str]) -> None:
    """Nothing that is at rest jumps when these objects get exact bodies: where a thing would lie
    on them its body lies now, and the thing stays where it is seen.

    What would move farther than a thing that is put down does falls, as it does in truth.
    """
    physics = world.physics
    ground = any(not world.objects[name].moves for name in names)  # then it is everything's
    still = [
        obj
        for name, obj in world.objects.items()
        if (ground or name in names) and obj.moves and is_still(physics, obj.body_id)
    ]
    if not still:
        return
    ends = let_down(physics)
    for obj in still:
        motion = ends.get(obj.body_id)
        if motion is not None and motion.is_put:
            shift_shape(physics, obj.body_id, motion.pose)


def stand_in(world: World, old: RigidObject, item: SceneItem, model: Model, collider) -> None:
    """Another body and model for an object, where it stands now and at its x of now."""
    world.remove(item.name)
    world.add(item, model, collider, old.drawn.label)
    world.move_object(item.name, old.pose)
    world.control(item.name, old.reaction_state.x)


def other_pieces(world: World, old: RigidObject, model: Model, collider) -> None:
    """Exact pieces in the place of a rough hull, on their way as it was."""
    speeds = world.physics.velocity(old.body_id) if old.moves else None
    stand_in(world, old, old.item, model, collider)
    new = world.objects[old.item.name]
    if speeds is not None and new.body is not None:
        world.physics.set_velocity(new.body, *speeds)
    world.objects[old.item.name] = replace(new, reaction_state=old.reaction_state)


def changed(before: SceneItem, after: SceneItem) -> set[str]:
    """Names of the fields that differ; selectors and the like count as others unless the same."""
    if before is after:
        return set()
    names = set()
    for field in fields(SceneItem):
        a, b = getattr(before, field.name), getattr(after, field.name)
        plain = field.name not in ("selectors", "reactions")  # whose weights have no one truth
        if not (a is b or (plain and a == b) or (not plain and not a and not b)):
            names.add(field.name)
    return names


def reset_objects(world: World) -> None:
    """Everything where its item says, at rest, at its first x; hands are empty."""
    for hand in list(world.holds):
        world.release(hand)
    for name, obj in world.objects.items():
        world.move_object(name, obj.item.pose)
        fresh = start(obj.machine, obj.item.x)
        world.objects[name] = replace(world.objects[name], reaction_state=fresh)
        if obj.moves and obj.item.floats:
            world.physics.float_body(obj.body_id)
    world.impulses = {}
