"""Sections: planes and boxes that cut what is drawn, or show another stop beyond them.

A section keeps what lies in all of its half spaces: one of a plane, six of a box.  It is fixed to
its object (space "object", metres in its frame), or stands in the world (space "world"), so that a
moved object passes through it.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.shapes import four, three
from shapeshift.runtime_models.stop_weights import Control, check_control
from shapeshift.scene.pose import UNIT_SLACK, Pose

SPACES = ("object", "world")  # the first is usual where an object has a section of its own
# capped: splats that a section crosses are cut and reshaped; hard: a splat is there or not by its
# centre; soft: its opacity falls to 0 over a width inside, by its centre.
CAPPED, HARD, SOFT = EDGES = ("capped", "hard", "soft")
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
FARTHEST_M = 1e6  # metres of a plane from the origin, of a box and its sides


@dataclass(frozen=True)
class PlaneShape:
    """Keeps the places p with normal . p <= offset_m: the side that the normal points away from."""

    normal: tuple[float, float, float]  # of length 1, made so from any length
    offset_m: float  # metres along it from the origin

    def __post_init__(self) -> None:
        length = math.hypot(*self.normal)
        if not (len(self.normal) == 3 and 1e-12 < length < math.inf):
            raise ValueError(
                f"the normal is {_text(self.normal)}; a direction, not zero, is wanted."
            )
        if abs(length - 1) > 1e-12:  # a unit normal stays to the bit, so that files keep it
            object.__setattr__(self, "normal", tuple(n / length for n in self.normal))
            object.__setattr__(self, "offset_m", self.offset_m / length)
        if not abs(self.offset_m) <= FARTHEST_M:
            raise ValueError(
                f"the plane lies {self.offset_m:g} m from the origin; within {FARTHEST_M:g} is "
                "wanted."
            )

    @property
    def point(self) -> np.ndarray:
        """(3,) metres: the place of the plane that is nearest to the origin."""
        return np.array(self.normal) * self.offset_m


@dataclass(frozen=True)
class BoxShape:
    """Keeps what lies in a turned box."""

    centre: tuple[float, float, float]  # metres
    half: tuple[float, float, float]  # half its sides, metres
    wxyz: tuple[float, float, float, float] = UPRIGHT

    def __post_init__(self) -> None:
        if not (len(self.centre) == 3 and all(abs(c) <= FARTHEST_M for c in self.centre)):
            raise ValueError(f"centre is {_text(self.centre)}; three finite metres are wanted.")
        if not (len(self.half) == 3 and all(0 < h <= FARTHEST_M for h in self.half)):
            raise ValueError(f"half is {_text(self.half)}; three metres above 0 are wanted.")
        if not (len(self.wxyz) == 4 and abs(math.hypot(*self.wxyz) - 1) <= UNIT_SLACK):
            raise ValueError(f"wxyz is {_text(self.wxyz)}; a quaternion of length 1 is wanted.")

    @property
    def axes(self) -> np.ndarray:
        """(3, 3) columns are the directions of its sides."""
        return Pose(np.zeros(3), np.array(self.wxyz)).matrix()[:3, :3]


@dataclass(frozen=True, kw_only=True)
class SceneSection:
    """Outside of its shape an object is absent, or, with `beyond`, at another control."""

    shape: PlaneShape | BoxShape
    edge: str = CAPPED  # one of EDGES; with `beyond` capped does what hard does
    width_m: float = 0.0  # metres inside the shape over which a soft edge falls to 0
    beyond: Control | None = None  # what the outside shows; None: nothing
    space: str = "world"  # one of SPACES
    enabled: bool = True  # False: it is kept, and cuts nothing

    def __post_init__(self) -> None:
        if self.edge not in EDGES:
            raise ValueError(f"edge is '{self.edge}'; {', '.join(EDGES)} are known.")
        if self.space not in SPACES:
            raise ValueError(f"space is '{self.space}'; {' or '.join(SPACES)} is wanted.")
        if not 0 <= self.width_m <= FARTHEST_M:
            raise ValueError(f"width_m is {self.width_m:g}; metres, 0 or more, are wanted.")
        if self.edge == SOFT and self.width_m == 0:
            raise ValueError("a soft edge wants width_m above 0; 'hard' is without a width.")
        if self.edge != SOFT and self.width_m > 0:
            raise ValueError(f"width_m is of a soft edge; this one is {self.edge}.")
        if self.beyond is not None:
            check_control(self.beyond, "a section")

    @property
    def half_spaces(self) -> np.ndarray:
        """(F, 4) float64 in its space: kept is where normal . place <= the fourth number."""
        if isinstance(self.shape, PlaneShape):
            return np.array([[*self.shape.normal, self.shape.offset_m]])
        axes, centre = self.shape.axes, np.array(self.shape.centre)
        normals = np.concatenate([axes.T, -axes.T])  # (6, 3)
        offsets = normals @ centre + np.array(self.shape.half * 2)
        return np.column_stack([normals, offsets])

    def half_spaces_of(self, world_from_object: Pose) -> np.ndarray:
        """The same in the frame of an object that stands so."""
        planes = self.half_spaces
        if self.space == "object":
            return planes
        matrix = world_from_object.matrix()
        normals, offsets = planes[:, :3], planes[:, 3]
        return np.column_stack([normals @ matrix[:3, :3], offsets - normals @ matrix[:3, 3]])


def flipped(plane: PlaneShape) -> PlaneShape:
    """The plane that keeps the other side."""
    return PlaneShape(three(-n for n in plane.normal), -plane.offset_m)


def plane_through(point: np.ndarray, normal: np.ndarray) -> PlaneShape:
    """The plane through a point (3,), metres, that keeps what its normal (3,) points away from."""
    unit = np.asarray(normal, np.float64) / np.linalg.norm(normal)
    return PlaneShape(three(unit), float(unit @ point))


def moved_shape(shape: PlaneShape | BoxShape, pose: Pose) -> PlaneShape | BoxShape:
    """A shape that stood in the frame of `pose`, in the frame which that is a pose of: a plane
    that a hand holds, where the hand is now.
    """
    matrix = pose.matrix()
    if isinstance(shape, PlaneShape):
        point = matrix[:3, :3] @ shape.point + matrix[:3, 3]
        return plane_through(point, matrix[:3, :3] @ shape.normal)
    turned = np.eye(4)
    turned[:3, :3] = matrix[:3, :3] @ shape.axes
    centre = matrix[:3, :3] @ shape.centre + matrix[:3, 3]
    return BoxShape(three(centre), shape.half, four(Pose.from_matrix(turned).wxyz))


def carried_section(section: SceneSection, world_from_before: Pose) -> SceneSection:
    """What stands in the world after it is moved; what is fixed to an object goes with that."""
    if section.space != "world":
        return section
    return replace(section, shape=moved_shape(section.shape, world_from_before))


def held_by(section: SceneSection, world_from_hand: Pose) -> SceneSection:
    """A section whose shape is given in a hand's frame, where the hand is now: in the world."""
    shape = moved_shape(section.shape, world_from_hand)
    return replace(section, shape=shape, space="world")


def _text(numbers: tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{number:.6g}" for number in numbers) + ")"
