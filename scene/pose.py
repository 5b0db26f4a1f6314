"""Poses and views.  World is metres, +Y up, right-handed, the eye looks along -Z (OpenGL, OpenXR).

Name transforms by what they give and take:  p_world = world_from_object @ p_object.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from shapeshift.runtime_models.shapes import four

# OpenCV axes (x right, y down, z forward) from eye axes (x right, y up, -z forward).
MOST_SIDE = 65536  # pixels
UNIT_SLACK = 1e-3  # of a quaternion's length: turns added up in float32 drift less
OPENCV_FROM_EYE = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Pose:
    position: np.ndarray  # (3,) metres
    wxyz: np.ndarray  # (4,) unit quaternion, w first

    def matrix(self) -> np.ndarray:
        """(4, 4) float64 parent_from_local; its columns are the local axes in the parent."""
        w, x, y, z = self.wxyz
        out = np.eye(4)
        out[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        out[:3, 3] = self.position
        return out

    @staticmethod
    def from_matrix(parent_from_local: np.ndarray) -> "Pose":
        """The pose of a rigid (4, 4) matrix; its rotation must be orthonormal."""
        m = np.asarray(parent_from_local, np.float64)
        r = m[:3, :3]
        # The largest of the four squared components is found first: no division by nearly 0.
        square = 1 + np.array(
            [r[0, 0] + r[1, 1] + r[2, 2], r[0, 0] - r[1, 1] - r[2, 2],
             r[1, 1] - r[0, 0] - r[2, 2], r[2, 2] - r[0, 0] - r[1, 1]]
        )  # fmt: skip
        a, b, c = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
        d, e, f = r[1, 0] + r[0, 1], r[0, 2] + r[2, 0], r[2, 1] + r[1, 2]
        rows = [
            [square[0], a, b, c],
            [a, square[1], d, e],
            [b, d, square[2], f],
            [c, e, f, square[3]],
        ]
        q = np.array(rows[int(np.argmax(square))])
        return Pose(m[:3, 3].copy(), q / np.linalg.norm(q))


class HiddenMesh:
    """Triangles of an eye's picture that its lens does not show; two of them are never equal.

    triangles: (T, 3, 2) tangents to the right and up.  Raises ValueError.
    """

    def __init__(self, triangles: np.ndarray) -> None:
        self.triangles = np.asarray(triangles, np.float64)
        if self.triangles.shape[1:] != (3, 2) or not np.isfinite(self.triangles).all():
            raise ValueError("a hidden mesh has triangles (T, 3, 2) of finite tangents.")


def pose_matrices(poses: Sequence[Pose]) -> np.ndarray:
    """(n, 4, 4) float64: each pose's `matrix()`, to the bit, of many at once."""
    out = np.tile(np.eye(4), (len(poses), 1, 1))
    if len(poses):
        w, x, y, z = np.array([pose.wxyz for pose in poses], np.float64).T
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        out[:, :3, :3] = np.moveaxis(np.array(rows), 2, 0)
        out[:, :3, 3] = [pose.position for pose in poses]
    return out


@dataclass(frozen=True)
class View:
    """One eye.  Desktop is a list of one, stereo a list of two."""

    world_from_eye: Pose
    tangents: tuple[float, float, float, float]  # left, right, down, up; left and down negative
    near: float  # metres
    far: float  # metres
    size: tuple[int, int]  # width, height, pixels
    # Tangents of the picture that this is a part of, where it is one: see widest_tangents.
    whole: tuple[float, float, float, float] | None = None
    # Where nobody looks, through a headset's lens: what is drawn there is nobody's loss.
    hidden: HiddenMesh | None = None
    # Tangents to the right and up of what this eye looks at, where that is known; else straight on.
    gaze: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        """Refuses what has no picture: ValueError with a sentence."""
        pose = (*self.world_from_eye.position, *self.world_from_eye.wxyz)
        text = " ".join(f"{number:.6g}" for number in pose)
        if not all(map(math.isfinite, pose)):
            raise ValueError(f"a view has the pose {text}; every number of it must be finite.")
        for tangents in (self.tangents, self.whole or self.tangents):
            left, right, down, up = tangents
            if not (-math.inf < left < right < math.inf and -math.inf < down < up < math.inf):
                raise ValueError(
                    f"a view has the tangents {tangents}; left must be less than right, and down "
                    "less than up, all finite."
                )
        if self.gaze is not None and not all(map(math.isfinite, self.gaze)):
            raise ValueError(f"a view has the gaze {self.gaze}; two finite tangents are wanted.")
        if not 0 < self.near < self.far:
            raise ValueError(
                f"a view has near {self.near} and far {self.far}; 0 < near < far is wanted, metres."
            )
        if not all(isinstance(n, int | np.integer) and 1 <= n <= MOST_SIDE for n in self.size):
            raise ValueError(
                f"a view has the size {self.size}; whole pixels, 1 to {MOST_SIDE}, are wanted."
            )
        if abs(math.hypot(*self.world_from_eye.wxyz) - 1) > UNIT_SLACK:
            raise ValueError(f"a view has the pose {text}; its quaternion must have length 1.")

    def clip_from_eye(self) -> np.ndarray:
        """(4, 4) OpenGL projection: eye metres to clip, depth -1..1, off-centre allowed."""
        left, right, down, up = self.tangents
        n, f = self.near, self.far
        return np.array(
            [
                [2 / (right - left), 0, (right + left) / (right - left), 0],
                [0, 2 / (up - down), (up + down) / (up - down), 0],
                [0, 0, (n + f) / (n - f), 2 * n * f / (n - f)],
                [0, 0, -1, 0],
            ]
        )

    def eye_from_world(self) -> np.ndarray:
        """(4, 4) float64."""
        return np.linalg.inv(self.world_from_eye.matrix())

    def pinhole(self) -> tuple[np.ndarray, float, float, float, float]:
        """camera_from_world (4, 4) with OpenCV axes; fx, fy, cx, cy in pixels, row 0 on top."""
        left, right, down, up = self.tangents
        width, height = self.size
        fx, fy = width / (right - left), height / (up - down)
        return OPENCV_FROM_EYE @ self.eye_from_world(), fx, fy, -left * fx, up * fy

    def widest_tangents(self) -> tuple[float, float]:
        """Half width and half height, as tangents, of the smallest centred picture that holds this
        one and its whole: how far aside the projection of splats follows the perspective.

        So an off-centre view is drawn as that part of the centred picture is.
        """
        every = (self.tangents, self.whole or self.tangents)
        return (
            max(max(-left, right) for left, right, _, _ in every),
            max(max(-down, up) for _, _, down, up in every),
        )

    def part(self, left: int, top: int, size: tuple[int, int]) -> "View":
        """The view of `size` pixels of this one from column `left` and row `top` (0 on top)."""
        (x, right, y, up), (width, height) = self.tangents, self.size
        across, along = (right - x) / width, (up - y) / height  # tangents a pixel
        tangents = (
            x + left * across, x + (left + size[0]) * across,
            up - (top + size[1]) * along, up - top * along,
        )  # fmt: skip
        return replace(self, tangents=tangents, size=size, whole=self.whole or self.tangents)

    @staticmethod
    def from_pinhole(
        world_from_camera: np.ndarray,
        focal: tuple[float, float],
        centre: tuple[float, float],
        size: tuple[int, int],
        near: float = 0.05,
        far: float = 1000.0,
    ) -> "View":
        """The view of a COLMAP-style camera: (4, 4) with OpenCV axes, pixels, row 0 on top."""
        (fx, fy), (cx, cy), (width, height) = focal, centre, size
        tangents = (-cx / fx, (width - cx) / fx, -(height - cy) / fy, cy / fy)
        pose = Pose.from_matrix(np.asarray(world_from_camera, np.float64) @ OPENCV_FROM_EYE)
        return View(pose, tangents, near, far, size)

    def resized(self, size: tuple[int, int]) -> "View":
        """The same field of view in another number of pixels."""
        return replace(self, size=size)

    def divided(self, factor: int) -> "View":
        """With 1 / factor of the pixels a side; what is less than a whole one at the right and at
        the bottom is cut off.
        """
        left, right, down, up = self.tangents
        (width, height) = self.size
        size = (max(width // factor, 1), max(height // factor, 1))
        across, below = (min(side, factor) * new for side, new in zip(self.size, size, strict=True))
        if across < width:
            right = left + (right - left) * across / width
        if below < height:
            down = up - (up - down) * below / height
        return View(self.world_from_eye, (left, right, down, up), self.near, self.far, size)


def look_at(eye: ArrayLike, target: ArrayLike, up: tuple = (0.0, 1.0, 0.0)) -> Pose:
    """The pose of an eye at `eye` (3,) that looks at `target` (3,), metres in the world.

    Raises ValueError where these and `up` say no direction.
    """
    back = np.asarray(eye, np.float64) - np.asarray(target, np.float64)
    if (length := np.linalg.norm(back)) > 0:
        back /= length  # before the product: captures that were made before keep their bits
    right = np.cross(np.asarray(up, np.float64), back)
    if not (length := np.linalg.norm(right)) > 0:
        raise ValueError(
            f"an eye at {eye} that looks at {target} has no direction, or that of up, {up}; "
            "move one of them, or give another up."
        )
    right /= length
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right, np.cross(back, right), back], axis=1)
    matrix[:3, 3] = eye
    return Pose.from_matrix(matrix)


def perspective(fov_y: float, size: tuple[int, int]) -> tuple[float, float, float, float]:
    """Centred tangents of a vertical field of view in radians."""
    up = float(np.tan(fov_y / 2))
    right = up * size[0] / size[1]
    return (-right, right, -up, up)


PUPILS_M = 0.064  # metres between the eyes of a person
LOOKED_FROM_M = 1.8  # metres: from where a person looks at an object


def eyes_apart(distances: np.ndarray) -> float:
    """How far apart the eyes of a person are in a scene whose scale nobody knows: the middle one of
    the distances (n,) to its splats is taken for LOOKED_FROM_M; in the scene's own unit.
    """
    middle = float(np.median(distances)) if len(distances) else LOOKED_FROM_M
    return PUPILS_M / LOOKED_FROM_M * middle


def stereo_pair(view: View, distance: float) -> list[View]:
    """Left and right eye, `distance` metres apart, parallel, about the place of `view`."""
    right = view.world_from_eye.matrix()[:3, 0]
    return [
        replace(
            view,
            world_from_eye=Pose(
                np.asarray(view.world_from_eye.position) + side * distance / 2 * right,
                view.world_from_eye.wxyz,
            ),
        )
        for side in (-1, 1)
    ]


# Orthographic views are pinhole views through a very long lens: every drawing has them at once.
# The eye goes back along the line of sight and the lens becomes as much longer, so that the plane
# in which the eye turned about something keeps its size.  What lies d metres off this plane and r
# pixels off the axis is then displaced by r d / distance pixels; from 1 / PARALLAX_PX times the
# farthest r and d on that is less than PARALLAX_PX anywhere, which nobody tells from a parallel
# projection.  Colours that depend on the direction of sight come out as those of parallel rays.

PARALLAX_PX = 0.25  # at most, of the projection of any point within the radius


def orthographic(view: View, distance: float, radius: float, near_m: float = 0.0) -> View:
    """The parallel projection along a view's line of sight, to the scale of `distance` metres.

    radius: metres from that plane within which the scene lies.  near_m: metres from the view's own
    eye before which nothing is drawn; 0: all of the scene is.
    """
    (left, right, low, high), (width, height) = view.tangents, view.size
    across = max(abs(left), abs(right)) * width / (right - left)  # pixels off the axis
    along = max(abs(low), abs(high)) * height / (high - low)
    reach = max(radius, 1e-6) * math.hypot(across, along) / PARALLAX_PX  # metres
    reach = max(reach, distance)
    back = reach - distance
    eye = view.world_from_eye
    position = eye.position + back * eye.matrix()[:3, 2]
    tangents = four(np.array(view.tangents) * distance / reach)
    near = back + near_m if near_m > 0 else max(reach - 50 * radius, view.near)
    far = reach + 50 * radius
    pose = Pose(position, eye.wxyz)
    return replace(view, world_from_eye=pose, tangents=tangents, near=near, far=max(far, 2 * near))
