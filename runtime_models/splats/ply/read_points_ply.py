"""A PLY of points, with or without colours: shown as round splats that reach their neighbours."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.model import BadFile, Finding
from shapeshift.runtime_models.shapes import column_names
from shapeshift.runtime_models.splats.operations.merge_pairs import morton_order
from shapeshift.runtime_models.splats.plain_splats import RawSplats, Reading
from shapeshift.runtime_models.splats.ply.ply_file import (
    Element,
    PlyHeader,
    put_vertical_axis,
    read_header,
)
from shapeshift.runtime_models.splats.ply.read_ply import (
    DIRECT,
    GEOMETRY,
    NORMAL,
    PLACE,
    QUATERNION,
    SCALES,
    numbers,
)

COLORS = (  # names that programs give to red, green and blue
    ("red", "green", "blue"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
    ("r", "g", "b"),
)
GRAY = 0.7  # of points without a colour
SHOWN = 80  # bytes a point of the arrays that it is shown by
MEASURED = 320  # bytes a point while neighbours are looked for
SIGMA = 0.25  # of the distance to the neighbours: they touch, strays do not hide the rest


def is_points(head: bytes, path: Path) -> bool:
    """Whether a PLY has points of no size and no rotation; a broken header is for others to say."""
    if head[:3] != b"ply":
        return False
    try:
        vertex = [e for e in read_header(path).elements if e.name == "vertex" and e.row]
    except BadFile:
        return False
    names = set(column_names(vertex[0].layout)) if vertex else set()
    return set(PLACE) <= names and not names & {*SCALES, *QUATERNION}


def read_raw_points_ply(path: Path, reading: Reading) -> RawSplats:
    """A round opaque splat for each point, binary or ASCII.  Raises BadFile, always if strict."""
    header = read_header(path)
    vertex, begins = header.find("vertex")
    lacking = [name for name in GEOMETRY if name not in column_names(vertex.layout)]
    what = f"a point cloud, no splats: it has no {', '.join(lacking)}"
    reading = reading.within(path)
    memory = reading.account
    memory.charge(vertex.count * (vertex.layout.itemsize + 12), f"{vertex.count:,} points")
    table = read_records(path, header, vertex, begins)
    places = np.stack([table[axis] for axis in PLACE], 1)  # (N, 3)
    raw = splats_of_points(places, None, path.name, reading, what)
    put_vertical_axis(raw, header)
    return replace(raw, sh=colors_of(table), extra=others_of(table), format="PLY of points")


def splats_of_points(
    places: np.ndarray, shades: np.ndarray | None, file: str, reading: Reading, what: str = ""
) -> RawSplats:
    """A round opaque splat for each place (N, 3), of the shades (N, 3) 0..1, else gray.

    reading.account is the file's Account; `what` is what its finding says.  Raises BadFile, always
    if strict.
    """
    what = what or "a point cloud, no splats: it has no scales, rotations or opacities"
    if reading.strict:
        raise BadFile(f"{file}: {what}; --strict shows splats only, open it without.")
    if places.ndim != 2 or places.shape[1] != 3 or not len(places):
        raise BadFile(f"{file} has points of shape {places.shape!s:.40}, expected (N, 3).")
    if places.dtype not in (np.float32, np.float64):
        places = places.astype(np.float64)
    count, memory = len(places), reading.account
    memory.charge(count * SHOWN, f"{count:,} points")
    reading.report(f"measuring {file}", 0.5)
    with memory.lend(count * MEASURED, f"measuring {count:,} points"):
        size = (SIGMA * knn_distance(places)).astype(np.float32)
    done = f"shown as {count:,} points, each as wide as the way to its neighbours"
    return RawSplats(
        means=places,
        scales=np.repeat(size[:, None], 3, axis=1),
        wxyz=np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1)),
        opacity=np.ones(count, np.float32),
        sh=harmonics_of(shades, count),
        file=file,
        format="points",
        log_scales=False,
        logits=False,
        findings=(Finding(what, 0, done, file=file),),
        memory=memory,
    )


def read_records(path: Path, header: PlyHeader, vertex: Element, begins: int) -> np.ndarray:
    """(N,) records of the points.  Raises BadFile."""
    if header.encoding != "ascii":
        return np.memmap(path, vertex.layout, "r", begins, (vertex.count,))
    width, table, done = len(column_names(vertex.layout)), np.empty(vertex.count, vertex.layout), 0
    pending = np.empty(0)
    with path.open("rb") as file:
        file.seek(begins)
        for values in numbers(file, path.name):
            pending = np.concatenate([pending, values])
            rows = min(len(pending) // width, vertex.count - done)
            part = pending[: rows * width].reshape(rows, width)
            with np.errstate(over="ignore", invalid="ignore"):
                for i, name in enumerate(column_names(vertex.layout)):
                    table[name][done : done + rows] = part[:, i]
            pending, done = pending[rows * width :], done + rows
            if done == vertex.count:
                return table
    raise BadFile(
        f"{path.name}: the header promises {vertex.count} points, the file holds {done}; it is cut "
        "off or its header is wrong."
    )


def colors_of(table: np.ndarray) -> np.ndarray:
    """(N, 1, 3) float32 harmonics of degree 0: the points' colours, or gray."""
    shades = shades_of(table)
    if shades is None and set(DIRECT) <= set(column_names(table.dtype)):
        return np.stack([table[name] for name in DIRECT], 1, dtype=np.float32)[:, None]
    return harmonics_of(shades, len(table))


def harmonics_of(shades: np.ndarray | None, count: int) -> np.ndarray:
    """(N, 1, 3) float32 of shades (N, 3) 0..1, or gray."""
    if shades is None:
        return np.full((count, 1, 3), (GRAY - 0.5) / C0, np.float32)
    return ((shades - 0.5) / np.float32(C0))[:, None]


def shades_of(table: np.ndarray) -> np.ndarray | None:
    """(N, 3) float32 red, green and blue, 1 the most that an integer can say; None without."""
    names = next((three for three in COLORS if set(three) <= set(column_names(table.dtype))), None)
    if names is None:
        return None
    shades = []
    for name in names:
        kind = table.dtype[name]
        most = np.iinfo(kind).max if kind.kind in "iu" else 1.0
        shades.append(table[name].astype(np.float32) / np.float32(most))
    return np.stack(shades, 1)


def others_of(table: np.ndarray) -> dict[str, np.ndarray]:
    """The columns that say neither where a point is nor how it looks."""
    shown = {*PLACE, *NORMAL, *DIRECT, "alpha", "opacity", *(n for three in COLORS for n in three)}
    names = [name for name in column_names(table.dtype) if name not in shown]
    return {name: table[name].astype(table.dtype[name].newbyteorder("=")) for name in names}


# How far apart points lie: the way from each to its nearest neighbours.

NEAREST = 3  # neighbours that are averaged, as 3DGS does for its first splats
REACH = 6  # places along the curve, to either side, where neighbours are looked for
SHIFTS = (0.0, 1 / 3)  # of the scene: what one curve parts, the other does not


def knn_distance(points: np.ndarray) -> np.ndarray:
    """(N,) about the mean distance to the three nearest of the other points (N, 3).

    Never below a hundredth of the median nor above four times it, so that neither doubles vanish
    nor strays fill the scene; 0.01 where there is no distance at all.  Rows with NaN or Inf get
    the median.
    """
    out = np.full(len(points), 0.01)
    good = np.flatnonzero(np.isfinite(points).all(axis=1))
    if len(good) < 2:
        return out
    found = nearest_distances(points[good].astype(np.float64))
    apart = found[found > 0]
    if not len(apart):
        return out
    median = np.median(apart)
    out[:] = median
    out[good] = found.clip(median / 100, median * 4)
    return out


def nearest_distances(points: np.ndarray) -> np.ndarray:
    """(N,) mean distance to the nearest found among neighbours along two space-filling curves.

    At least the true one; for most points the same, for one in twenty a third more.
    """
    count = len(points)
    # Inf where a point has not so many neighbours
    best = np.full((count, NEAREST), np.inf)
    size = np.ptp(np.quantile(points, (0.05, 0.95), axis=0), axis=0)
    known: list[np.ndarray] = []  # the curves that were gone along, as places on them
    for shift in SHIFTS:
        order = curve(points, shift * size)
        sorted_points = points[order]
        for step in range(1, min(REACH, count - 1) + 1):
            one, other = order[:-step], order[step:]
            distance = np.linalg.norm(sorted_points[step:] - sorted_points[:-step], axis=1)
            for place in known:  # a pair that an earlier curve has found counts once
                distance[np.abs(place[one] - place[other]) <= REACH] = np.inf
            for rows in (one, other):
                keep_smallest(best, rows, distance)
        place = np.empty(count, np.int64)
        place[order] = np.arange(count)
        known.append(place)
    found = np.isfinite(best)
    return np.where(found, best, 0).sum(1) / np.maximum(found.sum(1), 1)


def curve(points: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """(N,) an order along the Z-curve whose cells are moved by `shift` (3,)."""
    if not shift.any():
        return morton_order(points)
    # Two far corners carry the shift into the range that the curve's cells divide.
    corners = [points.min(axis=0) - shift, points.max(axis=0) + 2 * shift]
    order = morton_order(np.concatenate([points, corners]))
    return order[order < len(points)]


def keep_smallest(best: np.ndarray, rows: np.ndarray, distance: np.ndarray) -> None:
    """Puts a distance (n,) into each of those rows of best (N, k), which stay sorted."""
    for column in range(best.shape[1]):
        held = best[rows, column]
        best[rows, column] = np.minimum(held, distance)
        distance = np.maximum(held, distance)
