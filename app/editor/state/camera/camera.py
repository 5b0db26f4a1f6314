"""Orbit and fly cameras of the desktop as plain numbers: input in, View out; no GL, no window."""

from dataclasses import dataclass

import numpy as np

from shapeshift.scene.cameras.framing import FAR_RADII, FOV_Y, NEAR_RADII
from shapeshift.scene.pose import Pose, View, orthographic

POLE = 1.5  # radians of pitch; straight up or down would lose which way is right
MIN_RADII, MAX_RADII = 0.02, 20.0  # the orbit distance stays within these, in scene radii
DOLLY_STEP = 0.85  # of the distance, one notch of the wheel
FLY_STEP_RADII = 0.08  # metres a notch, in scene radii
SMOOTH_S = 0.06  # the picture follows the hand with this time constant
BRAKE_S = 0.09  # so does the flying speed follow the keys
SPEED_RADII = 0.8  # metres a second with a key held, in scene radii
FAST, SLOW = 5.0, 0.2  # Shift, Ctrl
DIRECTIONS = {  # name -> yaw, pitch of an eye that looks from there, radians
    "front": (0.0, 0.0), "right": (np.pi / 2, 0.0), "top": (0.0, -np.pi / 2),
    "back": (np.pi, 0.0), "left": (-np.pi / 2, 0.0), "bottom": (0.0, np.pi / 2),
}  # fmt: skip
STILL = 2e-4  # radians, or scene radii: less is not seen, the camera counts as at rest

BY_HAND, FIRST, EVERYTHING = "", "first view", "everything"  # what a camera shows

Box = tuple[float, float, float, float]  # left, top, right, bottom

# A camera is seven numbers, so that its goal, and how far the picture lags behind, can be
# subtracted.  Roll comes to rest level: at 0, or upside down where a camera of a file stood so.
ANCHOR, YAW, PITCH, LOG_DISTANCE, ROLL = slice(0, 3), 3, 4, 5, 6


def axes_of(
    yaw: float, pitch: float, roll: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Right, up and forward (3,) of an eye; yaw 0 looks along -Z, positive turns to the left."""
    rx, rz = np.cos(yaw), -np.sin(yaw)
    fx, fy, fz = rz * np.cos(pitch), np.sin(pitch), -rx * np.cos(pitch)
    right, forward = np.array([rx, 0.0, rz]), np.array([fx, fy, fz])
    up = np.array([-rz * fy, rz * fx - rx * fz, rx * fy])  # np.cross takes longer than all else
    cosine, sine = np.cos(roll), np.sin(roll)
    return cosine * right + sine * up, cosine * up - sine * right, forward


def fov_y_of(view: View) -> float:
    """Radians from top to bottom."""
    return float(np.arctan(view.tangents[3]) - np.arctan(view.tangents[2]))


@dataclass(frozen=True)
class Push:
    """What keys or a stick ask for: -1 to 1 along the eye's right, up and forward."""

    right: float = 0.0
    up: float = 0.0
    forward: float = 0.0
    pace: float = 1.0  # FAST, 1 or SLOW

    @property
    def any(self) -> bool:
        return bool(self.right or self.up or self.forward)


class EditorCamera:
    """One eye that either orbits an anchor or flies; switching between the two moves nothing.

    In orbit the anchor is the point looked at, in flight it is the eye.  Inputs change the goal at
    once, `step` lets the picture follow: exact exponentials, so frame times do not matter.
    """

    def __init__(self, view: View, centre: np.ndarray, radius: float) -> None:
        self.flying = False
        self.framed = FIRST  # what it shows until a hand moves it
        self._home = (view, np.asarray(centre, np.float64), radius)
        self._goal = np.zeros(7)
        self._lag = np.zeros(7)  # goal - shown
        self._velocity = np.zeros(3)  # metres a second
        self.radius = radius
        self.fov_y = FOV_Y
        self.orthographic = False  # parallel rays, while it orbits
        self.about_pointer = False  # a drag turns about what it began on
        self.near_m = 0.0  # before which nothing is drawn; 0: by the scene's size
        self.speed = 1.0  # times that of flight
        self._eye_view: tuple[tuple, View] | None = None  # the last one, and what it is of
        self._parallel_view: tuple[View, View] | None = None  # that view by parallel rays
        self.reset()
        self._lag[:] = 0

    @property
    def position(self) -> np.ndarray:
        """(3,) metres: the eye as it is shown now."""
        return self._eye(self._goal - self._lag)

    @property
    def target(self) -> np.ndarray:
        """(3,) metres: the point that the orbit goes around."""
        return self._eye(self._goal) + self.distance * axes_of(*self._goal[3:5])[2]

    @property
    def distance(self) -> float:
        return float(np.exp(self._goal[LOG_DISTANCE]))

    @property
    def _upright(self) -> float:
        """1, or -1 where the eye rests upside down and hands mean the other way round."""
        return 1.0 if np.cos(self._goal[ROLL]) >= 0 else -1.0

    @property
    def moving(self) -> bool:
        """False when another `step` without input would change nothing that can be seen."""
        metres = np.abs(np.r_[self._lag[ANCHOR], self._velocity * BRAKE_S]).max()
        return bool(metres > STILL * self.radius or np.abs(self._lag[3:]).max() > STILL)

    def view(self, size: tuple[int, int], free: Box | None = None) -> View:
        """What is seen now in size (W, H) pixels, as `eye_view`; by parallel rays where wanted."""
        view = self.eye_view(size, free)
        if not self.parallel:
            return view
        if self._parallel_view is None or self._parallel_view[0] is not view:
            distance = float(np.exp((self._goal - self._lag)[LOG_DISTANCE]))
            of = orthographic(view, distance, self.radius, self.near_m)
            self._parallel_view = (view, of)
        return self._parallel_view[1]

    @property
    def parallel(self) -> bool:
        """Whether rays are parallel; those of flight come from the eye."""
        return self.orthographic and not self.flying

    def eye_view(self, size: tuple[int, int], free: Box | None = None) -> View:
        """What the eye sees now in size (W, H) pixels.

        The field of view fits `free` (left, top, right, bottom in pixels), the part of the picture
        that nothing covers, with the line of sight in its middle; around it more can be seen.
        The same View until one of these changes, since a frame asks for it several times.
        """
        shown = self._goal - self._lag
        key = (shown.tobytes(), self.radius, self.fov_y, self.near_m, size, free)
        if self._eye_view is None or self._eye_view[0] != key:
            self._eye_view = (key, self.view_of(shown, size, free or (0, 0, *size)))
        return self._eye_view[1]

    def view_of(self, shown: np.ndarray, size: tuple[int, int], free: Box) -> View:
        right, up, forward = axes_of(shown[YAW], shown[PITCH], shown[ROLL])
        world_from_eye = np.eye(4)
        world_from_eye[:3, :3] = np.stack([right, up, -forward], axis=1)
        world_from_eye[:3, 3] = self._eye(shown)
        distance = float(np.exp(shown[LOG_DISTANCE]))
        near = self.near_m or NEAR_RADII * self.radius
        far = max(FAR_RADII * self.radius + distance, 2 * near)
        pose = Pose.from_matrix(world_from_eye)
        return View(pose, _tangents(self.fov_y, size, free), near, far, size)

    def turn(self, yaw: float, pitch: float) -> None:
        """Orbits around the anchor, or looks about when flying, by radians."""
        goal = self._goal.copy()
        goal[YAW] += self._upright * yaw
        limit = max(POLE, abs(goal[PITCH]))  # from straight above it turns on without a jump
        goal[PITCH] = np.clip(goal[PITCH] + self._upright * pitch, -limit, limit)
        self._move_to(goal)

    def turn_about(self, point: np.ndarray, yaw: float, pitch: float) -> None:
        """Orbits around a world point (3,), which stays where it is in the picture."""
        if self.flying:
            self.turn(yaw, pitch)
            return
        before, anchor = self._turned_axes(), self._goal[ANCHOR].copy()
        self.turn(yaw, pitch)
        turn = self._turned_axes() @ before.T  # (3, 3) of the world
        goal = self._goal.copy()
        goal[ANCHOR] = point + turn @ (anchor - point)
        self._move_to(goal)

    def _turned_axes(self) -> np.ndarray:
        """(3, 3) axes of where the camera is going, as columns."""
        return np.stack(self._axes(), axis=1)

    def look_from(self, name: str) -> None:
        """From one of DIRECTIONS, level, at the same distance from what is orbited.

        In flight the eye stays where it is and turns.
        """
        yaw, pitch = DIRECTIONS[name]
        goal = self._goal.copy()
        goal[YAW] += _half_turn_at_most(yaw - goal[YAW])
        goal[PITCH], goal[ROLL] = pitch, 0.0
        self._move_to(goal)

    def pan(self, right: float, up: float) -> None:
        """Shifts eye and anchor by parts of the picture's height, measured at the anchor."""
        metres = 2 * np.tan(self.fov_y / 2) * self.distance
        axis_right, axis_up, _ = self._axes()
        goal = self._goal.copy()
        goal[ANCHOR] += metres * (right * axis_right + up * axis_up)
        self._move_to(goal)

    def dolly(self, notches: float) -> None:
        """Nearer to the anchor (positive) or away from it; straight ahead when flying."""
        goal = self._goal.copy()
        if self.flying:
            metres = notches * FLY_STEP_RADII * self.speed * self.radius
            goal[ANCHOR] += metres * axes_of(*goal[3:5])[2]
        else:
            goal[LOG_DISTANCE] = self._bounded(goal[LOG_DISTANCE] + notches * np.log(DOLLY_STEP))
        self._move_to(goal)

    def step(self, seconds: float, push: Push = Push()) -> None:
        """Lets time pass: the keys move the camera, the picture catches up with its goal."""
        self.framed = BY_HAND if push.any else self.framed
        right, _, forward = self._axes()
        up = np.array([0, self._upright, 0])
        wanted = push.right * right + push.up * up + push.forward * forward
        length = float(np.linalg.norm(wanted))
        if length > 0:
            wanted *= SPEED_RADII * self.speed * self.radius * push.pace / max(float(length), 1.0)
        # v' = (wanted - v) / BRAKE_S solved exactly: two short steps equal a long one
        keep = np.exp(-seconds / BRAKE_S)
        gap = self._velocity - wanted
        self._goal[ANCHOR] += wanted * seconds + gap * BRAKE_S * (1 - keep)
        self._velocity = wanted + gap * keep
        self._lag *= np.exp(-seconds / SMOOTH_S)
        if not push.any and not self.moving:
            self._lag[:] = 0
            self._velocity[:] = 0

    def toggle_flying(self) -> None:
        """Between orbit and flight; the eye stays where it is."""
        goal, shown = self._goal, self._goal - self._lag
        reach = -1.0 if not self.flying else 1.0
        for state in (goal, shown):
            forward = axes_of(state[YAW], state[PITCH])[2]
            state[ANCHOR] += reach * np.exp(state[LOG_DISTANCE]) * forward
        self.flying, self.framed = not self.flying, BY_HAND
        self._lag = goal - shown

    def focus(self, point: np.ndarray) -> None:
        """Brings a world point (3,) to the middle and makes it what the orbit goes around."""
        if self.flying:
            x, y, z = np.asarray(point, np.float64) - self._eye(self._goal)
            goal = self._goal.copy()
            goal[YAW] += _half_turn_at_most(np.arctan2(-x, -z) - goal[YAW])
            goal[PITCH] = np.clip(np.arctan2(y, np.hypot(x, z)), -POLE, POLE)
            self._move_to(goal)
            return
        self._reanchor(float((point - self.position) @ axes_of(*self._goal[3:5])[2]))
        goal = self._goal.copy()
        goal[ANCHOR] = point
        self._move_to(goal)

    def frame(self, centre: np.ndarray, distance: float) -> None:
        """Looks at the centre (3,) from that many metres, in the same direction as before."""
        yaw, pitch, roll = self._goal[[YAW, PITCH, ROLL]]
        self._stand(np.asarray(centre, np.float64), yaw, pitch, distance, roll)
        self.framed = EVERYTHING

    def stand(self, pose: Pose, fov_y: float) -> None:
        """Stands at a pose at once, then turns level; the orbit goes around what it sees there."""
        axes = pose.matrix()[:3, :3]
        eye, forward = np.asarray(pose.position, np.float64), -axes[:, 2]
        yaw = np.arctan2(-forward[0], -forward[2])
        pitch = np.clip(np.arcsin(np.clip(forward[1], -1, 1)), -POLE, POLE)
        distance = float((self._home[1] - eye) @ forward)
        if not distance > MIN_RADII * self.radius:  # the scene lies behind or around the eye
            distance = self.radius
        right, up, ahead = axes_of(yaw, pitch)
        roll = float(np.arctan2(-axes[:, 1] @ right, axes[:, 1] @ up))
        level = 0.0 if abs(roll) <= np.pi / 2 else float(np.copysign(np.pi, roll))
        self.fov_y = fov_y
        log_distance = self._bounded(np.log(distance))
        self.framed = BY_HAND
        # The reach is bounded, so the anchor follows from it: the eye must not move.
        anchor = eye if self.flying else eye + np.exp(log_distance) * ahead
        self._goal = np.r_[anchor, yaw, pitch, log_distance, level]
        self._lag[:] = 0
        self._lag[ROLL] = level - roll
        self._velocity[:] = 0

    def go_to(self, eye: np.ndarray, target: np.ndarray, fov_y: float) -> None:
        """Flies to eye (3,), level, from where it looks at target (3,) and orbits about it."""
        ahead = np.asarray(target, np.float64) - eye
        distance = np.exp(self._bounded(np.log(max(float(np.linalg.norm(ahead)), 1e-9))))
        ahead /= np.linalg.norm(ahead)
        yaw = float(np.arctan2(-ahead[0], -ahead[2]))
        yaw = self._goal[YAW] + _half_turn_at_most(yaw - self._goal[YAW])
        pitch = float(np.arcsin(np.clip(ahead[1], -1, 1)))
        self.fov_y = fov_y
        self._stand(eye + distance * ahead, yaw, pitch, distance)

    def reset(self) -> None:
        """Back to the first view of the scene."""
        view, centre, radius = self._home
        self.radius = radius
        self.fov_y = fov_y_of(view)
        eye, forward = view.world_from_eye.position, -view.world_from_eye.matrix()[:3, 2]
        yaw = np.arctan2(-forward[0], -forward[2])
        yaw = self._goal[YAW] + _half_turn_at_most(yaw - self._goal[YAW])
        pitch = np.clip(np.arcsin(np.clip(forward[1], -1, 1)), -POLE, POLE)
        distance = float((centre - eye) @ forward)
        if not distance > MIN_RADII * radius:  # the scene lies behind or around the eye
            distance = radius
        self._stand(eye + distance * forward, yaw, pitch, distance)
        self.framed = FIRST

    def come_home(self, view: View) -> None:
        """Another first view, of a window of another size."""
        self._home = (view, *self._home[1:])
        self.reset()

    def _axes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Right, up and forward (3,) of where the camera is going."""
        return axes_of(self._goal[YAW], self._goal[PITCH], self._goal[ROLL])

    def _stand(
        self, target: np.ndarray, yaw: float, pitch: float, distance: float, roll: float = 0.0
    ) -> None:
        """Sets the goal from orbit's terms, whichever mode is on."""
        anchor = target - self.flying * distance * axes_of(yaw, pitch)[2]
        self._move_to(np.r_[anchor, yaw, pitch, self._bounded(np.log(distance)), roll])

    def _reanchor(self, distance: float) -> None:
        """Slides the orbit's anchor along the line of sight; eye and picture stay."""
        goal, shown = self._goal, self._goal - self._lag
        log_distance = self._bounded(np.log(max(distance, 1e-9)))
        for state in (goal, shown):
            forward = axes_of(state[YAW], state[PITCH])[2]
            state[ANCHOR] += (np.exp(log_distance) - np.exp(state[LOG_DISTANCE])) * forward
            state[LOG_DISTANCE] = log_distance
        self._lag = goal - shown

    def _move_to(self, goal: np.ndarray) -> None:
        """A new goal; what is shown stays and will catch up."""
        self.framed = BY_HAND
        self._lag += goal - self._goal
        self._goal = goal

    def _eye(self, state: np.ndarray) -> np.ndarray:
        if self.flying:
            return state[ANCHOR].copy()
        forward = axes_of(state[YAW], state[PITCH])[2]
        return state[ANCHOR] - np.exp(state[LOG_DISTANCE]) * forward

    def _bounded(self, log_distance: float) -> float:
        low, high = np.log(np.array([MIN_RADII, MAX_RADII]) * self.radius)
        return float(np.clip(log_distance, low, high))


def _tangents(fov_y: float, size: tuple[int, int], free: Box) -> tuple[float, float, float, float]:
    """Tangents of the whole picture when `fov_y` is the height of its free part."""
    left, top, right, bottom = free
    per_pixel = 2 * float(np.tan(fov_y / 2)) / (bottom - top)
    x, y = (left + right) / 2, (top + bottom) / 2
    width, height = size
    return (-x * per_pixel, (width - x) * per_pixel, (y - height) * per_pixel, y * per_pixel)


def _half_turn_at_most(angle: float) -> float:
    """The same turn in -pi..pi."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)
