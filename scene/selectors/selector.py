"""Parts of an object that have a control of their own: the paper's selective visualisation.

Each selector gives every place a weight: 1 inside, and over `border` metres outside smoothly 0.
Its x, a number or a blend of stops, is mixed in by that weight; of several, a later one lies over
an earlier one.  A selector is
fixed to its object (space "object", metres in its frame), or stands in the world (space "world"),
so that a moved object passes through it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.shapes import four, three
from shapeshift.runtime_models.stop_weights import Control, check_control
from shapeshift.scene.pose import UNIT_SLACK, Pose

SPACES = ("object", "world")
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class _Placed:
    """What every selector with a shape has."""

    x: Control  # inside
    border: float = 0.0  # metres outside the shape over which the weight falls to 0
    space: str = "object"  # one of SPACES

    def __post_init__(self) -> None:
        check_control(self.x, _name(self))
        _check(self, "border", 0 <= self.border < math.inf, "metres, 0 or more")
        _check(self, "space", self.space in SPACES, " or ".join(SPACES))

    def distance(self, places: np.ndarray) -> np.ndarray:
        """(N,) metres from the surface, negative inside, of places (N, 3) in its space."""
        raise TypeError(f"{_name(self)} has no shape of its own.")

    def weights(self, places: np.ndarray) -> np.ndarray:
        """(N,) float32, 0..1, at places (N, 3) in its space; 0 where a place is not finite."""
        distance = self.distance(np.asarray(places, np.float64))
        if self.border == 0:
            return (distance <= 0).astype(np.float32)
        outside = np.clip(distance / self.border, 0, 1)  # NaN stays
        weights = 1 - outside * outside * (3 - 2 * outside)
        return np.where(distance < self.border, weights, 0).astype(np.float32)


@dataclass(frozen=True, kw_only=True)
class Box(_Placed):
    """A turned box."""

    centre: tuple[float, float, float]  # metres
    half: tuple[float, float, float]  # half its sides, metres
    wxyz: tuple[float, float, float, float] = UPRIGHT

    def __post_init__(self) -> None:
        super().__post_init__()
        _floats(self, "centre", 3)
        _floats(self, "half", 3)
        _check(self, "half", min(self.half) >= 0, "metres, 0 or more")
        _unit(self, "wxyz", 4)

    def distance(self, places: np.ndarray) -> np.ndarray:
        axes = Pose(np.zeros(3), np.array(self.wxyz)).matrix()[:3, :3]
        beyond = np.abs((places - self.centre) @ axes) - self.half  # (N, 3) metres, a side
        outside = np.linalg.norm(np.maximum(beyond, 0), axis=1)
        return outside + np.minimum(beyond.max(axis=1, initial=-math.inf), 0)


@dataclass(frozen=True, kw_only=True)
class Sphere(_Placed):
    centre: tuple[float, float, float]  # metres
    radius: float  # metres

    def __post_init__(self) -> None:
        super().__post_init__()
        _floats(self, "centre", 3)
        _check(self, "radius", 0 <= self.radius < math.inf, "metres, 0 or more")

    def distance(self, places: np.ndarray) -> np.ndarray:
        return np.linalg.norm(places - self.centre, axis=1) - self.radius


@dataclass(frozen=True, kw_only=True)
class HalfSpace(_Placed):
    """All on one side of a plane: the side that its normal points away from."""

    point: tuple[float, float, float]  # on the plane, metres
    normal: tuple[float, float, float]  # out of it, any length

    def __post_init__(self) -> None:
        super().__post_init__()
        _floats(self, "point", 3)
        _floats(self, "normal", 3)
        length = math.hypot(*self.normal)
        _check(self, "normal", 0 < length < math.inf, "a direction, not zero")
        if abs(length - 1) > 1e-12:  # a unit normal stays to the bit, so that files keep it
            object.__setattr__(self, "normal", tuple(n / length for n in self.normal))

    def distance(self, places: np.ndarray) -> np.ndarray:
        return (places - self.point) @ np.array(self.normal)


@dataclass(frozen=True, kw_only=True)
class Lens(_Placed):
    """What a camera sees: a cone about its view, or a pyramid in the shape of a picture.

    Looks along -Z of its pose.  The app moves it with the camera.
    """

    position: tuple[float, float, float]  # of the apex, metres
    wxyz: tuple[float, float, float, float]
    half_angle: float | None = None  # radians, of a cone
    tangents: tuple[float, float, float, float] | None = None  # left, right, down, up; a pyramid
    space: str = "world"

    def __post_init__(self) -> None:
        super().__post_init__()
        _floats(self, "position", 3)
        _unit(self, "wxyz", 4)
        if (self.half_angle is None) == (self.tangents is None):
            raise ValueError("Lens wants either half_angle or tangents.")
        if self.half_angle is not None:
            acute = 0 < self.half_angle < math.pi / 2
            _check(self, "half_angle", acute, "radians between 0 and pi/2")
        if self.tangents is not None:
            _floats(self, "tangents", 4)
            left, right, down, up = self.tangents
            _check(self, "tangents", left < right and down < up, "left < right and down < up")

    def distance(self, places: np.ndarray) -> np.ndarray:
        axes = Pose(np.zeros(3), np.array(self.wxyz)).matrix()[:3, :3]
        across, up, back = ((places - self.position) @ axes).T  # (N,) metres each
        depth = -back
        if self.tangents is not None:
            low_x, high_x, low_y, high_y = self.tangents
            sides = (
                (low_x * depth - across) / math.hypot(1, low_x),
                (across - high_x * depth) / math.hypot(1, high_x),
                (low_y * depth - up) / math.hypot(1, low_y),
                (up - high_y * depth) / math.hypot(1, high_y),
            )
            return np.max(sides, axis=0)  # from the farthest plane: its edges are sharp
        assert self.half_angle is not None, "a cone where it is no pyramid"
        radius = np.hypot(across, up)
        cos, sin = math.cos(self.half_angle), math.sin(self.half_angle)
        apex_is_nearest = depth * cos + radius * sin < 0
        from_side = radius * cos - depth * sin
        return np.where(apex_is_nearest, np.hypot(radius, depth), from_side)


@dataclass(frozen=True, eq=False)
class Painted:
    """Anchors chosen one by one; plain splats of SplatLayers likewise."""

    weight: np.ndarray  # (A,) float32 0..1, or bool
    x: Control

    def __post_init__(self) -> None:
        check_control(self.x, "Painted")
        weight = np.asarray(self.weight, np.float32)
        if weight.ndim != 1 or not ((weight >= 0) & (weight <= 1)).all():
            raise ValueError(
                f"Painted has weights of shape {weight.shape}; one an anchor, 0 to 1, is wanted."
            )
        object.__setattr__(self, "weight", weight)

    @staticmethod
    def of(indices: Sequence[int], count: int, x: Control) -> "Painted":
        """These of `count` anchors, entirely."""
        weight = np.zeros(count, np.float32)
        weight[np.asarray(indices, int)] = 1
        return Painted(weight, x)

    @property
    def space(self) -> str:
        return "object"

    def weights(self, places: np.ndarray) -> np.ndarray:
        """(A,) float32, whatever the places (A, 3); ValueError if these are others."""
        if len(places) != len(self.weight):
            raise ValueError(
                f"Painted has {len(self.weight):,} weights for {len(places):,} anchors; paint the "
                "object anew."
            )
        return self.weight

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Painted) or self.x != other.x:
            return False
        return self.weight is other.weight or np.array_equal(self.weight, other.weight)

    __hash__ = None  # type: ignore[assignment]  # compared by its array: not for sets or keys


Selector = Box | Sphere | HalfSpace | Lens | Painted


def carried(selector: Selector, world_from_before: Pose) -> Selector:
    """What stands in the world after it is moved; what is fixed to an object goes with that."""
    if selector.space != "world":
        return selector
    moves = world_from_before.matrix()
    if isinstance(selector, HalfSpace):
        point = moves[:3, :3] @ selector.point + moves[:3, 3]
        return replace(selector, point=three(point), normal=three(moves[:3, :3] @ selector.normal))
    assert not isinstance(selector, Painted), "painted regions are fixed to their object"
    centre = selector.position if isinstance(selector, Lens) else selector.centre
    wxyz = UPRIGHT if isinstance(selector, Sphere) else selector.wxyz
    before = Pose(np.array(centre), np.array(wxyz))
    now = Pose.from_matrix(moves @ before.matrix())
    position, turned = three(now.position), four(now.wxyz)
    if isinstance(selector, Lens):
        return replace(selector, position=position, wxyz=turned)
    if isinstance(selector, Box):
        return replace(selector, centre=position, wxyz=turned)
    return replace(selector, centre=position)


def _name(selector: object) -> str:
    return type(selector).__name__


def _check(selector: object, field: str, fits: bool, wanted: str) -> None:
    if not fits:
        found = getattr(selector, field)
        raise ValueError(f"{_name(selector)} has {field} = {found}; {wanted} is wanted.")


def _floats(selector: object, field: str, count: int) -> None:
    """Makes a tuple of floats of any row of `count` numbers, so that selectors can be compared."""
    row = tuple(float(n) for n in getattr(selector, field))
    object.__setattr__(selector, field, row)
    fits = len(row) == count and all(map(math.isfinite, row))
    _check(selector, field, fits, f"{count} finite numbers")


def _unit(selector: object, field: str, count: int) -> None:
    _floats(selector, field, count)
    length = math.hypot(*getattr(selector, field))
    _check(selector, field, abs(length - 1) <= UNIT_SLACK, "a unit quaternion")
