"""A scene in motion: hands and rays of a script, bodies of the physics, reactions, step by step.

`Simulation.step` reads as the order of one step.  It holds no clock and draws nothing; the same
file and script give the same records for ever.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from runtime_models.model import BadFile, Finding, Model
from scene.pose import Pose
from scene.reactions import Event, Fired, Machine, Standing, advance, start, steer
from scene.read_script import Act, HandPath
from scene.scene import Scene, SceneObject
from scene.scene_file import BACKGROUND, SceneFile, SceneItem, machine_of, scene_of

FLOOR_NAME = "floor"
SLACK_S = 1e-9  # a line at 0.1 s belongs to step 9 of 1/90 s, whatever rounding says
DECIMALS = 6  # of what is told: micrometres


@dataclass
class Moving:
    """One object on its way: where it stands and what its x does."""

    item: SceneItem
    body: int | None  # of the physics; None: nothing can touch it
    machine: Machine
    standing: Standing
    pose: Pose


@dataclass
class Record:
    """What happened in one step, in the words of the output."""

    step: int
    t: float
    poses: dict = field(default_factory=dict)  # name -> x, y, z, w, x, y, z of what has moved
    x: dict = field(default_factory=dict)  # name -> x of what has changed
    contacts: list = field(default_factory=list)  # pairs that begin to touch
    hands: list = field(default_factory=list)
    rays: list = field(default_factory=list)
    events: list = field(default_factory=list)  # reactions that were taken

    def row(self) -> dict:
        """Without what is empty."""
        return {name: value for name, value in vars(self).items() if value or name in ("step", "t")}

    @property
    def is_news(self) -> bool:
        return len(self.row()) > 2


class Simulation:
    """Steps a scene; `physics` is a scene.physics.Physics, which it fills and does not close."""

    def __init__(
        self,
        file: SceneFile,
        models: Mapping[str, Model],
        colliders: Mapping,  # name -> scene.collider.Collider, of what can be touched
        physics,
        acts: Sequence[Act] = (),
        hz: int = 90,
    ) -> None:
        self.physics, self.acts, self.hz = physics, list(acts), hz
        self.scene = scene_of(file, models)
        self.moving: dict[str, Moving] = {}
        self.findings: list[Finding] = []  # of the physics: clamped masses and the like
        for item in file.all_items:
            known = len(physics.findings)
            body = add_body(physics, item, colliders.get(item.name))
            name = f"object '{item.name}'"
            self.findings += [replace(new, file=name) for new in physics.findings[known:]]
            machine = machine_of(item, models[item.name])
            self.moving[item.name] = Moving(item, body, machine, start(machine, item.x), item.pose)
        self.names = {m.body: name for name, m in self.moving.items() if m.body is not None}
        self.hands = {act.hand: HandPath(acts, act.hand) for act in acts if act.do == "hand"}
        self.holds: dict[str, int] = {}  # hand -> grab of the physics
        self.told: dict[str, tuple] = {}  # (what, name) -> as it was told last
        self.impulses: dict[tuple[int, int], float] = {}  # N s of each pair in the step before
        self.steps = 0

    @property
    def time_s(self) -> float:
        return self.steps / self.hz

    def step(self) -> Record:
        """One step of 1/hz seconds."""
        record = Record(self.steps + 1, rounded((self.steps + 1) / self.hz))
        events: dict[str, list[Event]] = {name: [] for name in self.moving}
        while self.acts and self.acts[0].t <= self.time_s + SLACK_S:
            act = self.acts.pop(0)
            DO[act.do](self, act, record, events)
        for hand, hold in self.holds.items():
            self.physics.move_hand(hold, self.hands[hand].at((self.steps + 1) / self.hz))
        contacts = sorted(self.physics.step(), key=lambda contact: (contact.a, contact.b))
        self.steps += 1
        self.collide(contacts, record, events)
        for name, moving in self.moving.items():
            self.react(name, moving, record, events[name])
        return record

    def collide(self, contacts: list, record: Record, events: dict[str, list[Event]]) -> None:
        """Contacts to events of both sides; those that begin are told."""
        now = {}
        for contact in contacts:
            pair = (contact.a, contact.b)
            before = self.impulses.get(pair, 0.0)
            now[pair] = now.get(pair, 0.0) + contact.impulse_n_s
            names = [self.names.get(body, FLOOR_NAME) for body in pair]
            for name in names:
                if name in events:
                    events[name].append(Event("collision", float(now[pair]), float(before)))
            if pair not in self.impulses:
                impulse, point = rounded(contact.impulse_n_s), [rounded(n) for n in contact.point]
                record.contacts.append({"between": names, "impulse_n_s": impulse, "point": point})
        self.impulses = now

    def react(self, name: str, moving: Moving, record: Record, events: list[Event]) -> None:
        """The object's new pose and x; what has changed is told."""
        if moving.body is not None and not moving.item.static:
            moving.pose = self.physics.pose(moving.body)
        place = moving.pose.position
        moving.standing, fired = advance(
            moving.machine, moving.standing, self.time_s, events, place
        )
        record.events += [event_row(name, answer) for answer in fired]
        pose = tuple(rounded(n) for n in (*place, *moving.pose.wxyz))
        x = rounded(moving.standing.x)
        if self.told.get(("pose", name)) != pose:
            self.told["pose", name] = pose
            record.poses[name] = list(pose)
        if self.told.get(("x", name)) != x:
            self.told["x", name] = x
            record.x[name] = x

    def grab(self, act: Act, record: Record, events: dict[str, list[Event]]) -> None:
        pose = self.hands[act.hand].at(self.time_s)
        found = self.physics.nearest(pose.position, act.reach_m)
        name = self.names.get(found[0]) if found else None
        self.let_go(act.hand, "release", record)
        if name is None or self.moving[name].item.static:
            record.hands.append({"hand": act.hand, "did": "miss"})
            return
        self.holds[act.hand] = self.physics.grab(found[0], pose, pose.position)
        record.hands.append({"hand": act.hand, "did": "grab", "object": name})
        events[name].append(Event("grab"))

    def release(self, act: Act, record: Record, events: dict[str, list[Event]]) -> None:
        """Also of a hand that is lost: what it held goes on as it was moving."""
        self.let_go(act.hand, act.do, record)

    def let_go(self, hand: str, did: str, record: Record) -> None:
        if hand not in self.holds:
            return
        hold = self.holds.pop(hand)
        name = self.names.get(self.physics.held(hold))
        if did == "lose":
            self.physics.move_hand(hold, None)
        else:
            self.physics.release(hold)
        record.hands.append({"hand": hand, "did": did, "object": name})

    def ray(self, act: Act, record: Record, events: dict[str, list[Event]]) -> None:
        direction = np.array(act.direction) / np.linalg.norm(act.direction)
        found = self.physics.cast_ray(np.array(act.origin), direction)
        row: dict = {"origin": list(act.origin), "object": None}
        if found is not None:
            name = self.names.get(found[0], FLOOR_NAME)
            row |= {"object": name, "distance_m": rounded(found[1])}
            if name in events:
                events[name].append(Event("ray"))
        record.rays.append(row)

    def control(self, act: Act, record: Record, events: dict[str, list[Event]]) -> None:
        moving = self.moving[act.item]
        x = act.x if act.x is not None else moving.item.two_axes.x(act.balance, act.power)
        moving.standing = steer(moving.machine, moving.standing, x)

    def drawn(self) -> Scene:
        """The scene as it stands now, for the renderer."""
        return Scene(tuple(self.stood(thing) for thing in self.scene.objects))

    def stood(self, thing: SceneObject) -> SceneObject:
        moving = self.moving[thing.name]
        return replace(thing, world_from_object=moving.pose, x=moving.standing.x)


DO = {
    "hand": lambda simulation, act, record, events: None,  # HandPath knows the way
    "grab": Simulation.grab,
    "release": Simulation.release,
    "lose": Simulation.release,
    "ray": Simulation.ray,
    "control": Simulation.control,
}


def add_body(physics, item: SceneItem, collider) -> int | None:
    """The object's body: the background as a mesh, all else as convex pieces.  Raises BadFile."""
    if collider is None:
        return None
    mass = () if item.static else (item.mass_kg,)
    add = physics.add_static if item.static else physics.add_body
    shape = collider.mesh if item.name == BACKGROUND else collider.hulls
    try:
        return add(shape, item.pose, *mass, item.friction, item.restitution)
    except ValueError as error:
        raise BadFile(f"object '{item.name}': {error}") from None


def event_row(name: str, fired: Fired) -> dict:
    row = {"object": name, "on": fired.kind, "reaction": fired.reaction + 1}
    return row | {"from": fired.before, "to": fired.after, "x": rounded(fired.to_x)}


def rounded(number: float) -> float:
    """As it is told; never -0."""
    return round(float(number), DECIMALS) + 0.0
