"""One object of a world: what the file says of it, where it stands now, and how it is drawn."""

from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.model import BadFile, Model
from shapeshift.scene.colliders.collider import Collider
from shapeshift.scene.document.scene_file import BACKGROUND, SceneItem, machine_of, object_of
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import SceneObject
from shapeshift.scene.world.reactions import Machine, ReactionState, start
from shapeshift.scene.world.read_script import between

LEADS, FOLLOWS = 6, 18  # steps in which an object that is taken, or let go, changes its lead


@dataclass(frozen=True)
class RigidObject:
    """An object on its way: where it stands and what its x does."""

    item: SceneItem
    body: int | None  # of the physics; None: nothing can touch it
    machine: Machine
    reaction_state: ReactionState
    pose: Pose
    before: Pose  # at the step before, for pictures between two steps
    drawn: SceneObject  # as it was drawn last
    collider: Collider | None = None
    lead: float = 0.0  # of a step: drawn so much ahead of others, 1 in a hand, that it cannot lag

    @property
    def body_id(self) -> int:
        """The body, of an object that has one."""
        assert self.body is not None, f"'{self.item.name}' has a body"
        return self.body

    @property
    def moves(self) -> bool:
        """Whether the physics moves it and a hand can hold it."""
        return self.body is not None and not self.item.static

    @property
    def waits(self) -> bool:
        """Whether a step in which nothing happens to it leaves it as it is."""
        return self.reaction_state.motion is None and self.before is self.pose and self.lead == 0


def new_rigid_object(item: SceneItem, model: Model, collider, label: int, physics) -> RigidObject:
    """The object where the file puts it, its body in the physics.  Raises BadFile."""
    drawn, machine = object_of(item, model, label), machine_of(item, model)
    body = add_body(physics, item, collider)
    pose, reaction_state = item.pose, start(machine, item.x)
    return RigidObject(item, body, machine, reaction_state, pose, pose, drawn, collider)


def add_body(physics, item: SceneItem, collider) -> int | None:
    """The object's body: the background as a mesh, all else as convex pieces.  Raises BadFile."""
    if collider is None:
        return None
    mass = () if item.static else (item.mass_kg,)
    add = physics.add_static if item.static else physics.add_body
    shape = collider.mesh if item.name == BACKGROUND else collider.parts
    try:
        number = add(shape, item.pose, *mass, item.friction, item.restitution)
        if item.floats and not item.static:
            physics.float_body(number)
        return number
    except ValueError as error:
        raise BadFile(f"object '{item.name}': {error}") from None


def after_step(
    obj: RigidObject, pose: Pose, reaction_state: ReactionState, held: bool
) -> RigidObject:
    """Where it stands now; what is taken gets ahead in LEADS steps, let go it falls back slowly."""
    lead = obj.lead + (1 / LEADS if held else -1 / FOLLOWS)
    return replace(
        obj,
        reaction_state=reaction_state,
        pose=pose,
        before=obj.pose,
        lead=min(max(lead, 0.0), 1.0),
    )


def drawn_object(obj: RigidObject, part: float | None) -> RigidObject:
    """With what is drawn at a part 0..1 of the way from the step before to this one; None: now.

    The same object, and the same SceneObject in it, where that is what was drawn last.
    """
    if part is None or obj.before is obj.pose:
        pose = obj.pose
    else:
        pose = between(obj.before, obj.pose, part + obj.lead)
    drawn, x = obj.drawn, obj.reaction_state.x
    if drawn.x == x and same_pose(drawn.world_from_object, pose):
        return obj
    return replace(obj, drawn=replace(drawn, world_from_object=pose, x=x))


def middle_of(obj: RigidObject) -> np.ndarray:
    """(3,) metres, world: of the box around what can be touched of it."""
    assert obj.collider is not None, "asked of what can be touched"
    corners = np.concatenate(obj.collider.parts)
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    return (obj.pose.matrix() @ np.append(middle, 1.0))[:3]


def same_pose(a: Pose, b: Pose) -> bool:
    """To the last bit."""
    return a is b or (
        a.position.tobytes() == b.position.tobytes() and a.wxyz.tobytes() == b.wxyz.tobytes()
    )
