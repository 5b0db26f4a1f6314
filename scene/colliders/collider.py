"""What the physics touches instead of splats: an invisible mesh and the convex pieces of it.

A moving body is its parts (a mesh of 2,500 faces takes an engine hundreds of times as long); the
mesh serves a background that stays where it is, the mass and a debug view.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import BadFile, Model, ScaffoldModel
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.colliders.collider_cache import content_key, read_cached, write_cached
from shapeshift.scene.colliders.collider_pieces import Pieces, hull_faces, read_pieces
from shapeshift.scene.colliders.collider_wrap import (
    CELLS,
    is_watertight,
    join_meshes,
    volume,
    wrap,
)
from shapeshift.scene.colliders.convex_parts import cut_into_parts, hull_volume, solid_parts
from shapeshift.scene.colliders.fill_splats import fill_splats, hull_points, nothing_to_touch
from shapeshift.scene.colliders.read_mesh import read_mesh
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh, sample_faces

VERSION = 4  # of the rules that make colliders: another one makes all of them anew
FACES, MOST_PARTS = 2500, 16
LEAST_SIDE_M = 0.002  # of the box of what is too small or too flat to be wrapped
THINNEST = 0.01  # of the longest side, of such a box
FEWEST_SPLATS = 30  # fewer get a box
MESH_SAMPLES = 400_000  # points on an open mesh that a skin is wrapped around
MESH_CELLS = 128  # cells along its longest side
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Collider:
    parts: tuple[np.ndarray, ...]  # each (V, 3) float32 metres, object frame; 1 to 16 of them
    mesh: TriangleMesh  # watertight, the same frame
    rough: bool = False  # one hull that stands in until the pieces are made


@dataclass(frozen=True)
class Making:
    """How colliders are made."""

    faces: int = FACES  # of the mesh, about
    most_parts: int = MOST_PARTS
    hollow: bool = False  # a place to be in: what it encloses stays free, and it is never cut
    kept: bool = True  # False: nothing is read from the user's cache or written to it
    rough: bool = False  # what was made before, else one hull, in a tenth of a second; never cut
    progress: Progress | None = None  # (what is being done, part done 0..1); may raise to end it
    cells: int = CELLS  # along the longest side of splats, at most, that the mesh is made of

    def report(self, what: str, part: float) -> None:
        if self.progress:
            self.progress(what, part)


def collider_of_splats(
    means: np.ndarray,
    scales: np.ndarray,
    wxyz: np.ndarray,
    opacity: np.ndarray,
    making: Making | None = None,
) -> Collider:
    """The collider of splats: metres (N, 3), one sigma (N, 3), unit (N, 4), 0..1 (N,).

    Raises BadFile where none of them is there to be touched.
    """
    making = making or Making()
    columns = (means, scales, wxyz, opacity)
    return cached_or_made(
        making, columns, lambda: mesh_of_splats(*columns, making), lambda: hull_points(*columns)
    )


def collider_of_model(
    model: Model, x: Control, making: Making | None = None, eye: np.ndarray | None = None,
    mend: Callable[[Sequence[np.ndarray]], Sequence[np.ndarray]] | None = None,
) -> Collider:  # fmt: skip
    """The collider of a model as it is at control value x, of its splats mended, if at all.  Raises
    BadFile.

    eye (3,) metres, in the object's frame: where a model is seen from whose shape depends on it;
    in front of it if not given.
    """
    if isinstance(model, ScaffoldModel) and eye is None:
        low, high = np.percentile(model.anchors, (1, 99), axis=0)
        eye = (low + high) / 2 + np.array([0, 0, 2 * (high - low).max()])
    columns = Evaluator(model).geometry(x, eye=None if eye is None else np.asarray(eye, np.float32))
    means, scales, wxyz, opacity = columns if mend is None else mend(columns)
    return collider_of_splats(means, scales, wxyz, opacity, making)


def collider_of_mesh(path: Path, making: Making | None = None) -> Collider:
    """The collider of a mesh file (.glb, .gltf, .obj, .ply, .stl), metres.  Raises BadFile.

    A closed mesh is only simplified, an open one is wrapped; convex parts stay as they are, and so
    do convex pieces that the file itself names.  A hollow one stays as it is.
    """
    making = making or Making()
    pieces = read_pieces(path)
    if pieces and not making.hollow:
        return collider_of_pieces(pieces)
    given = pieces.skin if pieces else read_mesh(path)
    if making.hollow:  # the physics takes any triangles that stay where they are
        return Collider(around(given), given)
    return cached_or_made(
        making, (given.vertices, given.faces), lambda: closed_mesh(given, making),
        lambda: given.vertices,
    )  # fmt: skip


def collider_of_pieces(pieces: Pieces) -> Collider:
    """Somebody's own choice, which is not cut again; only what no engine can hold is mended."""
    parts = solid_parts(pieces.points, pieces.skin, MOST_PARTS)
    skin = pieces.skin
    if not (is_watertight(skin.faces) and volume(skin.vertices, skin.faces) > 0):
        skin = join_meshes([TriangleMesh(hull, hull_faces(hull)) for hull in parts])
    return Collider(parts, skin)


def cached_or_made(
    making: Making, columns: tuple[np.ndarray, ...], make: Callable[[], TriangleMesh],
    hull: Callable[[], np.ndarray],
) -> Collider:  # fmt: skip
    """From a cache if it was made before, else made now and kept; a rough one of points (V, 3)."""
    if not (making.faces >= 12 and 1 <= making.most_parts <= 64):
        raise ValueError(
            f"a collider of {making.faces} faces and {making.most_parts} parts is asked for; at "
            "least 12 faces and 1 to 64 parts are made."
        )
    settings = f"{VERSION} {making.faces} {making.most_parts} {making.hollow}"
    settings += f" {making.cells}" * (making.cells != CELLS)
    key = content_key(settings, *columns) if making.kept else ""
    made = read_cached(key) if making.kept else None
    if made is None and making.rough and not making.hollow:
        parts, mesh = one_hull(hull())
        return Collider(parts, mesh, True)
    if made is None:
        mesh = make()
        parts, finished = around(mesh), True
        if not making.hollow:
            parts, finished = cut_into_parts(mesh, making.most_parts, making.report)
        made = parts, mesh
        if making.kept and finished:  # what a slow machine gave up on is tried again
            write_cached(key, made)
    making.report("making a collider", 1.0)
    return Collider(*made)


def one_hull(points: np.ndarray) -> tuple[tuple[np.ndarray, ...], TriangleMesh]:
    """The hull of points (V, 3), nowhere thinner than an engine can hold, as the only piece."""
    mesh = TriangleMesh(points.astype(np.float32), np.zeros((0, 3), np.int32))
    parts = solid_parts([points], mesh, 1)
    if not parts:  # a single place
        mesh = box_around(points)
        return (mesh.vertices,), mesh
    return parts, TriangleMesh(parts[0], hull_faces(parts[0]))


def around(mesh: TriangleMesh) -> tuple[np.ndarray, ...]:
    """One hull of all of it: of what is touched as a mesh and never cut into pieces."""
    return solid_parts([mesh.vertices], mesh, 1)


def mesh_of_splats(
    means: np.ndarray,
    scales: np.ndarray,
    wxyz: np.ndarray,
    opacity: np.ndarray,
    making: Making,
) -> TriangleMesh:
    """A watertight mesh around the splats; a box around few.  Raises BadFile around none."""
    making.report("looking for what is solid", 0.0)
    filling = fill_splats(means, scales, wxyz, opacity, making.cells)
    if not len(filling.points):
        raise BadFile(nothing_to_touch(len(means)))
    if filling.splats < FEWEST_SPLATS or not filling.cell_m > 0:
        return box_around(filling.points)
    skin = wrap(filling.points, filling.cell_m, making.faces, making.report, making.hollow)
    return usable(skin, filling.points)


def closed_mesh(given: TriangleMesh, making: Making) -> TriangleMesh:
    """A mesh of about `faces` faces that is watertight, out of any."""
    from shapeshift.scene.colliders.collider_wrap import simplify

    making.report("closing the mesh", 0.0)
    if is_watertight(given.faces) and volume(given.vertices, given.faces) > 0:
        return usable(simplify(given, making.faces), given.vertices)
    size = np.ptp(given.vertices.astype(np.float64), axis=0)
    if size.min() <= THINNEST * size.max():  # a flat sheet has no inside to be wrapped
        return box_around(given.vertices)
    points, _ = sample_faces(given.vertices[given.faces].astype(np.float64), MESH_SAMPLES)
    cell_m = size.max() / MESH_CELLS
    return usable(wrap(points, cell_m, making.faces, making.report), given.vertices)


def usable(mesh: TriangleMesh, points: np.ndarray) -> TriangleMesh:
    """The mesh itself, or a box around the points where it is not closed around a volume."""
    least = 1e-9 * float(np.ptp(points, axis=0).max()) ** 3
    good = is_watertight(mesh.faces) and volume(mesh.vertices, mesh.faces) > least
    return mesh if good else box_around(points)


def box_around(points: np.ndarray) -> TriangleMesh:
    """The box of points (M, 3) along the axes, nowhere thinner than what an engine can hold."""
    low, high = points.min(0).astype(np.float64), points.max(0).astype(np.float64)
    half = np.maximum((high - low) / 2, max(LEAST_SIDE_M, THINNEST * (high - low).max()) / 2)
    corners = np.array([[c >> 2 & 1, c >> 1 & 1, c & 1] for c in range(8)])
    vertices = (low + high) / 2 + (2 * corners - 1) * half
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return TriangleMesh(vertices.astype(np.float32), np.array(faces, np.int32))


def parts_volume(collider: Collider) -> float:
    """Cubic metres of all parts together; where two overlap, that counts twice."""
    return sum(hull_volume(hull) for hull in collider.parts)
