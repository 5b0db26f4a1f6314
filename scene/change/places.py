"""Places where two visits differ: cells that hang together, each told apart by its kind.

A visit's surface is what its own views agree on; it has changed where the views of the other, none
of which need be the same, see through it.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from shapeshift.scene.change.seen import SeenVisit, evidence_at, pixels_of, surface_cells
from shapeshift.scene.change.similarity import (
    Similarity,
    fit_surfaces,
    rotation_of,
    surface_normals,
)
from shapeshift.scene.pose import View

# Pixels of many views in small cubes of space: what all views together say of a surface.

LEAST_VIEWS = 3  # of either visit that a cell must be seen in: one view is no evidence
DARK, BRIGHT, FEWEST = 0.02, 0.9, 100  # light, and cells, that tell an exposure
SAME_LIGHT = 0.1  # logarithm of an exposure that is none
AROUND = 8  # cells of the other visit that a colour is compared with
CONTRAST = 6.0  # Lab: less says that nobody can see whether a surface is there
UNSURE = 0.5  # of as many own views as show a cell may see through it: more, and it is fog


@dataclass(frozen=True, eq=False)
class SurfaceCells:
    """The surface of one visit, a row a cube that is seen in LEAST_VIEWS views or more."""

    points: np.ndarray  # (m, 3) metres, A's world: the mean of what was seen in it
    views: np.ndarray  # (m,) how many show it
    # (m,) part of the other visit's views that see through it, 0..1; NaN: too few can tell
    through: np.ndarray
    away_m: np.ndarray  # (m,) to the other visit's nearest surface
    color: np.ndarray  # (m, 3) display sRGB, median
    color_change: np.ndarray  # (m, 3) Lab, other less own; NaN where the other has none
    value: np.ndarray  # (m,) median, NaN: not known
    value_change: np.ndarray  # (m,) median of other less own
    contrast: np.ndarray  # (m,) Lab, to what the other visit sees through it; inf: nothing

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, eq=False)
class OwnSurface:
    """What a visit's own views agree on, a row a cube."""

    points: np.ndarray  # (m, 3) metres, A's world
    views: np.ndarray  # (m,)
    color: np.ndarray  # (m, 3) display sRGB
    value: np.ndarray  # (m,)
    all_points: np.ndarray  # (n, 3) of every cube, agreed on or not

    def within(self, views: list[View]) -> "OwnSurface":
        """What lies in the pictures of some views of A's world."""
        kept = np.zeros(len(self.points), bool)
        for view in views:
            kept[pixels_of(self.points, view)[0]] = True
        return OwnSurface(
            self.points[kept], self.views[kept], self.color[kept], self.value[kept],
            self.all_points,
        )  # fmt: skip


def own_surface(seen: SeenVisit, settings: "ChangeSettings") -> OwnSurface:
    every, views = surface_cells(seen, settings.cell_m)
    points, views = every[views >= LEAST_VIEWS], views[views >= LEAST_VIEWS]
    found = evidence_at(points, seen, settings.least_m)
    sure = (found.same >= LEAST_VIEWS) & (found.through <= UNSURE * found.same)
    return OwnSurface(points[sure], views[sure], found.color[sure], found.value[sure], every)


def cells_of(
    own: OwnSurface, other: OwnSurface, seen: SeenVisit, settings: "ChangeSettings"
) -> SurfaceCells:
    """The surface of one visit, and what the other, as it was seen, says of it."""
    from scipy.spatial import cKDTree

    points = own.points
    found = evidence_at(points, seen, settings.least_m)
    told = found.same + found.through
    through = np.where(told >= LEAST_VIEWS, found.through / np.maximum(told, 1), np.nan)
    away = np.full(len(points), np.inf)
    if len(other.all_points) and len(points):
        away = cKDTree(other.all_points).query(points)[0]
    still = through < THROUGH
    light = exposure_of(own.color, np.where(still[:, None], found.color, np.nan))
    lab = lab_of(own.color)
    change = lab_of(found.color, light) - lab
    if np.abs(np.log(light)).max() > SAME_LIGHT:  # what burnt out at one exposure has no colour
        burnt = (linear_of(np.stack([own.color, found.color])) > BRIGHT).any(axis=(0, 2))
        change[burnt] = np.nan
    value_change = found.value - own.value
    if len(other.points) and len(points):
        change = least_change(change, lab, lab_of(other.color, light), points, other.points)
        value_change = least_change(
            value_change[:, None], own.value[:, None], other.value[:, None], points, other.points
        )[:, 0]
    contrast = color_distance(lab_of(found.behind, light) - lab, shade=1.0)
    return SurfaceCells(
        points, own.views, through, away, own.color, np.where(still[:, None], change, np.nan),
        own.value, np.where(still, value_change, np.nan),
        np.where(np.isfinite(contrast), contrast, np.inf),
    )  # fmt: skip


def least_change(
    change: np.ndarray, own: np.ndarray, other: np.ndarray, points: np.ndarray,
    points_other: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """(m, 3) the least of changes (m, 3) and of those to the cells of the other visit around: what
    one capture shows a little beside or more blurred is no other colour.  Lab, own (m, 3) and
    other (n, 3); or (m, 1) of values.
    """
    from scipy.spatial import cKDTree

    near = cKDTree(points_other).query(points, k=min(AROUND, len(points_other)))[1]
    beside = other[near.reshape(len(points), -1)] - own[:, None]  # (m, k, 3)
    every = np.concatenate([change[:, None], beside], axis=1)
    size = color_distance(every) if every.shape[-1] == 3 else np.abs(every[..., 0])
    distance = np.nan_to_num(size, nan=np.inf)
    best = every[np.arange(len(every)), np.argmin(distance, axis=1)]
    return np.where(np.isfinite(change), best, np.nan)


def linear_of(srgb: np.ndarray) -> np.ndarray:
    """(..., 3) light of display sRGB (..., 3)."""
    c = np.clip(srgb, 0, 1)
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def lab_of(srgb: np.ndarray, exposure: np.ndarray | float = 1.0) -> np.ndarray:
    """(..., 3) CIE L*a*b* under D65 of display sRGB (..., 3), its light divided by an exposure;
    distances of 2 are just visible.
    """
    xyz_from_rgb = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
         [0.0193339, 0.1191920, 0.9503041]]
    )  # fmt: skip
    xyz = linear_of(srgb) / exposure @ xyz_from_rgb.T / (0.95047, 1.0, 1.08883)
    f = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def exposure_of(own: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(3,) how much more light the other visit's photos caught of the same cells (m, 3): medians of
    those neither dark nor burnt out; 1 where there are few.
    """
    light, more = linear_of(own), linear_of(other)
    within = ((light > DARK) & (light < BRIGHT) & (more > DARK) & (more < BRIGHT)).all(axis=1)
    if np.count_nonzero(within) < FEWEST:
        return np.ones(3)
    return np.median(more[within] / light[within], axis=0)


KINDS = ("moved", "appeared", "vanished", "hotter", "colder", "higher", "lower", "recoloured")
HEAT_WORDS, VALUE_WORDS = KINDS[3:5], KINDS[5:7]  # more and less of heat, and of other values
TOUCH = 1.8  # cells between the middles of two that hang together
THROUGH = 0.5  # part of the views in which the other visit sees through
BESIDE = 4.0  # cells from a change of geometry: heat and colour there are of that
SHADE = 0.35  # how much lightness counts beside hue: shadows wander with what throws them
ALIKE = 18.0  # Lab: what is moved keeps its colours so nearly
LARGER = 2.5  # times the other's area: the same thing is seen as so much more or less
TURNS = 12  # about the vertical, from which a moved thing is fitted
FITS = 1.2  # cells: median distance of a thing to itself where it stands now


@dataclass(frozen=True)
class ChangeSettings:
    """From where on something counts."""

    cell_m: float  # metres, side of the cubes in which views are joined
    least_m: float  # metres that a surface is off
    least_value: float = 5.0  # in the value stops' unit
    least_color: float = 14.0  # Lab, lightness counted by SHADE
    least_cells: int = 12  # of a place


@dataclass(frozen=True, eq=False)
class ChangedPlace:
    """Where something changed.  Metres in the world of the earlier scene."""

    kind: str  # one of KINDS
    points: np.ndarray  # (n, 3) of what shows it: of the later visit, where it is there
    area_m2: float  # of its surface that was seen
    amount: float  # metres moved; metres to the nearest surface; values; Lab
    unit: str
    level: float = np.nan  # the values there now, of places that are hotter or colder, or so
    before: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))  # (n, 3) of a moved one
    number: int = 0  # from 1 on, by size

    @property
    def centre(self) -> np.ndarray:
        """(3,) middle of its box."""
        low, high = self.box
        return (low + high) / 2

    @property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,) and (3,): its lowest and highest corner."""
        return self.points.min(axis=0), self.points.max(axis=0)

    @property
    def size(self) -> np.ndarray:
        """(3,) metres along the axes."""
        low, high = self.box
        return high - low

    @property
    def shift(self) -> np.ndarray:
        """(3,) metres that a moved one went; else NaN."""
        if self.kind != "moved":
            return np.full(3, np.nan)
        return self.centre - (self.before.min(axis=0) + self.before.max(axis=0)) / 2


def find_places(
    before: SurfaceCells,
    after: SurfaceCells,
    settings: ChangeSettings,
    unit: str = "",
    words: tuple[str, str] = HEAT_WORDS,
) -> list[ChangedPlace]:
    """All places, the largest surface first.  unit: of the values; words: of more and of less."""
    gone, new = ((c.through >= THROUGH) & (c.away_m >= settings.least_m) for c in (before, after))
    vanished, appeared = (
        [_Part(cells, rows) for rows in parts(cells.points, mask, settings)
         if np.median(cells.contrast[rows]) >= CONTRAST]
        for cells, mask in ((before, gone), (after, new))
    )  # fmt: skip
    places, left = pair_moved(vanished, appeared, settings)
    for part in left:
        kind = "appeared" if part.cells is after else "vanished"
        away = part.cells.away_m[part.rows]
        amount = float(np.median(away[np.isfinite(away)])) if np.isfinite(away).any() else np.inf
        places.append(ChangedPlace(kind, part.points, part.area_m2(settings), amount, "m"))
    zone = inside_any(after.points, [p.points for p in (*vanished, *appeared)], settings)
    still = after.through < THROUGH
    with np.errstate(invalid="ignore"):
        more = still & ~zone & (after.value_change <= -settings.least_value)
        less = still & ~zone & (after.value_change >= settings.least_value)
        colored = still & (color_distance(after.color_change) >= settings.least_color)
    for kind, mask in ((words[0], more), (words[1], less), ("recoloured", colored)):
        for rows in parts(after.points, mask, settings):
            if zone[rows].any():
                continue  # a shadow, or where a thing stood: of the change of geometry
            part = _Part(after, rows)
            if kind == "recoloured":
                change, said = color_distance(after.color_change[rows]), "Lab"
            else:
                change, said = -after.value_change[rows], unit
            amount, area = float(np.median(change)), part.area_m2(settings)
            level = np.nan if kind == "recoloured" else float(np.median(after.value[rows]))
            places.append(ChangedPlace(kind, part.points, area, amount, said, level))
    places.sort(key=lambda place: -place.area_m2)
    return [replace(place, number=i) for i, place in enumerate(places, 1)]


def color_distance(lab: np.ndarray, shade: float = SHADE) -> np.ndarray:
    """(...) of Lab differences (..., 3), lightness counted by `shade`."""
    return np.sqrt((shade * lab[..., 0]) ** 2 + lab[..., 1] ** 2 + lab[..., 2] ** 2)


def inside_any(
    points: np.ndarray, groups: list[np.ndarray], settings: ChangeSettings
) -> np.ndarray:
    """(n,) bool: which points lie in the convex hull of a group, or BESIDE cells around it."""
    from scipy.spatial import ConvexHull

    out, reach = np.zeros(len(points), bool), BESIDE * settings.cell_m
    steps = (np.indices((2, 2, 2)).reshape(3, -1).T * 2 - 1) * reach  # corners of a cube
    for group in groups:
        wide = (group[:, None] + steps).reshape(-1, 3)  # a solid, also around a flat group
        low, high = wide.min(axis=0), wide.max(axis=0)
        near = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
        if len(near):
            planes = ConvexHull(wide).equations  # (faces, 4): outwards, and how far
            out[near] |= (points[near] @ planes[:, :3].T + planes[:, 3] <= 1e-9).all(axis=1)
    return out


def parts(points: np.ndarray, mask: np.ndarray, settings: ChangeSettings) -> list[np.ndarray]:
    """Rows of each group of marked cells that hangs together and is large enough."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    rows = np.flatnonzero(mask)
    if len(rows) < settings.least_cells:
        return []
    near = cKDTree(points[rows]).query_pairs(TOUCH * settings.cell_m, output_type="ndarray")
    graph = coo_matrix((np.ones(len(near)), near.T), (len(rows), len(rows)))
    count, label = connected_components(graph, directed=False)
    groups = [rows[label == i] for i in range(count)]
    return [group for group in groups if len(group) >= settings.least_cells]


@dataclass(frozen=True, eq=False)
class _Part:
    """Some cells of one visit."""

    cells: SurfaceCells
    rows: np.ndarray

    @property
    def points(self) -> np.ndarray:
        return self.cells.points[self.rows]

    @property
    def color(self) -> np.ndarray:
        """(3,) Lab, mean."""
        return lab_of(self.cells.color[self.rows]).mean(axis=0)

    def area_m2(self, settings: ChangeSettings) -> float:
        """A plane crosses as many cubes as its three shadows along the axes have squares."""
        shadows = np.abs(surface_normals(self.points)).sum(axis=1)
        return float((settings.cell_m**2 / shadows).sum())


def pair_moved(
    vanished: list[_Part], appeared: list[_Part], settings: ChangeSettings
) -> tuple[list[ChangedPlace], list[_Part]]:
    """Moved things, and what is left: what vanished at one place and appeared at another, as large,
    of the same colours, and of the same shape after a turn about the vertical.
    """
    found = []
    for i, gone in enumerate(vanished):
        for j, new in enumerate(appeared):
            sizes = sorted((len(gone.rows), len(new.rows)))
            if sizes[1] > LARGER * sizes[0]:
                continue
            if np.linalg.norm(gone.color - new.color) > ALIKE:
                continue
            misfit = shape_misfit(gone.points, new.points)
            if misfit <= FITS * settings.cell_m:
                found.append((misfit, i, j))
    places: list[ChangedPlace] = []
    used: tuple[set[int], set[int]] = (set(), set())
    for _, i, j in sorted(found):
        if i in used[0] or j in used[1]:
            continue
        used[0].add(i)
        used[1].add(j)
        area, points = appeared[j].area_m2(settings), appeared[j].points
        place = ChangedPlace("moved", points, area, 0.0, "m", before=vanished[i].points)
        places.append(replace(place, amount=float(np.linalg.norm(place.shift))))
    left = [part for i, part in enumerate(vanished) if i not in used[0]]
    left += [part for j, part in enumerate(appeared) if j not in used[1]]
    return places, left


def shape_misfit(a: np.ndarray, b: np.ndarray) -> float:
    """Metres by which points b (M, 3) lie beside a (N, 3) after the best turn about +Y and shift:
    the larger of both medians of nearest distances.
    """
    from scipy.spatial import cKDTree

    middle_a, middle_b = ((p.min(axis=0) + p.max(axis=0)) / 2 for p in (a, b))
    radius = float(np.linalg.norm(a - middle_a, axis=1).max())
    best = np.inf
    tree = cKDTree(a)
    for turn in 2 * np.pi * np.arange(TURNS) / TURNS:
        rotation = rotation_of(np.array([0.0, turn, 0.0]))
        start = Similarity(rotation, middle_a - rotation @ middle_b)
        for found in (start, fit_surfaces(a, b, start, 4 * radius, scaled=False)[0]):
            moved = found.apply(b)
            there, back = tree.query(moved)[0], cKDTree(moved).query(a)[0]
            best = min(best, float(max(np.median(there), np.median(back))))
    return best
