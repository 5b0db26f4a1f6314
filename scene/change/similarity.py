"""What `change --out` wrote, read again: how the worlds lie, and boxes about the places."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.sections.section import BoxShape

# From one world into another: a scale, a turn and a shift, found where surfaces lie together.

ROUNDS = 40  # of matching and moving, at most
STILL = 1e-5  # of the radius: a smaller step ends it
KEPT = 0.7  # part of the matches that count: what was changed is among the others
WIDEST, NARROWEST = 0.1, 0.02  # of the radius: matches farther apart count for nothing, falling
CLOSE = 0.02  # of the radius: as near lies what both have
NEIGHBOURS = 12  # points that a surface's direction is taken from


@dataclass(frozen=True, eq=False)
class Similarity:
    """p_a = scale * rotation @ p_b + shift."""

    rotation: np.ndarray  # (3, 3)
    shift: np.ndarray  # (3,) metres of A
    scale: float = 1.0  # metres of A in one of B

    @staticmethod
    def identity() -> "Similarity":
        return Similarity(np.eye(3), np.zeros(3))

    def apply(self, points: np.ndarray) -> np.ndarray:
        """(..., 3) points of B in A."""
        return self.scale * points @ self.rotation.T + self.shift

    def after(self, first: "Similarity") -> "Similarity":
        """This one of what `first` gives."""
        return Similarity(
            self.rotation @ first.rotation,
            self.scale * self.rotation @ first.shift + self.shift,
            self.scale * first.scale,
        )

    @property
    def inverse(self) -> "Similarity":
        """B's points from A's."""
        turn = self.rotation.T
        return Similarity(turn, -turn @ self.shift / self.scale, 1 / self.scale)

    def view_in_b(self, view: View) -> View:
        """A view of A where it stands in B; depths there are 1 / scale of those here."""
        world = view.world_from_eye.matrix()
        moved = np.eye(4)
        moved[:3, :3] = self.rotation.T @ world[:3, :3]
        moved[:3, 3] = self.rotation.T @ (world[:3, 3] - self.shift) / self.scale
        pose = Pose.from_matrix(moved)
        return replace(
            view, world_from_eye=pose, near=view.near / self.scale, far=view.far / self.scale
        )

    @property
    def degrees(self) -> float:
        """Of its turn."""
        cosine = (np.trace(self.rotation) - 1) / 2
        return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


@dataclass(frozen=True)
class Registration:
    """A's world from B's, and how well it holds."""

    a_from_b: Similarity
    how: str  # "common", "icp" or "features"
    residual_m: float  # median distance of what both have, across A's surface
    shared: float  # part of the points that lie on the other's surface, 0..1


def surface_normals(points: np.ndarray) -> np.ndarray:
    """(N, 3) unit directions across the surface that points (N, 3) lie on, of either sign."""
    from scipy.spatial import cKDTree

    count = min(NEIGHBOURS, len(points))
    _, near = cKDTree(points).query(points, k=count)
    around = points[near.reshape(len(points), count)]
    around = around - around.mean(axis=1, keepdims=True)
    _, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))
    return axes[:, :, 0]


def fit_surfaces(
    a: np.ndarray,
    b: np.ndarray,
    start: Similarity,
    radius: float,
    scaled: bool,
    rounds: int = ROUNDS,
) -> tuple[Similarity, float, float]:
    """Moves points b (M, 3) onto the surface that points a (N, 3) lie on; returns the similarity,
    the residual in metres and the shared part of both.

    Iterated closest points, across the surface (Chen and Medioni 1992), of which the KEPT nearest
    count (Chetverikov et al. 2002); the scale is free where `scaled`.  radius: of the scene, A.
    """
    from scipy.spatial import cKDTree

    tree, normals, found = cKDTree(a), surface_normals(a), start
    for turn in range(rounds):
        reach = radius * max(WIDEST * 0.7**turn, NARROWEST)
        moved = found.apply(b)
        away, near = tree.query(moved, distance_upper_bound=reach)
        hits = np.flatnonzero(np.isfinite(away))
        if len(hits) < 20:
            return found, float("inf"), 0.0
        hits = hits[np.argsort(away[hits], kind="stable")[: max(int(KEPT * len(hits)), 20)]]
        step = _step(moved[hits], a[near[hits]], normals[near[hits]], scaled)
        found = step.after(found)
        size = np.linalg.norm(step.apply(moved[hits]) - moved[hits], axis=1).max()
        if size < STILL * radius and reach <= radius * NARROWEST:
            break
    return found, *_fit_of(a, tree, normals, found.apply(b), radius)


def _step(p: np.ndarray, q: np.ndarray, normals: np.ndarray, scaled: bool) -> Similarity:
    """The small motion of p (n, 3) that brings them nearest to the planes through q."""
    middle = p.mean(axis=0)
    arms = p - middle
    columns = [np.cross(arms, normals), normals]
    if scaled:
        columns.append((arms * normals).sum(axis=1, keepdims=True))
    rows = np.concatenate(columns, axis=1)  # (n, 6 or 7)
    gap = ((q - p) * normals).sum(axis=1)
    found = np.linalg.lstsq(rows, gap, rcond=1e-9)[0]
    turn, scale = rotation_of(found[:3]), 1.0 + (float(found[6]) if scaled else 0.0)
    return Similarity(turn, middle + found[3:6] - scale * turn @ middle, scale)


def rotation_of(vector: np.ndarray) -> np.ndarray:
    """(3, 3) of a turn by |vector| radians about it."""
    angle = float(np.linalg.norm(vector))
    if not angle > 0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def _fit_of(
    a: np.ndarray, tree, normals: np.ndarray, b_in_a: np.ndarray, radius: float
) -> tuple[float, float]:
    """Residual in metres and shared part, from each to the other."""
    from scipy.spatial import cKDTree

    away, near = tree.query(b_in_a)
    back, _ = cKDTree(b_in_a).query(a)
    close = away <= CLOSE * radius
    shared = float(min(close.mean(), (back <= CLOSE * radius).mean()))
    if not close.any():
        return float("inf"), 0.0
    across = np.abs(((b_in_a - a[near]) * normals[near]).sum(axis=1))[close]
    return float(np.median(across)), shared


FILE = "places.json"
MOST_BYTES, MOST_PLACES = 1 << 24, 10_000
FARTHEST = 1e6  # metres
ROOM_CELLS = 4.0  # beside a place: its shadow, and the edge that comparing cuts off
TURNED = 1e-3  # that a rotation may be off one


@dataclass(frozen=True)
class KnownChange:
    """Of two visits, without their points."""

    a_from_b: Similarity
    boxes: tuple[BoxShape, ...]  # world of A, about each place; of a moved thing, both


def read_change(folder: Path) -> KnownChange:
    """Of the folder that was written, or of its places.json.  Raises BadFile."""
    path = folder / FILE if folder.is_dir() else folder
    if not path.is_file():
        raise BadFile(f"{folder}: no {FILE} in it; name the folder that `change --out` wrote.")
    fields = Fields(read_json(path, most_bytes=MOST_BYTES), str(path))
    room = ROOM_CELLS * fields.object("settings").number("cell_m", low=1e-9, high=FARTHEST)
    matrix = _matrix(fields.object("registration"), path)
    boxes = []
    for row in fields.rows("places", MOST_PLACES, "place"):
        size = [row.number(f"size_{axis}", low=0.0, high=FARTHEST) for axis in "xyz"]
        half = three(side / 2 + room for side in size)
        centre = three(row.number(axis, low=-FARTHEST, high=FARTHEST) for axis in "xyz")
        boxes.append(BoxShape(centre, half))
        if row.value("from_x", None) is not None:
            came = (row.number(f"from_{axis}", low=-FARTHEST, high=FARTHEST) for axis in "xyz")
            boxes.append(BoxShape(three(came), half))
    return KnownChange(_similarity(matrix, path), tuple(boxes))


def _matrix(registration: Fields, path: Path) -> np.ndarray:
    rows = registration.value("a_from_b")
    try:
        matrix = np.array(rows, np.float64)
    except (TypeError, ValueError):
        matrix = np.zeros(0)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise BadFile(f"{path}: a_from_b is no matrix of 4 x 4 numbers; run change again.")
    return matrix


def _similarity(matrix: np.ndarray, path: Path) -> Similarity:
    scale = np.cbrt(np.linalg.det(matrix[:3, :3]))
    if not 1e-6 < scale < 1e6:
        raise BadFile(f"{path}: a_from_b is no turn, shift and scale; run change again.")
    rotation = matrix[:3, :3] / scale
    if not np.abs(rotation @ rotation.T - np.eye(3)).max() < TURNED:
        raise BadFile(f"{path}: a_from_b is no turn, shift and scale; run change again.")
    left, _, right = np.linalg.svd(rotation)  # six decimals of a file, made a turn again
    return Similarity(left @ right, matrix[:3, 3], float(scale))
