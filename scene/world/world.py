"""A scene that can be touched: the live core that a script, a mouse and a headset share.

Hands are named and have a pose; they grab, carry and let go.  Rays act.  Bodies move as the
physics says, x as the reactions say.  `World.step` reads as the order of one step.  It holds no
clock and draws nothing: the same calls in the same order give the same records for ever.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.runtime_models.files.json_fields import control_row
from shapeshift.runtime_models.model import Finding, Model
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.document.scene_file import (
    SceneFile,
    SceneItem,
    labelled,
    with_own_appearance,
)
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Scene
from shapeshift.scene.world.grab import jumped
from shapeshift.scene.world.reactions import Event, advance, steer
from shapeshift.scene.world.read_script import between
from shapeshift.scene.world.record import DECIMALS, Record, event_row, rounded
from shapeshift.scene.world.rigid_object import (
    RigidObject,
    after_step,
    drawn_object,
    new_rigid_object,
    same_pose,
)

if TYPE_CHECKING:
    from shapeshift.scene.world.physics import Physics

FLOOR_NAME = "floor"
REACH_M = 0.05  # from a hand to what it grabs
MOST_STEPS = 8  # made up for at once, after a frame that took long; the rest of the time is lost
SLACK = 1e-6  # of a step: sixty frames of 1/60 s are ninety steps, whatever rounding says


@dataclass(frozen=True)
class RayHit:
    """What a ray meets first."""

    object: str  # its name, or FLOOR_NAME
    distance_m: float
    point: np.ndarray  # (3,) metres, world


@dataclass(frozen=True)
class Saved:
    """A world at one moment, whole: for undo, and for a reset after play."""

    physics: bytes
    objects: dict
    hands: dict
    holds: dict
    impulses: dict
    steps: int


class World:
    """Objects, bodies, hands and reactions of a scene file, stepped by 1/hz seconds.

    `colliders` are of what can be touched, by name; `physics` is an empty scene.physics.Physics
    of the same hz, one of the file's gravity and floor if not given.  Raises BadFile for an object
    whose body the physics refuses; methods raise ValueError for names that there are not.
    """

    def __init__(
        self,
        file: SceneFile,
        models: Mapping[str, Model],
        colliders: Mapping,
        physics: "Physics | None" = None,
        hz: int = 90,
    ) -> None:
        from shapeshift.scene.world.physics import Physics

        self.hz, self.paused = hz, False
        self.physics = physics or Physics(file.gravity_m_s2, file.floor_y, hz)
        self.findings: list[Finding] = []  # of the physics: clamped masses and the like
        self.objects: dict[str, RigidObject] = {}
        self.names: dict[int, str] = {}  # of bodies
        self.hands: dict[str, Pose] = {}  # where each shall be after the next step
        self.holds: dict[str, int] = {}  # hand -> grab of the physics
        self.impulses: dict[tuple[int, int], float] = {}  # N s of each pair in the step before
        self.steps = 0
        self._recorded: dict[tuple, object] = {}  # (what, name) -> as it was recorded last
        self._stirred: set[str] = set()  # came, were placed or controlled since the last step
        self._events: dict[str, list[Event]] = {}  # of hands and rays since the last step
        self._hand_rows: list[dict] = []
        self._ray_rows: list[dict] = []
        self._hands_before: dict[str, Pose] = {}  # at the end of the last `advance`
        self._behind_s = 0.0  # time that has passed and is no whole step yet
        self._part: float | None = None  # of the way from the step before to this one, in what is
        # drawn; None: this one as it is
        self._drawn = Scene(())
        for label, item in labelled(with_own_appearance(file)):
            self.add(item, models[item.name], colliders.get(item.name), label)

    # ---- what there is

    def object_named(self, name: str) -> RigidObject:
        if name not in self.objects:
            raise ValueError(f"there is no object '{name}'; there are {', '.join(self.objects)}.")
        return self.objects[name]

    def add(self, item: SceneItem, model: Model, collider=None, label: int | None = None) -> None:
        """One more object, last in the order; the next label that is free if none is given."""
        if item.name in self.objects:
            raise ValueError(f"there is an object '{item.name}'; each wants a name of its own.")
        if label is None:
            label = max((obj.drawn.label for obj in self.objects.values()), default=0) + 1
        known = len(self.physics.findings)
        obj = new_rigid_object(item, model, collider, label, self.physics)
        of = f"object '{item.name}'"
        self.findings += [replace(new, file=of) for new in self.physics.findings[known:]]
        self.objects[item.name] = obj
        self._stirred.add(item.name)
        if obj.body is not None:
            self.names[obj.body] = item.name

    def remove(self, name: str) -> None:
        """Takes an object out; hands that held it are empty, and what lay on it falls."""
        obj = self.object_named(name)
        for hand in [hand for hand in self.holds if self.held(hand) == name]:
            self._release_hand(hand, "release")
        if obj.body is not None:
            self.physics.remove(obj.body)
            del self.names[obj.body]
        del self.objects[name]
        self._events.pop(name, None)
        self._recorded.pop(("pose", name), None)
        self._recorded.pop(("x", name), None)

    def move_object(self, name: str, pose: Pose) -> None:
        """Puts an object somewhere else, at rest."""
        obj = self.object_named(name)
        if obj.body is not None:
            self.physics.set_pose(obj.body, pose)
        self.objects[name] = replace(obj, pose=pose, before=pose)
        self._stirred.add(name)

    def control(self, name: str, x: Control) -> None:
        """Puts an object's x there at once; no reaction under way goes on."""
        obj = self.object_named(name)
        self.objects[name] = replace(obj, reaction_state=steer(obj.machine, obj.reaction_state, x))
        self._stirred.add(name)

    def show(self, name: str, visible: bool) -> None:
        """Draws an object or does not; a hidden one is touched as before."""
        obj = self.object_named(name)
        self.objects[name] = replace(obj, drawn=replace(obj.drawn, visible=visible))

    # ---- hands

    def move_hand(self, name: str, pose: Pose | None) -> None:
        """Where a hand shall be after the next step; None: it is lost, and lets go."""
        if pose is None:
            self._release_hand(name, "lose")
            self.hands.pop(name, None)
            self._hands_before.pop(name, None)
            return
        self.hands[name] = pose
        if name in self.holds:
            self.physics.move_hand(self.holds[name], pose)

    def grab(self, name: str, reach_m: float = REACH_M) -> str | None:
        """A hand takes the nearest body within reach, the object's name; None = it missed.

        What it held before it lets go.  A hand that is nowhere misses.
        """
        if name not in self.hands:
            return None
        at = self.hands[name].position
        found = self.nearest(at, reach_m)
        return self._grab_object(name, found[0] if found else None, at)

    def grab_body(self, name: str, object_name: str, point: np.ndarray) -> str | None:
        """A hand takes that object at a point (3,) of the world; None where it cannot be held."""
        obj = self.objects.get(object_name)
        held = object_name if obj is not None and obj.moves and name in self.hands else None
        return self._grab_object(name, held, point)

    def _grab_object(self, hand: str, name: str | None, point: np.ndarray) -> str | None:
        self._release_hand(hand, "release")
        if name is None:
            self._hand_rows.append({"hand": hand, "did": "miss"})
            return None
        pose = self.hands[hand]
        self.holds[hand] = self.physics.grab(self.objects[name].body_id, pose, point)
        self._hands_before[hand] = pose
        self._hand_rows.append({"hand": hand, "did": "grab", "object": name})
        self._events.setdefault(name, []).append(Event("grab"))
        return name

    def release(self, name: str) -> None:
        """A hand lets go, and what it held flies on with its speed; one that is empty stays so."""
        self._release_hand(name, "release")

    def _release_hand(self, hand: str, did: str) -> None:
        if hand not in self.holds:
            return
        name = self.held(hand)
        hold = self.holds.pop(hand)
        if did == "lose":
            self.physics.move_hand(hold, None)
        else:
            self.physics.release(hold)
        self._hand_rows.append({"hand": hand, "did": did, "object": name})

    def carry(self, name: str, moved: np.ndarray) -> None:
        """What a hand holds jumps by a rigid (4, 4) of the world, as in a snap turn, and the hand.

        Velocities jump too, so that nothing is flung; other hands on the same body come along.  An
        empty hand stays where it is.
        """
        held = self.held(name)
        if held is None:
            return
        self.physics.carry(self.holds[name], moved)
        for hand in [hand for hand in self.holds if self.held(hand) == held]:
            self.hands[hand] = jumped(self.hands[hand], moved)
            self._hands_before[hand] = jumped(self._hands_before[hand], moved)
        pose = self.physics.pose(self.objects[held].body_id)
        self.objects[held] = replace(self.objects[held], pose=pose, before=pose)

    def held(self, name: str) -> str | None:
        """What a hand holds."""
        body = self.physics.held(self.holds[name]) if name in self.holds else None
        return None if body is None else self.names.get(body)

    def nearest(self, point: np.ndarray, within: float) -> tuple[str, float] | None:
        """The object that a hand at a point (3,) would take, and how far that is in metres."""
        if (found := self.physics.nearest(point, within)) is None:
            return None
        name = self.names.get(found[0])
        return (name, found[1]) if name is not None and self.objects[name].moves else None

    # ---- rays

    def aim(self, origin: np.ndarray, direction: np.ndarray) -> RayHit | None:
        """What a ray meets first, from (3,) metres along (3,); nothing happens to it."""
        start = np.asarray(origin, np.float64)
        unit = np.asarray(direction, np.float64) / np.linalg.norm(direction)
        found = self.physics.cast_ray(start, unit)
        if found is None:
            return None
        name = self.names.get(found[0], FLOOR_NAME)
        return RayHit(name, found[1], start + found[1] * unit)

    def ray(self, origin: np.ndarray, direction: np.ndarray) -> RayHit | None:
        """The same, and what it meets answers in the next step."""
        hit = self.aim(origin, direction)
        row: dict = {"origin": [float(n) for n in origin], "object": None}
        if hit is not None:
            row |= {"object": hit.object, "distance_m": rounded(hit.distance_m)}
            if hit.object in self.objects:
                self._events.setdefault(hit.object, []).append(Event("ray"))
        self._ray_rows.append(row)
        return hit

    # ---- time

    @property
    def time_s(self) -> float:
        return self.steps / self.hz

    @property
    def resting(self) -> bool:
        """Whether another step would change nothing: all bodies sleep, no hand holds, no x goes."""
        if self.holds or self._events:
            return False
        return all(
            obj.reaction_state.motion is None
            and same_pose(obj.before, obj.pose)
            and (not obj.moves or self.physics.sleeps(obj.body_id))
            for obj in self.objects.values()
        )

    def step(self) -> Record:
        """One step of 1/hz seconds, whether paused or not."""
        record = Record(self.steps + 1, rounded((self.steps + 1) / self.hz))
        record.hands, self._hand_rows = self._hand_rows, []
        record.rays, self._ray_rows = self._ray_rows, []
        events, self._events = self._events, {}
        contacts = sorted(self.physics.step(), key=lambda contact: (contact.a, contact.b))
        self.steps += 1
        self._part = None
        self._collide(contacts, record, events)
        held = {self.held(hand) for hand in self.holds}
        for name in self.objects:
            self._react(name, record, events.get(name, []), name in held)
        self._stirred.clear()
        return record

    def advance(self, seconds: float) -> list[Record]:
        """Lets time pass: as many steps as are due, at most MOST_STEPS; none while paused.

        A hand goes evenly from where it was at the last call to where it is now, so that what it
        throws has its speed however frames and steps fall.
        """
        if self.paused:
            self._hands_before = dict(self.hands)  # a hand that moves meanwhile has no speed
            return []
        if not seconds > 0:
            return []
        seconds = min(seconds, MOST_STEPS / self.hz)
        late = self._behind_s
        count = math.floor((late + seconds) * self.hz + SLACK)
        self._behind_s = max(late + seconds - count / self.hz, 0.0)
        records = []
        for number in range(1, count + 1):
            part = min((number / self.hz - late) / seconds, 1.0)
            for hand, hold in self.holds.items():
                goal = self.hands[hand]
                way = between(self._hands_before.get(hand, goal), goal, part)
                self.physics.move_hand(hold, way)
            records.append(self.step())
        self._hands_before = dict(self.hands)
        self._part = min(self._behind_s * self.hz, 1.0)
        return records

    def _collide(self, contacts: list, record: Record, events: dict[str, list[Event]]) -> None:
        """Contacts to events of both sides; those that begin are recorded."""
        now: dict = {}
        for contact in contacts:
            pair = (contact.a, contact.b)
            before = self.impulses.get(pair, 0.0)
            now[pair] = now.get(pair, 0.0) + contact.impulse_n_s
            names = [self.names.get(body, FLOOR_NAME) for body in pair]
            for name in names:
                if name in self.objects:
                    event = Event("collision", float(now[pair]), float(before))
                    events.setdefault(name, []).append(event)
            if pair not in self.impulses:
                impulse, point = rounded(contact.impulse_n_s), [rounded(n) for n in contact.point]
                record.contacts.append({"between": names, "impulse_n_s": impulse, "point": point})
        self.impulses = now

    def _react(self, name: str, record: Record, events: list[Event], held: bool) -> None:
        """The object's new pose and x; what has changed is recorded."""
        obj = self.objects[name]
        pose = self.physics.pose(obj.body_id) if obj.moves else obj.pose
        still = same_pose(pose, obj.pose)
        if still and not events and obj.waits and name not in self._stirred:
            return
        reaction_state, fired = advance(
            obj.machine, obj.reaction_state, self.time_s, events, pose.position
        )
        self.objects[name] = after_step(obj, obj.pose if still else pose, reaction_state, held)
        record.events += [event_row(name, answer) for answer in fired]
        row = tuple(rounded(n) for n in (*pose.position, *pose.wxyz))
        x = control_row(reaction_state.x, DECIMALS)
        if self._recorded.get(("pose", name)) != row:
            self._recorded["pose", name] = row
            record.poses[name] = list(row)
        if self._recorded.get(("x", name)) != x:
            self._recorded["x", name] = x
            record.x[name] = x

    # ---- what is seen of it

    def drawn(self) -> Scene:
        """The scene as it stands now, for the renderer; the same object until something changes.

        After `advance` what is free is drawn up to a step late, between two steps, and what a hand
        holds where it will be, so that it does not lag behind the hand.
        """
        self.objects = {name: drawn_object(t, self._part) for name, t in self.objects.items()}
        objects = tuple(obj.drawn for obj in self.objects.values())
        if list(map(id, objects)) != list(map(id, self._drawn.objects)):
            self._drawn = Scene(objects)
        return self._drawn

    # ---- all of it

    def snapshot(self) -> Saved:
        """The world as it is, the physics to the last bit."""
        return Saved(
            self.physics.snapshot(), dict(self.objects), dict(self.hands), dict(self.holds),
            dict(self.impulses), self.steps,
        )  # fmt: skip

    def restore(self, saved: Saved) -> None:
        """Back to a snapshot of this world; what was added since is gone, what was removed back."""
        self.physics.restore(saved.physics)
        self.objects, self.hands = dict(saved.objects), dict(saved.hands)
        self.holds, self.impulses, self.steps = dict(saved.holds), dict(saved.impulses), saved.steps
        self.names = {t.body: name for name, t in self.objects.items() if t.body is not None}
        self._events, self._hand_rows, self._ray_rows, self._recorded = {}, [], [], {}
        self._stirred = set(self.objects)
        self._hands_before, self._behind_s, self._part = dict(saved.hands), 0.0, None
