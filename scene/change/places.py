"""Places where two visits differ: cells that hang together, each told apart by its kind."""

from dataclasses import dataclass, field, replace

import numpy as np

from shapeshift.scene.change.seen_pair import Samples
from shapeshift.scene.change.similarity import (
    Similarity,
    fit_surfaces,
    rotation_of,
    surface_normals,
)

# Pixels of many views in small cubes of space: what all views together say of a surface.

LEAST_VIEWS = 3  # that a cell must be seen in: one view is no evidence


@dataclass(frozen=True, eq=False)
class SurfaceCells:
    """The surface of one visit, a row a cube that is seen in LEAST_VIEWS views or more."""

    points: np.ndarray  # (m, 3) metres, A's world: the mean of what was seen in it
    views: np.ndarray  # (m,) how many show it
    through: np.ndarray  # (m,) part of the views in which the other visit sees through it, 0..1
    away_m: np.ndarray  # (m,) to the other visit's nearest surface
    color: np.ndarray  # (m, 3) display sRGB, median
    color_change: np.ndarray  # (m, 3) Lab, other less own; NaN where the other has none
    value: np.ndarray  # (m,) median, NaN: not known
    value_change: np.ndarray  # (m,) median of other less own

    def __len__(self) -> int:
        return len(self.points)


def cells_of(own: Samples, other: Samples, cell_m: float) -> SurfaceCells:
    """One visit's cells with side cell_m."""
    from scipy.spatial import cKDTree

    keys = np.floor(own.points / cell_m).astype(np.int64)
    _, group = np.unique(keys, axis=0, return_inverse=True)
    group = group.ravel()
    known = np.isfinite(own.through)
    pairs = np.unique(np.stack([group[known], own.view[known]], axis=1), axis=0)
    count = int(group.max()) + 1 if len(group) else 0
    views = np.bincount(pairs[:, 0], minlength=count)
    kept = np.flatnonzero(views >= LEAST_VIEWS)
    row_of = np.full(count, -1)
    row_of[kept] = np.arange(len(kept))
    row, order = row_of[group], None
    order = np.flatnonzero((row >= 0) & known)
    row = row[order]
    points = np.stack([means(row, own.points[order, i], len(kept)) for i in range(3)], axis=1)
    lab = lab_of(own.color_other[order]) - lab_of(own.color[order])
    heat = own.value_other[order] - own.value[order]
    away = np.full(len(kept), np.inf)
    if len(other.points) and len(kept):
        away = cKDTree(other.points).query(points)[0]
    return SurfaceCells(
        points,
        views[kept],
        means(row, own.through[order], len(kept)),
        away,
        np.stack([medians(row, own.color[order, i], len(kept)) for i in range(3)], axis=1),
        np.stack([medians(row, lab[:, i], len(kept)) for i in range(3)], axis=1),
        medians(row, own.value[order], len(kept)),
        medians(row, heat, len(kept)),
    )


def means(row: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """(count,) of values (n,) that belong to rows (n,)."""
    total = np.bincount(row, values, minlength=count)
    return total / np.maximum(np.bincount(row, minlength=count), 1)


def medians(row: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """(count,) of those values (n,) that are finite; NaN where a row has none."""
    good = np.isfinite(values)
    row, values = row[good], values[good]
    order = np.lexsort((values, row))
    row, values = row[order], values[order]
    sizes = np.bincount(row, minlength=count)
    first = np.cumsum(sizes) - sizes
    out = np.full(count, np.nan)
    some = sizes > 0
    low, high = first + (sizes - 1) // 2, first + sizes // 2
    out[some] = (values[low[some]] + values[high[some]]) / 2
    return out


def lab_of(srgb: np.ndarray) -> np.ndarray:
    """(..., 3) CIE L*a*b* under D65 of display sRGB (..., 3); distances of 2 are just visible."""
    c = np.clip(srgb, 0, 1)
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    xyz_from_rgb = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
         [0.0193339, 0.1191920, 0.9503041]]
    )  # fmt: skip
    xyz = linear @ xyz_from_rgb.T / (0.95047, 1.0, 1.08883)
    f = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


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
    vanished = [_Part(before, rows) for rows in parts(before.points, gone, settings)]
    appeared = [_Part(after, rows) for rows in parts(after.points, new, settings)]
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


def color_distance(lab: np.ndarray) -> np.ndarray:
    """(...) of Lab differences (..., 3), lightness counted by SHADE."""
    return np.sqrt((SHADE * lab[..., 0]) ** 2 + lab[..., 1] ** 2 + lab[..., 2] ** 2)


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
