"""Shapes that a ray can hit, each in its own frame: centred on the origin, +Y its axis, metres.

Every shape answers three questions, all for many points at once:
roots(o, d) -> (k, n) distances along the rays in rising order, NaN or Inf where there is none;
normal(p) -> (n, 3), not normalised to the eye's side; distance(p) -> (n,) signed distance.
"""

from dataclasses import dataclass

import numpy as np

MARCH_STEPS = 64  # a torus is met by walking along its distance field
MARCH_HIT = 1e-5  # metres


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n,) of two (n, 3); numpy's own sum over an axis of three is ten times slower."""
    return np.einsum("ij,ij->i", a, b)


def length(v: np.ndarray) -> np.ndarray:
    """(n,) of (n, 3)."""
    return np.sqrt(dot(v, v))


def unit(v: np.ndarray) -> np.ndarray:
    """(..., 3) divided by its length; a zero vector stays zero."""
    return v / np.maximum(np.sqrt(np.einsum("...i,...i->...", v, v))[..., None], 1e-12)


@dataclass(frozen=True)
class Ball:
    radius: float

    @property
    def reach(self) -> float:
        return self.radius

    def roots(self, o: np.ndarray, d: np.ndarray) -> np.ndarray:
        b = dot(o, d)
        with np.errstate(invalid="ignore"):
            s = np.sqrt(b * b - dot(o, o) + self.radius**2)
        return np.stack([-b - s, -b + s])

    def normal(self, p: np.ndarray) -> np.ndarray:
        return p / self.radius

    def distance(self, p: np.ndarray) -> np.ndarray:
        return length(p) - self.radius


@dataclass(frozen=True)
class Cuboid:
    half: tuple[float, float, float]
    bevel: float = 1e-4  # edges are shaded as if they were rounded this much

    @property
    def reach(self) -> float:
        return float(np.linalg.norm(self.half))

    def roots(self, o: np.ndarray, d: np.ndarray) -> np.ndarray:
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (-np.asarray(self.half) - o) / d, (np.asarray(self.half) - o) / d
        low, high = np.minimum(a, b).T, np.maximum(a, b).T
        enter = np.maximum(np.maximum(low[0], low[1]), low[2])
        leave = np.minimum(np.minimum(high[0], high[1]), high[2])
        return np.where(enter < leave, np.stack([enter, leave]), np.nan)

    def normal(self, p: np.ndarray) -> np.ndarray:
        return unit(np.sign(p) * np.maximum(np.abs(p) - self.half + self.bevel, 0))

    def distance(self, p: np.ndarray) -> np.ndarray:
        q = np.abs(p) - self.half
        most = np.maximum(np.maximum(q[:, 0], q[:, 1]), q[:, 2])
        return length(np.maximum(q, 0)) + np.minimum(most, 0)


@dataclass(frozen=True)
class Cylinder:
    """A round bar along Y; two radii make it a cone; without caps it is a pipe one looks into."""

    radius: float  # at the lower end
    half: float
    top_radius: float | None = None  # None = the same
    bevel: float = 1e-4
    capped: bool = True

    @property
    def reach(self) -> float:
        return float(np.hypot(self.half, max(self.radius, self.top_radius or 0)))

    def radius_at(self, y: np.ndarray) -> np.ndarray:
        top = self.radius if self.top_radius is None else self.top_radius
        return (self.radius + top) / 2 + (top - self.radius) / (2 * self.half) * y

    def roots(self, o: np.ndarray, d: np.ndarray) -> np.ndarray:
        top = self.radius if self.top_radius is None else self.top_radius
        slope = (top - self.radius) / (2 * self.half)
        r, dr = self.radius_at(o[:, 1]), slope * d[:, 1]
        a = d[:, 0] ** 2 + d[:, 2] ** 2 - dr**2
        b = o[:, 0] * d[:, 0] + o[:, 2] * d[:, 2] - r * dr
        c = o[:, 0] ** 2 + o[:, 2] ** 2 - r**2
        with np.errstate(divide="ignore", invalid="ignore"):
            s = np.sqrt(b * b - a * c)
            side = np.stack([(-b - s) / a, (-b + s) / a])
            y = o[:, 1] + side * d[:, 1]
            side[~((np.abs(y) <= self.half) & (self.radius_at(y) >= 0))] = np.inf
            if not self.capped:
                return np.sort(side, axis=0)
            cap = np.stack([(-self.half - o[:, 1]) / d[:, 1], (self.half - o[:, 1]) / d[:, 1]])
            x, z = o[:, 0] + cap * d[:, 0], o[:, 2] + cap * d[:, 2]
            cap[~(x * x + z * z <= np.array([[self.radius], [top]]) ** 2)] = np.inf
        return np.sort(np.concatenate([side, cap]), axis=0)

    def normal(self, p: np.ndarray) -> np.ndarray:
        across = np.hypot(p[:, 0], p[:, 2])
        out = np.maximum(across - self.radius_at(p[:, 1]) + self.bevel, 0) / np.maximum(
            across, 1e-9
        )
        up = np.sign(p[:, 1]) * np.maximum(np.abs(p[:, 1]) - self.half + self.bevel, 0)
        top = self.radius if self.top_radius is None else self.top_radius
        lean = out * across * (self.radius - top) / (2 * self.half)
        return unit(np.stack([p[:, 0] * out, up + lean, p[:, 2] * out], axis=1))

    def distance(self, p: np.ndarray) -> np.ndarray:
        out = np.hypot(p[:, 0], p[:, 2]) - self.radius_at(p[:, 1])
        up = np.abs(p[:, 1]) - self.half
        return np.hypot(np.maximum(out, 0), np.maximum(up, 0)) + np.minimum(np.maximum(out, up), 0)


@dataclass(frozen=True)
class Ring:
    """A torus about Y, or the part of it within `half_angle` of +X: handwheels and pipe bends."""

    major: float
    minor: float
    half_angle: float = float(np.pi)  # radians

    @property
    def reach(self) -> float:
        return self.major + self.minor

    def core(self, p: np.ndarray) -> np.ndarray:
        """The nearest point of the circle in the middle of the pipe, (n, 3)."""
        angle = np.clip(np.arctan2(p[:, 2], p[:, 0]), -self.half_angle, self.half_angle)
        return self.major * np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)

    def roots(self, o: np.ndarray, d: np.ndarray) -> np.ndarray:
        b = dot(o, d)
        with np.errstate(invalid="ignore"):
            s = np.sqrt(b * b - dot(o, o) + self.reach**2)
        t, end = np.maximum(-b - s, 0), -b + s
        t = np.where(end > 0, t, np.nan)
        hit = np.zeros(len(t), bool)
        for _ in range(MARCH_STEPS):
            walking = np.flatnonzero(~hit & (t <= end))
            if not len(walking):
                break
            step = self.distance(o[walking] + t[walking, None] * d[walking])
            hit[walking] = step < MARCH_HIT
            t[walking] += np.maximum(step, 0)
        return np.where(hit, t, np.nan)[None]

    def normal(self, p: np.ndarray) -> np.ndarray:
        return unit(p - self.core(p))

    def distance(self, p: np.ndarray) -> np.ndarray:
        return length(p - self.core(p)) - self.minor


@dataclass(frozen=True)
class Disc:
    """A flat round plate without thickness in the plane y = 0."""

    radius: float

    @property
    def reach(self) -> float:
        return self.radius

    def roots(self, o: np.ndarray, d: np.ndarray) -> np.ndarray:
        with np.errstate(divide="ignore", invalid="ignore"):
            t = -o[:, 1] / d[:, 1]
            x, z = o[:, 0] + t * d[:, 0], o[:, 2] + t * d[:, 2]
        return np.where(x * x + z * z < self.radius**2, t, np.nan)[None]

    def normal(self, p: np.ndarray) -> np.ndarray:
        return np.tile([0.0, 1.0, 0.0], (len(p), 1))

    def distance(self, p: np.ndarray) -> np.ndarray:
        outside = np.maximum(np.hypot(p[:, 0], p[:, 2]) - self.radius, 0)
        return np.hypot(outside, p[:, 1])
