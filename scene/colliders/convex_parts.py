"""A mesh cut into few convex pieces: what an engine can move (CoACD, in a process of its own)."""

import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.whole_file import temporary_folder
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.program import package_words
from shapeshift.scene.colliders.coacd_run import ABSENT
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh, sample_faces, separate

MOST_VERTICES = 64  # of a hull; at 32 a torus loses a tenth of its volume
LIMIT_S = 90.0  # for CoACD; 3 to 20 s is usual on two cores
# Halved from CoACD's own: half the time, the same number of pieces on a torus and a bunny.
SEARCH = {"mcts_iterations": 60, "mcts_nodes": 10, "resolution": 1000}
CONCAVITY = 0.05  # CoACD's threshold: how far a piece may be from convex, as a part of the object
LEAST_THICKNESS = 0.01  # of the object's longest side, which a hull keeps
LEAST_VOLUME = 1e-4  # of all hulls; a smaller one is a splinter
SLACK = 0.025  # of the object's longest side that a hull may stand out of it
JOIN = 1.08  # times the volume of two pieces that their common hull may have
SPIKES = 3.0  # times SLACK that it may stand out in a few places: stray splats leave spikes
SKIN_SAMPLES, HULL_SAMPLES = 20_000, 600
Progress = Callable[[str, float], None]


def cut_into_parts(
    mesh: TriangleMesh, most: int, progress: Progress, limit_s: float = LIMIT_S
) -> tuple[tuple[np.ndarray, ...], bool]:
    """At most `most` hulls (V, 3) float32 that cover a closed mesh; whether CoACD did its part.

    Where it gave nothing in the time, each separate part is one hull.
    """
    parts = separate(mesh)
    skin = Skin(mesh)
    whole = [part.vertices for part in parts]
    if len(parts) <= most and all(skin.reach(points) <= skin.slack for points in whole):
        return solid_parts(whole, mesh, most), True
    pieces = run_coacd(mesh, most, progress, limit_s)
    hulls = solid_parts(joined(pieces, skin), mesh, most)
    return (hulls, True) if hulls else (solid_parts(whole, mesh, most), False)


class Skin:
    """How far hulls stand out of a closed mesh, by samples of both surfaces."""

    def __init__(self, mesh: TriangleMesh) -> None:
        from scipy.spatial import cKDTree

        self.slack = SLACK * float(np.ptp(mesh.vertices, axis=0).max())
        at, face = sample_faces(mesh.vertices[mesh.faces].astype(np.float64), SKIN_SAMPLES)
        self._normals, self._at = face_normals(mesh)[face], at
        self._tree = cKDTree(at)

    def reach(self, points: np.ndarray) -> float:
        """Metres that nearly all of the hull of points (V, 3) stands out less than.

        Nowhere does it stand out more than SPIKES times that.  Inf of a flat one.
        """
        corners = hull_triangles(points)
        if corners is None:
            return np.inf
        samples, _ = sample_faces(corners, HULL_SAMPLES)
        away, nearest = self._tree.query(samples)
        outside = np.einsum("ni,ni->n", samples - self._at[nearest], self._normals[nearest]) > 0
        away = np.where(outside, away, 0)
        return float(max(np.percentile(away, 90), away.max() / SPIKES))


def joined(pieces: list[np.ndarray], skin: Skin) -> list[np.ndarray]:
    """The pieces, two made one wherever their common hull adds too little to matter.

    What is noisy comes in more pieces than its shape needs.
    """
    parts = dict(enumerate(pieces))
    volumes = {name: hull_volume(piece) for name, piece in parts.items()}

    def cost(i: int, j: int) -> float:
        """Metres that the common hull stands out; Inf where it is much larger than both."""
        both = np.concatenate([parts[i], parts[j]])
        if not hull_volume(both) <= JOIN * (volumes[i] + volumes[j]):
            return np.inf
        return skin.reach(both)

    costs = {(i, j): cost(i, j) for i in parts for j in range(i)}
    while costs:
        (i, j), least = min(costs.items(), key=lambda pair: (pair[1], pair[0]))
        if not least <= skin.slack:
            break
        parts[j] = np.concatenate([parts.pop(i), parts[j]])
        volumes[j] = hull_volume(parts[j])
        costs = {pair: far for pair, far in costs.items() if i not in pair}
        costs |= {(a, b): cost(a, b) for a, b in costs if j in (a, b)}
    return list(parts.values())


def face_normals(mesh: TriangleMesh) -> np.ndarray:
    """(F, 3) unit, outward; zero of a face without area."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]].astype(np.float64) for i in range(3))
    across = np.cross(b - a, c - a)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    return np.divide(across, length, out=np.zeros_like(across), where=length > 0)


def hull_triangles(points: np.ndarray) -> np.ndarray | None:
    """(F, 3, 3) the faces of the hull of points (V, 3); None where they lie in a plane."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return points[ConvexHull(points.astype(np.float64)).simplices].astype(np.float64)
    except (QhullError, ValueError):  # flat, or fewer than four
        return None


def hull_volume(points: np.ndarray) -> float:
    """Cubic metres of the hull of points (V, 3); 0 where they lie in a plane."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return float(ConvexHull(points.astype(np.float64)).volume)
    except (QhullError, ValueError):  # flat, or fewer than four
        return 0.0


# The same in a second: hulls of samples of the surface, cut at planes across a piece's own axes; of
# all pieces that one is cut next whose hull a cut takes most off.

SAMPLES = 1500  # of the surface, beside its corners and the middles of its faces
CUTS = 7  # places along each axis
WORTH = 0.01  # of all hulls' volume, that a cut has to take off
OVERLAP = 0.5  # of the way between samples, on either side of a cut: no gap is left
FEWEST = 8  # samples of a piece


@dataclass(frozen=True)
class CutPiece:
    """A piece, and what its best cut makes of it."""

    points: np.ndarray  # (n, 3) metres
    volume: float  # of its hull
    gain: float  # cubic metres less that both hulls of its halves have; 0: no cut helps
    halves: tuple[np.ndarray, np.ndarray] | tuple[()]


def cut_quickly(mesh: TriangleMesh, most: int) -> tuple[np.ndarray, ...]:
    """At most `most` hulls (V, 3) float32 that cover a closed mesh."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    points = np.concatenate([sample_faces(corners, SAMPLES)[0], mesh.vertices])
    a, b, c = np.moveaxis(corners, 1, 0)
    area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2
    overlap = OVERLAP * float(np.sqrt(area / len(points)))
    pieces = [best_cut(points, overlap)]
    while len(pieces) < most:
        at = max(range(len(pieces)), key=lambda k: pieces[k].gain)
        if not pieces[at].gain > WORTH * sum(piece.volume for piece in pieces):
            break
        pieces[at : at + 1] = [best_cut(half, overlap) for half in pieces[at].halves]
    return solid_parts(joined([piece.points for piece in pieces], Skin(mesh)), mesh, most)


def best_cut(points: np.ndarray, overlap: float) -> CutPiece:
    """The piece of points (n, 3), and the cut across one of its axes that takes most off its hull.

    overlap: metres that both halves reach over the cut.
    """
    whole, away = hull_volume(points), points - points.mean(0)
    best = CutPiece(points, whole, 0.0, ())
    for axis in np.linalg.svd(away.T @ away)[2]:
        along = away @ axis
        low, high = float(along.min()), float(along.max())
        for place in np.linspace(low, high, CUTS + 2)[1:-1]:
            halves = points[along < place + overlap], points[along > place - overlap]
            if min(map(len, halves)) < FEWEST:
                continue
            gain = whole - sum(map(hull_volume, halves))
            if gain > best.gain:
                best = CutPiece(points, whole, gain, halves)
    return best


def run_coacd(
    mesh: TriangleMesh, most: int, progress: Progress, limit_s: float
) -> list[np.ndarray]:
    """The vertices of CoACD's pieces; none where it fails or takes longer.

    Raises BadFile where it is not installed.
    """
    with temporary_folder() as folder:
        given, wanted = Path(folder, "mesh.npz"), Path(folder, "hulls.npz")
        centre = mesh.vertices.mean(0, dtype=np.float64)
        size = float(np.ptp(mesh.vertices, axis=0).max()) or 1.0
        save: Callable[..., None] = np.savez  # numpy takes its keywords for one flag
        save(
            given, vertices=(mesh.vertices - centre) / size, faces=mesh.faces, **SEARCH,
            threshold=CONCAVITY, max_convex_hull=most, max_ch_vertex=MOST_VERTICES,
        )  # fmt: skip
        script = str(Path(__file__).with_name("coacd_run.py"))
        # -P: this folder's modules are not to stand in for those of packages.
        command = [sys.executable, "-P", script, str(given), str(wanted)]
        quiet, said = subprocess.DEVNULL, Path(folder, "said")
        with said.open("wb") as errors:
            pipe = subprocess.PIPE
            child = subprocess.Popen(command, stdin=pipe, stdout=quiet, stderr=errors)
        try:
            begun = time.monotonic()
            while child.poll() is None and time.monotonic() - begun < limit_s:
                passed = (time.monotonic() - begun) / limit_s
                progress("cutting it into convex pieces", passed)
                time.sleep(0.05)
        finally:  # also when progress() or Ctrl-C ends the wait
            child.kill()
            child.wait()
            assert child.stdin is not None, "a pipe"
            child.stdin.close()
        if child.returncode == ABSENT:
            why = said.read_text(errors="replace")
            raise BadFile(
                f"its collider cannot be cut into convex pieces: the package coacd does not load "
                f"({why}); {package_words('coacd')} installs it."
            )
        if child.returncode != 0 or not wanted.is_file():
            progress("CoACD found no pieces: each separate part becomes one", 1.0)
            return []
        with np.load(wanted) as file:
            return [file[name] * size + centre for name in file.files]


def solid_parts(pieces: list[np.ndarray], mesh: TriangleMesh, most: int) -> tuple[np.ndarray, ...]:
    """Hulls (V, 3) float32, the largest `most`, none too flat for an engine, no splinters."""
    least = LEAST_THICKNESS * float(np.ptp(mesh.vertices, axis=0).max())
    hulls = [thick(np.asarray(piece, np.float64), least) for piece in pieces]
    sizes = np.array([hull_volume(hull) for hull in hulls])
    kept = np.flatnonzero(sizes > LEAST_VOLUME * sizes.sum())
    kept = np.sort(kept[np.argsort(-sizes[kept], kind="stable")][:most])
    return tuple(in_float32(corners(hulls[i])) for i in kept)


def in_float32(points: np.ndarray) -> np.ndarray:
    """The corners (V, 3) as float32, without those that rounding has drawn into the hull."""
    from scipy.spatial import ConvexHull

    points = points.astype(np.float32)
    while len(used := ConvexHull(points.astype(np.float64)).vertices) < len(points):
        points = points[np.sort(used)]
    return points


def thick(points: np.ndarray, least: float) -> np.ndarray:
    """The points (V, 3), spread across their thinnest way where they lie closer than `least`."""
    away = points - points.mean(0)
    # Rows: widest way first.  All three of them also where there are fewer points; the whole left
    # matrix, which nobody uses, would be (V, V): 6 GB of 27,000 corners.
    across = np.linalg.svd(away, full_matrices=len(away) < 3)[2]
    extents = np.ptp(away @ across.T, axis=0)
    for way, extent in zip(across, extents, strict=True):
        if not extent >= least:
            points = np.concatenate([points - way * least / 2, points + way * least / 2])
    return points


def corners(points: np.ndarray) -> np.ndarray:
    """(V, 3) corners of the hull of the points, MOST_VERTICES of the same volume if more."""
    from scipy.spatial import ConvexHull

    whole = ConvexHull(points)
    points = points[whole.vertices]
    if len(points) <= MOST_VERTICES:
        return points
    chosen = [int(points[:, 0].argmin())]  # then always the one that is farthest from the others
    away = np.full(len(points), np.inf)
    while len(chosen) < MOST_VERTICES:
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(away.argmax()))
    few = points[np.sort(chosen)]
    centre = few.mean(0)
    return centre + (few - centre) * np.cbrt(whole.volume / ConvexHull(few).volume)
