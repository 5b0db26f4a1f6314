"""A hand that holds a body: a force-limited spring to the hand, and the throw when it lets go.

A hard joint would drag the body through tables; here the hand's force has a limit, as a hand's has.
"""

import math
from collections import deque
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from shapeshift.runtime_models.shapes import four, three
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.world.physics_shapes import isometry, pose_of

# Of the motors, by acceleration (1/s2, 1/s), so that light and heavy bodies follow alike.
STIFFNESS, DAMPING = 8000.0, 180.0  # overdamped a little (2 sqrt(8000) = 179)
FORCE_PER_KG = 400.0  # N: forty times its own weight ...
LEAST_FORCE, MOST_FORCE = 20.0, 250.0  # N: ... between what a finger and what an arm pushes with
TORQUE_ARM = 0.05  # metres: the largest torque is the largest force at this arm
TRAIL = 6  # poses of the hand, 1 / hz apart, out of which comes its velocity at release
TURN_TRAIL = 4  # of them for its turning, which is noisier when extrapolated: a mean
WITH_HAND = 0.03  # metres: a body farther behind its hand was hindered and keeps its own velocity


@dataclass
class Hold:
    """One hand that holds one body."""

    body: int  # id
    hand: Any  # the engine's handle of the kinematic hand
    joint: Any  # the engine's handle of the motors between them
    grip: np.ndarray  # (3,) metres in the hand's frame: where it took hold
    body_grip: np.ndarray  # (3,) metres in the body's frame: the same point at the grab
    target: Pose  # where the hand shall be at the end of the next step
    trail: deque = field(default_factory=lambda: deque(maxlen=TRAIL))  # Poses, oldest first


def motor_joint(frame_hand: Any, frame_body: Any, mass_kg: float) -> Any:
    """Six motors that pull the body's frame onto the hand's, each with a largest force."""
    from rapier3d import GenericJointBuilder, JointAxesMask, JointAxis, MotorModel

    force = force_limit(mass_kg)
    joint = GenericJointBuilder(JointAxesMask(0))
    joint = joint.local_frame1(frame_hand).local_frame2(frame_body)
    for axis, limit in (
        (JointAxis.LIN_X, force), (JointAxis.LIN_Y, force), (JointAxis.LIN_Z, force),
        (JointAxis.ANG_X, force * TORQUE_ARM), (JointAxis.ANG_Y, force * TORQUE_ARM),
        (JointAxis.ANG_Z, force * TORQUE_ARM),
    ):  # fmt: skip
        joint = joint.motor_model(axis, MotorModel.ACCELERATION_BASED)
        joint = joint.motor_position(axis, 0.0, STIFFNESS, DAMPING)
        joint = joint.motor_max_force(axis, limit)
    return joint.build()


def attach_hand(
    world: Any, number: int, body_handle: Any, hand_pose: Pose, point: np.ndarray
) -> Hold:
    """Puts a kinematic hand into the world and ties a body to it at a point (3,) of the world."""
    from rapier3d import Isometry3, RigidBody

    body = world.rigid_bodies[body_handle]
    at = isometry(hand_pose)
    # Both frames lie at the point and along the body, so that at first nothing pulls.
    world_from_grip = Isometry3(three(point), body.position.rotation)
    hand_from_grip = at.inverse() * world_from_grip
    body_from_grip = body.position.inverse() * world_from_grip
    hand = world.add_body(RigidBody.kinematic_position_based(position=at), [])
    motors = motor_joint(hand_from_grip, body_from_grip, body.mass)
    joint = world.impulse_joints.insert(hand, body_handle, motors)
    grips = pose_of(hand_from_grip).position, pose_of(body_from_grip).position
    hold = Hold(number, hand, joint, *grips, hand_pose)
    hold.trail.append(hand_pose)
    return hold


def carry(holds: list[tuple[Hold, Any]], body: Any, moved: np.ndarray) -> None:
    """A body, the hands that hold it and where they have been jump by (4, 4) now_from_before.

    Velocities turn along, so that a throw right after a jump is as it was before it.
    """
    turn = moved[:3, :3]
    for part in (body, *(hand for _, hand in holds)):
        part.position = isometry(jumped(pose_of(part.position), moved))
    for name in ("linvel", "angvel"):
        v = getattr(body, name)
        setattr(body, name, tuple(map(float, turn @ (v.x, v.y, v.z))))
    for hold, _ in holds:
        hold.target = jumped(hold.target, moved)
        hold.trail = deque((jumped(pose, moved) for pose in hold.trail), maxlen=TRAIL)
    body.wake_up(True)


def jumped(pose: Pose, moved: np.ndarray) -> Pose:
    """A pose of the world after everything moved by a rigid (4, 4)."""
    return Pose.from_matrix(moved @ pose.matrix())


def move_hands(world: Any, starts: list[tuple[Hold, Any]], part: float) -> None:
    """Puts every hand a part 0..1 of the way from where it was at the start of a step."""
    for hold, start in starts:
        now = start.lerp_slerp(isometry(hold.target), part)
        world.rigid_bodies[hold.hand].set_next_kinematic_position(now)


def lag(hold: Hold, hand: Any, body: Any) -> float:
    """Metres by which the point held is behind where its hand wants it."""
    ends = (hand.position, hold.grip), (body.position, hold.body_grip)
    there, here = (frame.transform_point(tuple(map(float, point))) for frame, point in ends)
    return math.dist((there.x, there.y, there.z), (here.x, here.y, here.z))


def throw(hold: Hold, body: Any, hz: float, most_speed: float) -> None:
    """Gives the body the velocity that its hand had, at the body's centre of mass."""
    linear, turning = hand_velocity(list(hold.trail), hz)
    centre = body.center_of_mass
    arm = np.array([centre.x, centre.y, centre.z]) - hold.trail[-1].position
    thrown = linear + np.cross(turning, arm)
    thrown *= min(1.0, most_speed / max(float(np.linalg.norm(thrown)), 1e-9))
    body.linvel, body.angvel = tuple(map(float, thrown)), tuple(map(float, turning))


def force_limit(mass_kg: float) -> float:
    """Newtons that a hand exerts on a body at most."""
    return min(max(FORCE_PER_KG * mass_kg, LEAST_FORCE), MOST_FORCE)


def hand_velocity(trail: list[Pose], hz: float) -> tuple[np.ndarray, np.ndarray]:
    """(3,) m/s of the hand's origin and (3,) rad/s at the last pose of the trail, both filtered.

    The slope at the end of a parabola laid through the positions: exact for a hand that speeds up
    evenly, where a mean would be late, and quieter than the last difference.
    """
    if len(trail) < 2:
        return np.zeros(3), np.zeros(3)
    seconds = (np.arange(len(trail)) - (len(trail) - 1)) / hz  # the last one is at 0
    points = np.stack([pose.position for pose in trail])  # (n, 3) metres
    powers = seconds[:, None] ** np.arange(min(3, len(trail)))  # (n, 1 to 3)
    linear = np.linalg.lstsq(powers, points, rcond=None)[0][1]
    turns = list(trail)[-TURN_TRAIL:]
    steps = [turn_between(a.wxyz, b.wxyz) * hz for a, b in pairwise(turns)]
    return linear, np.mean(steps, axis=0)


def turn_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(3,) radians about the world's axes that turn rotation a into b (wxyz), the short way."""
    w = float(a @ b)
    # The vector part of b times the conjugate of a.
    vector = a[0] * b[1:] - b[0] * a[1:] - np.cross(b[1:], a[1:])
    if w < 0:
        w, vector = -w, -vector
    length = float(np.linalg.norm(vector))
    return vector * (2 * math.atan2(length, w) / length) if length > 0 else np.zeros(3)


def hold_to_json(hold: Hold) -> dict:
    """A hold as numbers: Python's floats are written so that they come back to the bit."""
    return {
        "body": hold.body,
        "hand": [hold.hand.index, hold.hand.generation],
        "joint": [hold.joint.index, hold.joint.generation],
        "grips": [hold.grip.tolist(), hold.body_grip.tolist()],
        "poses": [[*pose.position, *pose.wxyz] for pose in (hold.target, *hold.trail)],
    }


def hold_from_json(numbers: dict) -> Hold:
    """The hold that hold_to_json wrote."""
    from rapier3d import ImpulseJointHandle, RigidBodyHandle

    target, *trail = (Pose(np.array(row[:3]), np.array(row[3:])) for row in numbers["poses"])
    grip, body_grip = numbers["grips"]
    hold = Hold(
        numbers["body"],
        RigidBodyHandle(*numbers["hand"]),
        ImpulseJointHandle(*numbers["joint"]),
        np.array(grip),
        np.array(body_grip),
        target,
    )
    hold.trail.extend(trail)
    return hold


# A mouse as a hand in the world: pure, struct in, struct out.
#
# The hand floats on a plane across the line of sight. Dragging moves it in that plane, the wheel
# pushes it away and pulls it near, a drag with a modifier turns what it holds as if that were a
# ball under the mouse. Places on the picture are in logical pixels from its top left.

NOTCH = 1.08  # times as far, one notch of the wheel
TURN = 0.008  # radians a pixel
ROLL = 0.12  # radians a notch, around the line of sight
NEAREST = 2.0  # of the eye's near plane: a hand stays that far
FARTHEST_M = 1000.0

Size = tuple[float, float]  # of the picture, logical pixels


@dataclass(frozen=True)
class MouseHand:
    """Where a mouse holds something."""

    place: tuple[float, float]  # on the picture
    depth_m: float  # along the line of sight, from the eye to the hand's plane
    wxyz: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)  # world_from_hand


def ray(view: View, place: tuple[float, float], size: Size) -> tuple[np.ndarray, np.ndarray]:
    """(3,) metres where a ray through a place of the picture begins, (3,) its unit direction."""
    way = along(view, place, size)
    return np.array(view.world_from_eye.position, np.float64), way / np.linalg.norm(way)


def along(view: View, place: tuple[float, float], size: Size) -> np.ndarray:
    """(3,) metres, world axes: from the eye to the place, a metre deep."""
    left, right, low, high = view.tangents
    x = left + (right - left) * place[0] / size[0]
    y = high + (low - high) * place[1] / size[1]
    return view.world_from_eye.matrix()[:3, :3] @ np.array([x, y, -1.0])


def hand_at(view: View, size: Size, point: np.ndarray) -> MouseHand:
    """A hand at a point (3,) of the world before the eye."""
    x, y, z = (view.eye_from_world() @ np.append(point, 1.0))[:3]
    left, right, low, high = view.tangents
    depth = bounded_depth(view, float(-z))
    across = (x / depth - left) / (right - left) * size[0]
    down = (high - y / depth) / (high - low) * size[1]
    return MouseHand((float(across), float(down)), depth)


def pose(hand: MouseHand, view: View, size: Size) -> Pose:
    """Where the hand is in the world, seen from where the eye is now."""
    eye = np.asarray(view.world_from_eye.position, np.float64)
    return Pose(eye + hand.depth_m * along(view, hand.place, size), np.array(hand.wxyz))


def moved(hand: MouseHand, dx: float, dy: float, size: Size) -> MouseHand:
    """Dragged by so many pixels, right and down; not out of the picture, nobody could bring it
    back.
    """
    x, y = (
        float(np.clip(at + by, min(0, at), max(most, at)))
        for at, by, most in zip(hand.place, (dx, dy), size, strict=True)
    )
    return replace(hand, place=(x, y))


def pushed(hand: MouseHand, notches: float, view: View) -> MouseHand:
    """Away from the eye; pulled near with negative notches."""
    depth = hand.depth_m * NOTCH ** float(np.clip(notches, -100, 100))
    return replace(hand, depth_m=bounded_depth(view, depth))


def turned(hand: MouseHand, dx: float, dy: float, view: View) -> MouseHand:
    """Rolled under the mouse: about the eye's up by dx, about its right by dy."""
    right, up, _ = view.world_from_eye.matrix()[:3, :3].T
    turn = multiply(about(right, dy * TURN), about(up, dx * TURN))
    return with_turn(hand, turn)


def rolled(hand: MouseHand, notches: float, view: View) -> MouseHand:
    """About the line of sight, clockwise as the eye sees it."""
    back = view.world_from_eye.matrix()[:3, 2]
    return with_turn(hand, about(back, -notches * ROLL))


def with_turn(hand: MouseHand, turn: np.ndarray) -> MouseHand:
    wxyz = multiply(turn, np.array(hand.wxyz))
    return replace(hand, wxyz=four(wxyz / np.linalg.norm(wxyz)))


def bounded_depth(view: View, depth: float) -> float:
    return float(np.clip(depth, NEAREST * view.near, max(FARTHEST_M, NEAREST * view.near)))


def about(axis: np.ndarray, angle: float) -> np.ndarray:
    """wxyz of a turn about a unit axis (3,) by radians."""
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """wxyz of turning by b, then by a."""
    vector = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *vector])
