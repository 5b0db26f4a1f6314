"""Rays against a tree of solids, light on what they meet, and photos of it with exact poses."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from shapeshift.scene.pose import View
from shapeshift.training.synthetic.solids import (
    Ball,
    Cuboid,
    Cylinder,
    Disc,
    Ring,
    dot,
    unit,
)

Pattern = Callable[[np.ndarray], np.ndarray]  # local points (n, 3) metres -> (n, 3) or (n,)
NEAREST = 1e-4  # metres; a hit nearer than this is the surface the ray starts on
LIFT = 1e-3  # metres; shadow rays start this far above the surface
EDGE = 0.06  # a pixel that differs this much from a neighbour is sampled more finely


@dataclass(frozen=True)
class Material:
    color: Pattern | tuple[float, float, float] = (0.7, 0.7, 0.7)  # display sRGB
    celsius: Pattern | float = 22.0
    gloss: float = 0.0  # strength of the highlight
    shininess: float = 30.0  # Blinn's exponent
    mirror: float = 0.0  # how much of the bright sky a surface reflects


@dataclass(frozen=True)
class Solid:
    shape: Ball | Cuboid | Cylinder | Ring | Disc
    surface: Material
    world_from_local: np.ndarray = field(default_factory=lambda: np.eye(4))
    keep: Callable[[np.ndarray], np.ndarray] | None = None  # local points; False = cut away

    @property
    def centre(self) -> np.ndarray:
        return self.world_from_local[:3, 3]

    def local(self, points: np.ndarray) -> np.ndarray:
        return (points - self.centre) @ self.world_from_local[:3, :3]

    def distance(self, points: np.ndarray) -> np.ndarray:
        """(n,) metres from world points; what is cut open counts as a thin shell."""
        p = self.local(points)
        d = self.shape.distance(p)
        return d if self.keep is None else np.where(self.keep(p), np.abs(d), np.inf)

    def nearest(self, o: np.ndarray, d: np.ndarray) -> np.ndarray:
        """(n,) distance to the first hit that is not cut away, Inf without one."""
        o, d = self.local(o), d @ self.world_from_local[:3, :3]
        best = np.full(len(d), np.inf)
        for t in self.shape.roots(o, d)[::-1]:
            with np.errstate(invalid="ignore"):
                good = (t > NEAREST) & (t < np.inf)
            if self.keep is not None:
                good[good] = self.keep(o[good] + t[good, None] * d[good])
            best[good] = t[good]
        return best


@dataclass(frozen=True)
class Tree:
    """A ball round solids; rays that miss it skip them all."""

    centre: np.ndarray
    reach: float
    branches: tuple = ()  # Trees, or
    leaf: int = -1  # the index of one solid


@dataclass(frozen=True)
class Place:
    solids: tuple[Solid, ...]
    tree: Tree

    @staticmethod
    def of(solids: list[Solid], first: int = 0) -> "Place":
        """`first`: how many of them, walls that would make every ball large, are met first."""
        large = tuple(grow_tree(solids, np.array([i])) for i in range(first))
        tree = grow_tree(solids, np.arange(first, len(solids)))
        return Place(tuple(solids), Tree(np.zeros(3), np.inf, (*large, tree)) if first else tree)


@dataclass(frozen=True)
class Light:
    """A key light far away, and a sky that reaches wherever nothing is close."""

    towards: tuple[float, float, float] = (0.4, 0.77, 0.5)
    key: tuple[float, float, float] = (0.7, 0.7, 0.7)
    sky: tuple[float, float, float] = (0.3, 0.3, 0.3)  # from above
    ground: tuple[float, float, float] = (0.3, 0.3, 0.3)  # from below
    in_shadow: float = 0.25  # part of the key light that reaches a shadow
    spread: float = 0.0  # radians; 0 = one shadow ray, hard shadows


@dataclass(frozen=True)
class Hits:
    distance: np.ndarray  # (n,) metres, Inf = nothing
    index: np.ndarray  # (n,) which solid, -1 = nothing
    points: np.ndarray  # (n, 3), zero where nothing
    normals: np.ndarray  # (n, 3) towards the eye


def grow_tree(solids: list[Solid], which: np.ndarray) -> Tree:
    centres = np.array([solids[i].centre for i in which])
    reaches = np.array([solids[i].shape.reach for i in which])
    low, high = (centres - reaches[:, None]).min(0), (centres + reaches[:, None]).max(0)
    middle = (low + high) / 2
    reach = float((np.linalg.norm(centres - middle, axis=1) + reaches).max())
    if len(which) == 1:
        return Tree(centres[0], float(reaches[0]), leaf=int(which[0]))
    order = which[np.argsort(centres[:, int(np.argmax(np.ptp(centres, axis=0)))], kind="stable")]
    half = len(order) // 2
    return Tree(middle, reach, (grow_tree(solids, order[:half]), grow_tree(solids, order[half:])))


def may_hit(tree: Tree, o: np.ndarray, d: np.ndarray, best: np.ndarray | None = None) -> np.ndarray:
    """(n,) whether rays meet the ball; best (n,) metres: and not behind what they have met."""
    if tree.reach == np.inf:
        return np.ones(len(d), bool)
    to_centre = tree.centre - o
    along = dot(to_centre, d)
    across2 = dot(to_centre, to_centre) - along**2
    met = (across2 <= tree.reach**2 * (1 + 1e-9)) & (along > -tree.reach)
    if best is not None:
        met &= along - tree.reach < best  # the ball begins nearer
    return met


def trace(place: Place, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rays (n, 3), (n, 3) unit -> distance of the first hit (n,), index of its solid (n,)."""
    best, index = np.full(len(d), np.inf), np.full(len(d), -1)

    def visit(tree: Tree, rays: np.ndarray) -> None:
        rays = rays[may_hit(tree, o[rays], d[rays], best[rays])]
        if not len(rays):
            return
        for branch in tree.branches:
            visit(branch, rays)
        if tree.leaf >= 0:
            t = place.solids[tree.leaf].nearest(o[rays], d[rays])
            nearer = t < best[rays]
            best[rays[nearer]], index[rays[nearer]] = t[nearer], tree.leaf

    visit(place.tree, np.arange(len(d)))
    return best, index


def blocked(place: Place, o: np.ndarray, d: np.ndarray) -> np.ndarray:
    """(n,) whether anything at all lies on the rays; a ray that met something is done."""
    met = np.zeros(len(o), bool)

    def visit(tree: Tree, rays: np.ndarray) -> None:
        rays = rays[~met[rays]]
        rays = rays[may_hit(tree, o[rays], d[rays])]
        if not len(rays):
            return
        for branch in tree.branches:
            visit(branch, rays)
        if tree.leaf >= 0:
            met[rays] = place.solids[tree.leaf].nearest(o[rays], d[rays]) < np.inf

    visit(place.tree, np.arange(len(o)))
    return met


def look(place: Place, o: np.ndarray, d: np.ndarray) -> Hits:
    distance, index = trace(place, o, d)
    hit = index >= 0
    points = np.where(hit[:, None], o + np.where(hit, distance, 0)[:, None] * d, 0)
    normals = np.zeros_like(points)
    for i in np.unique(index[hit]):
        solid, here = place.solids[i], index == i
        normals[here] = solid.shape.normal(solid.local(points[here])) @ (
            solid.world_from_local[:3, :3].T
        )
    away = dot(normals, d) > 0
    return Hits(distance, index, points, np.where(away[:, None], -normals, normals))


def pattern_at(place: Place, hits: Hits, name: str, width: int) -> np.ndarray:
    """(n, width) of the surfaces' field `name`, zero where nothing was hit."""
    out = np.zeros((len(hits.index), width))
    for i in np.unique(hits.index[hits.index >= 0]):
        here, solid = hits.index == i, place.solids[i]
        value = getattr(solid.surface, name)
        value = np.asarray(value(solid.local(hits.points[here])) if callable(value) else value)
        out[here] = np.reshape(value, (-1, width))
    return out


def lit_share(place: Place, hits: Hits, light: Light) -> np.ndarray:
    """(n,) 0..1: how much of the key light arrives; three rays over its disc make a soft edge."""
    here = np.flatnonzero(hits.index >= 0)
    towards = unit(np.array(light.towards))
    side = unit(np.cross(towards, (0.0, 0.0, 1.0)))
    turns = np.arange(3) * 2 * np.pi / 3 + 0.4 if light.spread else np.zeros(1)
    swing = np.cos(turns)[:, None] * side + np.sin(turns)[:, None] * np.cross(towards, side)
    to_light = unit(towards + light.spread * swing)  # (rays a point, 3)
    which, point = np.nonzero((hits.normals[here] @ to_light.T).T > 0)
    start = hits.points[here[point]] + LIFT * hits.normals[here[point]]
    free = ~blocked(place, start, to_light[which])
    return np.bincount(here[point], free / len(turns), minlength=len(hits.index))


def shade(
    place: Place, hits: Hits, d: np.ndarray, light: Light, openness: np.ndarray | float = 1.0
) -> np.ndarray:
    """(n, 3) display sRGB: Lambert and Blinn for the key light, `openness` (n,) for the sky."""
    color, gloss = pattern_at(place, hits, "color", 3), pattern_at(place, hits, "gloss", 1)
    towards, share = unit(np.array(light.towards)), lit_share(place, hits, light)
    facing = np.maximum(hits.normals @ towards, 0)
    upness = (0.5 + 0.5 * hits.normals[:, 1])[:, None]
    around = upness * light.sky + (1 - upness) * np.array(light.ground)
    around = around * np.broadcast_to(openness, len(d))[:, None]
    key = (facing * (light.in_shadow + (1 - light.in_shadow) * share))[:, None] * light.key
    halfway = np.maximum(dot(hits.normals, unit(towards - d)), 0)
    shininess = pattern_at(place, hits, "shininess", 1)[:, 0]
    highlight = gloss * (share * halfway**shininess)[:, None]
    mirror = pattern_at(place, hits, "mirror", 1)
    if mirror.any():
        upwards = d[:, 1] - 2 * dot(d, hits.normals) * hits.normals[:, 1]
        sky = np.clip(0.5 + 1.5 * upwards, 0, 1) * np.broadcast_to(openness, len(d))
        highlight = highlight + mirror * sky[:, None] * np.array(light.sky)
    return np.clip(color * (around + key) + highlight, 0, 1)


def pixel_rays(view: View, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """(n, 3) unit world directions through image points; (0, 0) is the upper left corner."""
    left, right, down, up = view.tangents
    width, height = view.size
    x, y = left + (right - left) * columns / width, up - (up - down) * rows / height
    return unit(np.stack([x, y, -np.ones_like(x)], 1) @ view.world_from_eye.matrix()[:3, :3].T)


def photograph(
    view: View, radiance: Callable[[np.ndarray, np.ndarray], tuple], samples: int = 2
) -> tuple[np.ndarray, np.ndarray]:
    """One photo: radiance(origins, directions) -> color (n, 3), index (n,), -1 = background.

    Returns (H, W, 3) float32 and the share of each pixel that is not background, (H, W) float32.
    Pixels at edges are the mean of samples x samples rays, the others of one ray.
    """
    width, height = view.size
    rows, columns = (g.ravel() + 0.5 for g in np.mgrid[:height, :width])
    eye = np.asarray(view.world_from_eye.position)

    def sample(columns: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        d = pixel_rays(view, columns, rows)
        color, index = radiance(np.broadcast_to(eye, d.shape), d)
        return np.concatenate([color, index[:, None] >= 0], axis=1), index

    image, index = sample(columns, rows)
    fine = np.flatnonzero(at_edges(image.reshape(height, width, 4), index.reshape(height, width)))
    if samples > 1 and len(fine):
        steps = (np.arange(samples) + 0.5) / samples - 0.5
        x, y = (g.reshape(-1, 1) for g in np.meshgrid(steps, steps))
        inner, _ = sample((columns[fine] + x).ravel(), (rows[fine] + y).ravel())
        image[fine] = inner.reshape(samples**2, -1, 4).mean(axis=0)
    image = image.reshape(height, width, 4).astype(np.float32)
    return image[..., :3], image[..., 3]


def depth_under(place: Place, view: View) -> np.ndarray:
    """(H, W) float64 metres along the view at each pixel's centre, 0 where nothing is."""
    width, height = view.size
    rows, columns = (g.ravel() + 0.5 for g in np.mgrid[:height, :width])
    d = pixel_rays(view, columns, rows)
    distance, index = trace(place, np.broadcast_to(view.world_from_eye.position, d.shape), d)
    along = -d @ view.world_from_eye.matrix()[:3, 2]
    return np.where(index >= 0, np.where(index >= 0, distance, 0) * along, 0).reshape(height, width)


def at_edges(image: np.ndarray, index: np.ndarray) -> np.ndarray:
    """(H, W) whether a pixel and one of its four neighbours differ in colour or in solid."""
    out = np.zeros(index.shape, bool)
    for axis in (0, 1):
        step = (np.abs(np.diff(image, axis=axis)).max(-1) > EDGE) | (np.diff(index, axis=axis) != 0)
        first = (slice(None),) * axis
        out[(*first, slice(1, None))] |= step
        out[(*first, slice(None, -1))] |= step
    return out


def surface_points(
    place: Place, views: list[View], count: int, noise: float, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """(count, 3) points on what the views see, noise metres of scatter; their solids (count,)."""
    random = np.random.default_rng(seed)
    points, solids = [], []
    for view in views:
        pixels = random.random((4 * count // len(views), 2)) * view.size
        d = pixel_rays(view, pixels[:, 0], pixels[:, 1])
        eye = np.broadcast_to(np.asarray(view.world_from_eye.position), d.shape)
        distance, index = trace(place, eye, d)
        hit = index >= 0
        points.append(eye[hit] + distance[hit, None] * d[hit])
        solids.append(index[hit])
    pick = random.permutation(sum(map(len, points)))[:count]
    scatter = noise * random.standard_normal((len(pick), 3))
    return np.concatenate(points)[pick] + scatter, np.concatenate(solids)[pick]


def color_of(place: Place, points: np.ndarray, solids: np.ndarray) -> np.ndarray:
    """(n, 3) the unlit paint of points (n, 3) that lie on solids (n,)."""
    out = np.zeros(points.shape)
    for i in np.unique(solids):
        solid, mine = place.solids[i], solids == i
        color = solid.surface.color
        out[mine] = np.asarray(color(solid.local(points[mine])) if callable(color) else color)
    return out
