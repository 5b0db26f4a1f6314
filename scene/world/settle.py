"""How a world begins: nothing inside another thing, each on what carries it, and whether it rests.

All of it is tried in a copy of the physics; the caller takes over the poses that it likes.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shapeshift.runtime_models.model import BadFile, Finding
from shapeshift.scene.pose import Pose
from shapeshift.scene.world.physics import Physics
from shapeshift.scene.world.physics_shapes import is_slow, isometry, pose_of
from shapeshift.scene.world.world import FLOOR_NAME, World

TOUCHING_M = 2e-4  # metres: as deep as this things lie in each other, and the engine holds them so
MOST_INSIDE = 0.25  # of the thinner one along the way out: as far two things are pushed apart
PUSHES = 90  # steps in which that has to be done
PUSH = 0.01  # of the smallest thing's side: the most that a step pushes

PUT_DOWN_S, REST_S = 1.0, 3.0  # seconds: until a thing lies on what carries it, and of the test
LET_DOWN_S = 0.5  # the same, of what lay on nearly the same before
DAMPING = 4.0  # 1/s, while it is put down: it neither bounces nor rolls off
MOST_GAP = 0.05  # of its size: from a thing to what carries it; above, nothing does
MOST_PUT = 5.0  # degrees that it may turn while it is put down
MOST_MOVED, MOST_TURNED = 0.02, 2.0  # of its size, and degrees: a thing that rests moves no more


@dataclass(frozen=True)
class Overlap:
    """Two objects of which one begins inside the other."""

    a: int  # ids, a < b
    b: int
    depth_m: float  # along the way on which they came apart
    share: float  # of the thinner one's extent along it


@dataclass(frozen=True)
class BodyMotion:
    """What gravity did to a body that nobody touched."""

    pose: Pose  # at the end
    moved_m: float  # of the middle of its box
    turned: float  # degrees
    down_m: float  # of moved_m, along gravity
    fell_m: float  # before anything carried it
    size_m: float  # the longest side of its box
    left_s: float  # when it had moved more than a thing does that rests; inf: never
    on: int | None  # what it touched last: where several, the lowest

    @property
    def rests(self) -> bool:
        return self.moved_m <= MOST_MOVED * self.size_m and self.turned <= MOST_TURNED

    @property
    def is_put(self) -> bool:
        """Whether it hardly stirred: where it is at the end, it stood in the photos, too."""
        return self.moved_m <= MOST_GAP * self.size_m and self.turned <= MOST_PUT

    @property
    def floats(self) -> bool:
        """Whether nothing was near under it."""
        return self.fell_m > MOST_GAP * self.size_m


def push_apart(physics: Physics) -> tuple[dict[int, Pose], list[Overlap]]:
    """Where bodies are that touch at most, by id, and which pairs began inside each other.

    They are moved, never turned, the lighter one of two the farther.  {} where no two overlap.
    """
    from rapier3d import Vec3

    copy = copy_of(physics)
    world, rules = copy.engine, copy.engine.integration_parameters
    bodies = {number: copy.engine_body(number) for number in copy.bodies()}
    starts = {number: physics.pose(number) for number in bodies}
    boxes = {number: box_of(copy, number) for number in bodies}
    world.gravity = Vec3(0.0, 0.0, 0.0)
    rules.dt, rules.normalized_contact_recycle_distance = 1 / copy.hz, 0.0
    step_m = PUSH * min((float(np.ptp(box, axis=0).max()) for box in boxes.values()), default=1.0)
    rules.normalized_max_corrective_velocity = step_m * copy.hz / rules.length_unit
    rules.normalized_prediction_distance = 2 * TOUCHING_M / rules.length_unit
    rules.contact_softness = rules.static_contact_softness = soft()
    for body in bodies.values():
        body.enabled_rotations = (False,) * 3
    first: dict[tuple[int, int], float] | None = None
    for _ in range(PUSHES):
        for body in bodies.values():
            body.linvel, body.angvel = (0.0,) * 3, (0.0,) * 3
            body.wake_up(True)
        world.step()
        depths = depths_of(copy)
        first = depths if first is None else {**depths, **first}
        if not max(depths.values(), default=0.0) > TOUCHING_M:
            break
    began = {pair: depth for pair, depth in (first or {}).items() if depth > TOUCHING_M}
    if not began:
        return {}, []
    poses = {number: copy.pose(number) for number in bodies}
    moved = {n: poses[n].position - starts[n].position for n in bodies}
    left = depths_of(copy)
    found = []
    for a, b in sorted(began):
        way = moved.get(b, np.zeros(3)) - moved.get(a, np.zeros(3))
        depth = float(np.linalg.norm(way)) + max(left.get((a, b), 0.0), 0.0)
        thin = min(extent(boxes[n], way) for n in (a, b) if n in boxes)
        found.append(Overlap(a, b, depth, depth / max(thin, 1e-9)))
    return poses, found


def copy_of(physics: Physics) -> Physics:
    """Another world that is as this one."""
    other = Physics(hz=physics.hz)
    other.restore(physics.snapshot())
    return other


def soft() -> Any:
    """Contacts that push out evenly, some of the depth a step."""
    from rapier3d import SpringCoefficients

    return SpringCoefficients(30.0, 5.0)


def depths_of(physics: Physics) -> dict[tuple[int, int], float]:
    """Metres that pairs lie inside each other, by ids; below 0: apart."""
    found: dict[tuple[int, int], float] = {}
    ids = physics.ids_by_collider
    for pair in physics.engine.narrow_phase.contact_pairs():
        a, b = sorted((ids[pair.collider1], ids[pair.collider2]))
        depths = [-point.dist for manifold in pair.manifolds for point in manifold.points]
        if depths:
            found[a, b] = max(depths)
    return found


def box_of(physics: Physics, number: int) -> np.ndarray:
    """(2, 3) metres, world: the box around a body."""
    box = physics.engine.colliders[physics.engine_body(number).colliders[0]].compute_aabb()
    return np.array([[p.x, p.y, p.z] for p in (box.mins, box.maxs)])


def extent(box: np.ndarray, way: np.ndarray) -> float:
    """Metres across a box (2, 3) along a way (3,), of the ellipsoid in it; its least for none."""
    sides, length = np.ptp(box, axis=0), float(np.linalg.norm(way))
    return float(np.linalg.norm(sides * way)) / length if length > 0 else float(sides.min())


def let_fall(physics: Physics, seconds: float, damping: float = 0.0) -> dict[int, BodyMotion]:
    """What gravity does to each body in so many seconds, if nobody touches it."""
    copy = copy_of(physics)
    bodies = {number: copy.engine_body(number) for number in copy.bodies()}
    starts = {number: copy.pose(number) for number in bodies}
    boxes = {number: box_of(copy, number) for number in bodies}
    carried_at: dict[int, float] = {}  # height at the first contact
    on: dict[int, int] = {}
    for body in bodies.values() if damping else ():
        body.linear_damping = body.angular_damping = damping
    left_s = dict.fromkeys(bodies, math.inf)
    for step in range(math.ceil(seconds * copy.hz)):
        lowest: dict[int, float] = {}
        for contact in copy.step():
            for mine, other in ((contact.a, contact.b), (contact.b, contact.a)):
                if mine in bodies and contact.point[1] < lowest.get(mine, math.inf):
                    lowest[mine], on[mine] = float(contact.point[1]), other
        for number in bodies:
            if number in on:
                carried_at.setdefault(number, float(copy.pose(number).position[1]))
            if left_s[number] == math.inf and not bodies[number].is_sleeping:
                way, turned = stirred(starts[number], copy.pose(number), boxes[number])
                size = float(np.ptp(boxes[number], axis=0).max())
                if np.linalg.norm(way) > MOST_MOVED * size or turned > MOST_TURNED:
                    left_s[number] = step / copy.hz
    found = {}
    for number, start in starts.items():
        end = copy.pose(number)
        way, turned = stirred(start, end, boxes[number])
        first_y = carried_at.get(number, float(end.position[1]))
        found[number] = BodyMotion(
            end, float(np.linalg.norm(way)), turned, float(-way[1]),
            max(float(start.position[1]) - first_y, 0.0),
            float(np.ptp(boxes[number], axis=0).max()), left_s[number], on.get(number),
        )  # fmt: skip
    return found


def let_down(physics: Physics) -> dict[int, BodyMotion]:
    """How each body comes to rest from here: out of what it is inside of, then gently down."""
    copy = copy_of(physics)
    starts = {number: physics.pose(number) for number in physics.bodies()}
    boxes = {number: box_of(physics, number) for number in starts}
    for number, pose in push_apart(physics)[0].items():
        copy.set_pose(number, pose)
    found = let_fall(copy, LET_DOWN_S, DAMPING)
    for number, motion in found.items():
        way, turned = stirred(starts[number], motion.pose, boxes[number])
        found[number] = replace(motion, moved_m=float(np.linalg.norm(way)), turned=turned)
    return found


def is_still(physics: Physics, number: int) -> bool:
    """Whether a body is at rest, or as good as."""
    line, turn = physics.velocity(number)
    return is_slow(line, turn)


def shift_shape(physics: Physics, number: int, pose: Pose) -> None:
    """Has a body's shape where it would be at that pose, while the body stays where it is."""
    here = np.linalg.inv(physics.pose(number).matrix())
    collider = physics.engine.colliders[physics.engine_body(number).colliders[0]]
    now = pose_of(collider.position_wrt_parent).matrix()
    collider.position_wrt_parent = isometry(Pose.from_matrix(here @ pose.matrix() @ now))


def stirred(start: Pose, now: Pose, box: np.ndarray) -> tuple[np.ndarray, float]:
    """(3,) metres that the middle of a body's box (2, 3) has moved, and degrees it has turned."""
    middle = box.mean(axis=0)
    way = (now.matrix() @ np.linalg.inv(start.matrix()) @ np.append(middle, 1))[:3] - middle
    cosine = min(abs(float(start.wxyz @ now.wxyz)), 1.0)
    return way, math.degrees(2 * math.acos(cosine))


# The same of a world of named objects.

TIPPED = 20.0  # degrees
STEEP = 0.7  # of a way, that is along gravity
STAYS = ": it stays where it is until it is touched"
MOST_ROUNDS = 8  # of the test: what stirs first may push the others, and is kept before the next
DECIMALS = 4  # in a row of a report


@dataclass(frozen=True)
class Rest:
    """How one object begins, and what the test of REST_S seconds said of it."""

    name: str
    motion: BodyMotion  # in the test
    pose: Pose  # from which it was tested
    put: BodyMotion | None  # how it was put down before; None: it stays where it was
    floats: bool  # nothing carried it
    kept: bool  # it floats, or does not rest alone: it stays where it is until it is touched
    on: str  # what carries it at the end; "": nothing

    @property
    def is_good(self) -> bool:
        return self.motion.rests and not self.kept

    @property
    def word(self) -> str:
        """For a table."""
        if self.is_good:
            return "yes"
        return "floats" if self.floats else "kept" if self.kept else "no"

    def sentence(self) -> str:
        """Why it does not rest, for people; "" where it does."""
        motion = self.motion
        if self.is_good:
            return ""
        if self.floats:
            return f"nothing that is in the scene carries {self.name}{STAYS}"
        moved, on = f"{1e3 * motion.moved_m:.0f} mm", f" on {self.on}" * bool(self.on)
        share = f"{100 * motion.moved_m / max(motion.size_m, 1e-9):.0f} % of its size"
        if motion.turned > MOST_TURNED:
            what = "tips over" if motion.turned > TIPPED else "rocks or rolls"
            what += f"{on}, {motion.turned:.0f} degrees and {moved} in {REST_S:.0f} s"
        elif abs(motion.down_m) > STEEP * motion.moved_m:
            what = f"{'sinks or falls' if motion.down_m > 0 else 'rises'} by {moved}, {share}"
        else:
            what = f"slides{on} by {moved}, {share}"
        return f"{self.name} alone {what}{STAYS * self.kept}"

    def row(self) -> dict:
        """The same as JSON has it."""
        motion = self.motion
        return {
            "rests": self.is_good,
            "floats": self.floats,
            "kept": self.kept,
            "put_mm": round(1e3 * self.put.moved_m, 2) if self.put else 0.0,
            "put_deg": round(self.put.turned, 2) if self.put else 0.0,
            "moved_mm": round(1e3 * motion.moved_m, 2),
            "moved_share": round(motion.moved_m / motion.size_m, DECIMALS),
            "turned_deg": round(motion.turned, 2),
            "on": self.on or None,
            "why": self.sentence() or None,
        }


def begin(world: World) -> None:
    """Pushes apart what begins inside each other, and says so in the world's findings.

    Raises BadFile, with the pair's names, where that is more than MOST_INSIDE of one of them.
    """
    poses, overlaps = push_apart(world.physics)
    for one in overlaps:
        names = [world.names.get(number, FLOOR_NAME) for number in (one.a, one.b)]
        pair, depth = " and ".join(f"'{name}'" for name in names), f"{1e3 * one.depth_m:.1f} mm"
        if not one.share <= MOST_INSIDE:
            raise BadFile(
                f"{pair} begin inside each other, {depth} or {100 * min(one.share, 1):.0f} % of "
                f"the thinner one; up to {100 * MOST_INSIDE:.0f} % is pushed apart: move one of "
                "them, or give it a smaller collider."
            )
        what = f"{pair} begin {depth} inside each other"
        world.findings.append(Finding(what, 1, "pushed apart", repaired=True))
    for number, pose in poses.items():
        name = world.names[number]
        if np.abs(pose.position - world.objects[name].pose.position).max() > TOUCHING_M / 2:
            world.move_object(name, pose)


def settle(world: World) -> list[Rest]:
    """Puts every body on what carries it, where that is near, and tests whether it rests there.

    What stirs more than MOST_GAP and MOST_PUT stays where it was.  What nothing carries, or what
    does not rest alone, is kept where it is until something touches it: photos show it so, and
    what holds it is not in the scene.
    """
    physics = world.physics
    put = let_fall(physics, PUT_DOWN_S, DAMPING)
    for number, motion in put.items():
        if motion.is_put:
            world.move_object(world.names[number], motion.pose)
    starts = {number: physics.pose(number) for number in put}
    found: dict[int, BodyMotion] = {}  # of those that are kept: how they stirred alone
    tested, new = put, [number for number, motion in put.items() if motion.floats]
    for _ in range(MOST_ROUNDS):
        for number in new:
            physics.float_body(number)
            found[number] = tested[number]
        tested = let_fall(physics, REST_S)
        stirring = {n: m for n, m in tested.items() if not m.rests and n not in found}
        first = min((motion.left_s for motion in stirring.values()), default=0.0)
        new = [n for n, motion in stirring.items() if motion.left_s <= first]
        if not new:
            break
    rests = []
    for number, motion in tested.items():
        kept, down = number in found, put[number]
        motion = found.get(number, motion)
        rests.append(
            Rest(
                world.names[number],
                motion,
                starts[number],
                down if down.is_put else None,
                kept and down.floats,
                kept,
                name_of(world, motion.on),
            )
        )
    return rests


def name_of(world: World, number: int | None) -> str:
    return "" if number is None else world.names.get(number, FLOOR_NAME)
