"""How objects fall, rest, collide and are held: the one class behind which the engine hides.

The engine is Rapier (Apache-2.0, pinned).  World metres, +Y up.  It computes in float32.  The same
calls in the same order give the same bits, in every process on one kind of machine.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from shapeshift.runtime_models.model import Finding
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh
from shapeshift.scene.pose import Pose
from shapeshift.scene.world import physics_shapes
from shapeshift.scene.world.contacts import (
    Contact,
    ContactTally,
    any_near,
    hash_of,
    pack,
    unpack,
    velocities,
)
from shapeshift.scene.world.grab import (
    WITH_HAND,
    Hold,
    attach_hand,
    carry,
    hold_from_json,
    hold_to_json,
    lag,
    move_hands,
    throw,
)
from shapeshift.scene.world.physics_shapes import (
    LEAST_EXTENT,
    MOST_FRICTION,
    checked_number,
    checked_point,
    checked_pose,
    clamped_mass,
    compound_shape,
    isometry,
    mesh_shape,
    pose_of,
)

FLOOR = 0  # the id of the floor; every other id counts from 1
MOST_REACH = 2e4  # metres along a ray


class Physics:
    """A world of static objects and bodies, stepped by 1 / hz seconds.

    Bad input is refused with a ValueError before it reaches the engine.  What was changed on the
    way in (a mass out of range) is named in `findings`.  Raises BadFile where there is no engine.
    """

    def __init__(
        self,
        gravity_m_s2: float = 9.81,
        floor_y: float | None = None,
        hz: float = 90,
        substeps: int = 4,
    ) -> None:
        rapier = physics_shapes.engine()
        gravity = checked_number(gravity_m_s2, "the gravity in m/s2", -100, 100)
        self.hz = checked_number(hz, "the steps a second", 10, 1000)
        self.substeps = int(checked_number(substeps, "the substeps of a step", 1, 64))
        self.findings: list[Finding] = []
        self._handles: dict[int, Any] = {}  # id: the engine's handle of a rigid body
        self.ids_by_collider: dict[Any, int] = {}  # the engine's handle of a collider: id
        self._masses: dict[int, float] = {}  # kg, of bodies alone
        self._meshes: set[int] = set()  # statics that are triangle meshes
        self._holds: dict[int, Hold] = {}
        self._next_id, self._next_grab = FLOOR + 1, 1
        self.engine = physics_shapes.new_world(gravity)
        self._events = rapier.ChannelEventCollector()
        self._attach()
        if floor_y is not None:
            self._add_floor(float(checked_point((0, floor_y, 0), "the floor")[1]))

    def _attach(self) -> None:
        """Connects what a snapshot does not hold.  One thread: two are slower at these sizes."""
        self.engine.set_num_threads(1)
        self.engine.event_handler = self._events
        self._queries_stale = True

    # ---- what is in the world

    def _add_floor(self, floor_y: float) -> None:
        from rapier3d import RigidBody, SharedShape

        at = isometry(Pose(np.array([0.0, floor_y, 0.0]), np.array([1.0, 0, 0, 0])))
        shape = SharedShape.halfspace((0.0, 1.0, 0.0))
        self._insert(FLOOR, RigidBody.fixed(position=at), shape, None, 0.6, 0.0)

    def add_static(
        self,
        shape: TriangleMesh | Sequence[np.ndarray],
        pose: Pose,
        friction: float = 0.6,
        restitution: float = 0.0,
    ) -> int:
        """An object that never moves: a mesh (an open one gets a back), or hulls (V, 3) metres."""
        from rapier3d import RigidBody

        at = isometry(checked_pose(pose, "a static object"))
        if isinstance(shape, TriangleMesh):
            engine_shape, findings = mesh_shape(shape)
            self.findings += findings
        else:
            engine_shape = compound_shape(shape)
        return self._insert(
            self._new_id(), RigidBody.fixed(position=at), engine_shape, None, friction, restitution
        )

    def add_body(
        self,
        hulls: Sequence[np.ndarray],
        pose: Pose,
        mass_kg: float,
        friction: float = 0.6,
        restitution: float = 0.0,
    ) -> int:
        """An object that moves, made of convex pieces (V, 3) metres, object frame.

        A mass outside 0.05 to 5 kg is clamped and named in `findings`.
        """
        from rapier3d import RigidBody

        at = isometry(checked_pose(pose, "a body"))
        shape = compound_shape(hulls)
        mass, finding = clamped_mass(mass_kg)
        body = RigidBody.dynamic(position=at, ccd_enabled=True)
        number = self._insert(self._new_id(), body, shape, mass, friction, restitution)
        self._masses[number] = mass
        self.findings += [finding] if finding else []
        return number

    def _new_id(self) -> int:
        self._next_id += 1
        return self._next_id - 1

    def _insert(
        self,
        number: int,
        body: Any,
        shape: Any,
        mass: float | None,
        friction: float,
        restitution: float,
    ) -> int:
        from rapier3d import ActiveEvents, Collider

        collider = Collider.new(shape)
        collider = collider.friction(checked_number(friction, "a friction", 0, MOST_FRICTION))
        collider = collider.restitution(checked_number(restitution, "a restitution", 0, 1))
        if mass is not None:
            collider = collider.mass(mass).active_events(ActiveEvents.CONTACT_FORCE_EVENTS)
            collider = collider.contact_force_event_threshold(0.0)
        handle = self.engine.add_body(body, [collider])
        self._handles[number] = handle
        self._note_collider(number)
        self._queries_stale = True
        return number

    def _note_collider(self, number: int) -> None:
        from rapier3d import ShapeType

        collider = self._collider(number)
        self.ids_by_collider[collider] = number
        if self.engine.colliders[collider].shape.shape_type == ShapeType.TRIMESH:
            self._meshes.add(number)

    def remove(self, number: int) -> None:
        """Takes an object out; hands that held it are empty, and what lay on it falls."""
        handle = self._handle(number)
        for grab in [g for g, hold in self._holds.items() if hold.body == number]:
            self._remove_hand(grab)
        del self.ids_by_collider[self._collider(number)], self._handles[number]
        self.engine.remove_body(handle)
        self._masses.pop(number, None)
        self._meshes.discard(number)
        self.engine.wake_up_all()
        self._queries_stale = True

    def set_pose(self, number: int, pose: Pose) -> None:
        """Puts an object somewhere else, at rest: undo, reset and the gizmo."""
        body = self.engine.rigid_bodies[self._handle(number)]
        body.position = isometry(checked_pose(pose, f"object {number}"))
        if number in self._masses:
            body.linvel = body.angvel = (0.0, 0.0, 0.0)  # pyright: ignore[reportAttributeAccessIssue]
        self.engine.wake_up_all()
        self._queries_stale = True

    def set_velocity(self, number: int, linear: Any, angular: Any = (0, 0, 0)) -> None:
        """(3,) m/s of the centre of mass and (3,) rad/s, world axes."""
        body = self.engine_body(number)
        line = checked_point(linear, f"the velocity of body {number}")
        turn = checked_point(angular, f"the turning of body {number}")
        body.linvel, body.angvel = tuple(map(float, line)), tuple(map(float, turn))
        body.wake_up(True)

    def float_body(self, number: int) -> None:
        """Stays where it is, in the air too, until something touches or takes it."""
        physics_shapes.float_body(self.engine_body(number))

    # ---- what it tells

    def ids(self) -> tuple[int, ...]:
        """Every object, the floor too, in the order they came."""
        return tuple(self._handles)

    def bodies(self) -> tuple[int, ...]:
        """The objects that move."""
        return tuple(self._masses)

    def pose(self, number: int) -> Pose:
        """world_from_object, exactly what the engine holds."""
        return pose_of(self.engine.rigid_bodies[self._handle(number)].position)

    def velocity(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        """(3,) m/s of the centre of mass and (3,) rad/s, world axes."""
        body = self.engine.rigid_bodies[self._handle(number)]
        v, w = body.linvel, body.angvel
        return np.array([v.x, v.y, v.z]), np.array([w.x, w.y, w.z])

    def mass(self, number: int) -> float:
        """kg, as clamped."""
        self.engine_body(number)
        return self._masses[number]

    def sleeps(self, number: int) -> bool:
        """Whether a body has come to rest and costs nothing."""
        return self.engine_body(number).is_sleeping

    def cast_ray(self, origin: Any, direction: Any) -> tuple[int, float] | None:
        """The nearest object along a ray and its distance in metres; 0 from inside of one."""
        from rapier3d import Ray

        start = checked_point(origin, "the origin of a ray")
        along = np.asarray(direction, np.float64)
        length = math.hypot(*along) if along.shape == (3,) else 0.0
        if not 0 < length < math.inf:
            raise ValueError(f"a ray has the direction {direction}; 3 numbers, not 0, are wanted.")
        ray = Ray(three(start), three(along / length))
        hit = self._queries().cast_ray(ray, MOST_REACH, True)
        return (self.ids_by_collider[hit[0]], hit[1]) if hit else None

    def nearest(self, point: Any, within: float) -> tuple[int, float] | None:
        """The body nearest to a hand and its distance, at most `within` metres; 0 inside."""
        from rapier3d import QueryFilter

        at = checked_point(point, "the place of a hand")
        reach = checked_number(within, "a hand's reach in metres", 0, MOST_REACH)
        bodies, far = QueryFilter.only_dynamic(), reach + LEAST_EXTENT
        found = self._queries().project_point(three(at), True, bodies, far)
        if found is None:
            return None
        p = found[1].point
        distance = 0.0 if found[1].is_inside else math.dist(at, (p.x, p.y, p.z))
        return (self.ids_by_collider[found[0]], distance) if distance <= reach else None

    def _queries(self) -> Any:
        if self._queries_stale:
            self.engine.update_query_pipeline()
            self._queries_stale = False
        return self.engine.query_pipeline

    def _handle(self, number: int) -> Any:
        if number not in self._handles:
            raise ValueError(f"there is no object {number}; it was removed, or never added.")
        return self._handles[number]

    def _collider(self, number: int) -> Any:
        return self.engine.rigid_bodies[self._handles[number]].colliders[0]  # each has one

    def engine_body(self, number: int) -> Any:
        """The engine's own word for a body.  Raises ValueError for what is none."""
        handle = self._handle(number)
        if number not in self._masses:
            raise ValueError(f"object {number} is static; only a body moves.")
        return self.engine.rigid_bodies[handle]

    # ---- time

    def step(self) -> list[Contact]:
        """One step of 1 / hz seconds; every pair that touched in it, once, by ids."""
        bodies = {number: self.engine_body(number) for number in self._masses}
        held = {hold.body for hold in self._holds.values()}
        free = {n: (self._masses[n], body) for n, body in bodies.items() if n not in held}
        speeds = velocities(bodies)
        at_meshes = [(self._collider(a), self._collider(b)) for a in held for b in self._meshes]
        substeps = self.substeps * physics_shapes.more_substeps(
            speeds, any_near(self.engine, at_meshes)
        )
        rules = self.engine.integration_parameters
        rules.dt = 1 / self.hz / substeps
        hands = self.engine.rigid_bodies
        starts = [(hold, hands[hold.hand].position) for hold in self._holds.values()]
        tally = ContactTally(self.engine, self.ids_by_collider, -self.engine.gravity.y)
        for k in range(substeps):
            move_hands(self.engine, starts, (k + 1) / substeps)
            rules.contact_clustering = not any_near(self.engine, at_meshes)
            rules.normalized_prediction_distance = physics_shapes.prediction(speeds)
            self.engine.step()
            events = self._events.drain_contact_force_events()
            if events:
                tally.gather(events, speeds, free)
            speeds = velocities(bodies)
        physics_shapes.end_floats(bodies, held)
        for hold in self._holds.values():
            hold.trail.append(hold.target)
        self.findings += physics_shapes.stopped_bodies(self.engine, self._handles)
        self._queries_stale = True
        return tally.contacts()

    # ---- hands

    def grab(self, number: int, hand_pose: Pose, point: Any) -> int:
        """A hand takes hold of a body at a point (3,) of the world; two hands may hold one body."""
        body = self.engine_body(number)
        hand = checked_pose(hand_pose, "a hand")
        at = checked_point(point, "the point of a grab")
        hold = attach_hand(self.engine, number, self._handles[number], hand, at)
        self._holds[self._next_grab] = hold
        body.wake_up(True)
        self._next_grab += 1
        return self._next_grab - 1

    def held(self, grab: int) -> int | None:
        """The body that a grab holds; None when it is over."""
        return self._holds[grab].body if grab in self._holds else None

    def move_hand(self, grab: int, pose: Pose | None) -> None:
        """Where the hand shall be after the next step; None: it is lost, and drops what it held."""
        hold = self._hold(grab)
        if pose is None:
            self._remove_hand(grab)
            return
        hold.target = checked_pose(pose, "a hand")
        self.engine.rigid_bodies[self._handles[hold.body]].wake_up(True)

    def carry(self, grab: int, moved: np.ndarray) -> None:
        """A hand jumps by (4, 4) now_from_before, rigid, with what it holds and who else does."""
        hands, body = self.engine.rigid_bodies, self._hold(grab).body
        holds = [(h, hands[h.hand]) for h in self._holds.values() if h.body == body]
        carry(holds, self.engine_body(body), moved)
        self._queries_stale = True

    def release(self, grab: int) -> None:
        """Lets go: the body flies on with its hand's velocity, unless something kept it back."""
        hold = self._hold(grab)
        body = self.engine.rigid_bodies[self._handles[hold.body]]
        with_hand = lag(hold, self.engine.rigid_bodies[hold.hand], body) <= WITH_HAND
        self._remove_hand(grab)
        if with_hand and all(other.body != hold.body for other in self._holds.values()):
            throw(hold, body, self.hz, physics_shapes.MOST_SPEED)

    def _remove_hand(self, grab: int) -> None:
        hold = self._holds.pop(grab)
        self.engine.impulse_joints.remove(hold.joint)
        self.engine.remove_body(hold.hand)

    def _hold(self, grab: int) -> Hold:
        if grab not in self._holds:
            raise ValueError(f"there is no grab {grab}; its hand has let go, or never held.")
        return self._holds[grab]

    # ---- all of it

    def snapshot(self) -> bytes:
        """Everything there is, to the last bit, findings aside.

        Of equal worlds the bytes can differ: the engine writes its pairs in no fixed order.
        """
        books = {
            "hz": self.hz,
            "substeps": self.substeps,
            "next": [self._next_id, self._next_grab],
            "things": [[n, h.index, h.generation] for n, h in self._handles.items()],
            "masses": list(self._masses.items()),
            "holds": [[grab, hold_to_json(hold)] for grab, hold in self._holds.items()],
        }
        return pack(books, self.engine.snapshot())

    def restore(self, data: bytes) -> None:
        """Back to a snapshot, one of another Physics too.  Raises ValueError, changing nothing."""
        from rapier3d import PhysicsWorld, RigidBodyHandle, SerializationError

        books, engine = unpack(data)
        try:
            self.engine = PhysicsWorld.restore(engine)
        except SerializationError as why:
            raise ValueError(f"a snapshot is of another engine ({why}); take a new one.") from why
        self.hz, self.substeps = books["hz"], books["substeps"]
        self._next_id, self._next_grab = books["next"]
        self._handles = {n: RigidBodyHandle(i, g) for n, i, g in books["things"]}
        self.ids_by_collider, self._meshes = {}, set()
        for number in self._handles:
            self._note_collider(number)
        self._masses = dict(books["masses"])
        self._holds = {grab: hold_from_json(hold) for grab, hold in books["holds"]}
        self._events.clear()
        self._attach()

    def hash(self) -> str:
        """SHA-256 of every pose and velocity, in the order of ids: equal worlds, equal hashes."""
        return hash_of((n, self.pose(n), *self.velocity(n)) for n in sorted(self._handles))
