"""Where the later scene's world lies in the earlier one's: the same, near it, or looked for."""

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.change.draw_pairs import Progress, Visit, draw_side, rings_around
from shapeshift.renderer.colors.palette import LUMINANCE
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.colmap.colmap_child import run_child
from shapeshift.scene.change.seen_pair import SeenSide, edge_pixels
from shapeshift.scene.change.similarity import Registration, Similarity, fit_surfaces
from shapeshift.scene.inspection.value_picture import world_points
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from shapeshift.renderer.renderer import Renderer

SCRIPT = Path(__file__).with_name("match_run.py")
FAILURE = "matching the two scenes ended with code {code}, perhaps for want of memory."
FEWEST = 100  # pixels that a surface must have, over all views
POINTS = 20_000  # of each surface, at most
SHARED = 0.5  # of each surface that must lie on the other's
OVERLAP = 0.6  # of the surfaces that lie together already: then nothing is looked for
RESIDUAL = 0.012  # of the radius, that is allowed between them
BETTER = 0.7  # times the distance of before: only so much is worth moving a world for
ERROR = 0.03  # of the radius, of a match
INLIERS = 20  # matches that agree


def common_world(before: Visit, after: Visit) -> Similarity:
    """A's metres from B's where both files mean one world: each counts from a zero of its own."""
    origins = [np.asarray(each.document.origin) for each in (before, after)]
    return Similarity(np.eye(3), origins[1] - origins[0])


def register(
    renderer: "Renderer",
    visits: tuple[Visit, Visit],
    names: tuple[str, str],
    views: list[View],
    sides: tuple[list[SeenSide], list[SeenSide]],
    progress: Progress,
) -> Registration:
    """A's world from B's.  Raises BadFile, one sentence, where the scenes do not fit together.

    Worlds that lie together already stay as they are unless closest points move them farther than
    they are apart; else features of drawn pictures are matched, and closest points make it exact.
    views: of A's own metres; sides: what both show in them, taken to be in one world.
    """
    radius = visits[0].document.bounds()[1]
    a = surface_of(views, sides[0])
    refuse_empty(a, names[0])
    progress("laying both worlds together", 0.0)
    found = _in_common(a, views, sides[1], common_world(*visits), radius)
    if found is not None:
        return found
    around = rings_around(*visits[1].document.bounds(), views[0].size)
    seen = draw_side(renderer, visits[1], around, Similarity.identity(), False, "B", progress)
    b = surface_of(around, seen)
    refuse_empty(b, names[1])
    progress("matching features", 0.0)
    start = _by_features(views, sides[0], around, seen, radius, names)
    fitted, residual, shared = fit_surfaces(a, b, start, radius, scaled=True)
    if moved_by(fitted, start, b) > ERROR * radius:  # it slid: features know better
        fitted, residual, shared = fit_surfaces(a, b, start, radius, scaled=True, rounds=0)
    if not (shared >= SHARED and residual <= RESIDUAL * radius):
        raise BadFile(
            f"{names[1]} does not fit {names[0]}: {100 * shared:.0f} % of their surfaces lie "
            f"together, {100 * residual:.1f} cm apart; {100 * SHARED:.0f} % and "
            f"{100 * RESIDUAL * radius:.1f} cm are wanted; pose both captures together."
        )
    return Registration(fitted, "features", residual, shared)


def _in_common(
    a: np.ndarray, views: list[View], sides_b: list[SeenSide], common: Similarity, radius: float
) -> Registration | None:
    """Where both lie together already; None: they do not."""
    b = surface_of([common.view_in_b(view) for view in views], sides_b)
    if len(b) < FEWEST:
        return None
    plain = fit_surfaces(a, b, common, radius, scaled=False, rounds=0)
    fitted, residual, shared = fit_surfaces(a, b, common, radius, scaled=False)
    if not (min(plain[2], shared) >= OVERLAP and residual <= RESIDUAL * radius):
        return None
    # along flat walls closest points slide freely: then nothing lies nearer than before
    farther = moved_by(fitted, common, b) > max(plain[1], residual)
    if farther and residual <= BETTER * plain[1]:
        return Registration(fitted, "icp", residual, shared)
    return Registration(common, "common", *plain[1:])


def moved_by(found: Similarity, start: Similarity, points: np.ndarray) -> float:
    """Metres, median over points (n, 3)."""
    return float(np.median(np.linalg.norm(found.apply(points) - start.apply(points), axis=1)))


def refuse_empty(points: np.ndarray, name: str) -> None:
    """Raises BadFile."""
    if len(points) < FEWEST:
        raise BadFile(f"{name} shows next to nothing from around it; nothing can be compared.")


def surface_of(views: list[View], sides: list[SeenSide]) -> np.ndarray:
    """(n, 3) metres: what the views see, evenly thinned."""
    parts = []
    for view, side in zip(views, sides, strict=True):
        parts.append(_places(view, side)[~edge_pixels(side.depth_m)])
    points = np.concatenate(parts)
    rows = np.random.default_rng(0).permutation(len(points))[:POINTS]
    return points[np.sort(rows)]


def _places(view: View, side: SeenSide) -> np.ndarray:
    """(H, W, 3) metres, NaN where nothing is."""
    height, width = side.depth_m.shape
    rows, columns = np.mgrid[:height, :width] + 0.5
    return world_points(view, np.stack([columns, rows], axis=2), side.depth_m)


def _by_features(
    views_a: list[View], sides_a: list[SeenSide], views_b: list[View], sides_b: list[SeenSide],
    radius: float, names: tuple[str, str],
) -> Similarity:  # fmt: skip
    """Roughly A's world from B's; every second view of A is near enough to one of B.

    Raises BadFile.
    """
    views_a, sides_a = views_a[::2], sides_a[::2]
    arrays: dict[str, np.ndarray] = {"error_m": np.array(ERROR * radius)}
    arrays["counts"] = np.array([len(views_a), len(views_b)])
    for side, views, seen in (("a", views_a, sides_a), ("b", views_b, sides_b)):
        for i, (view, each) in enumerate(zip(views, seen, strict=True)):
            gray = (each.color * each.coverage[..., None]) @ LUMINANCE
            arrays[f"{side}{i}"] = (np.clip(gray, 0, 1) * 255 + 0.5).astype(np.uint8)
            arrays[f"p{side}{i}"] = _places(view, each).astype(np.float32)
    with tempfile.TemporaryDirectory(prefix="shapeshift") as folder:
        given, wanted = Path(folder, "pictures.npz"), Path(folder, "found.npz")
        np.savez(given, **arrays)  # type: ignore[arg-type]  # its stubs take switches alone
        log = Path(folder, "log.txt")
        run_child(SCRIPT, [str(given), str(wanted)], log, lambda *_: None, FAILURE)
        with np.load(wanted) as file:
            matrix, inliers, matches = file["matrix"], int(file["inliers"]), int(file["matches"])
    if not (inliers >= INLIERS and np.isfinite(matrix).all()):
        raise BadFile(
            f"{names[0]} and {names[1]} share too little: {inliers} of {matches} matches agree on "
            f"one place, {INLIERS} are wanted; pose both captures together, in one world."
        )
    scale = float(np.cbrt(np.linalg.det(matrix[:, :3])))
    return Similarity(matrix[:, :3] / scale, matrix[:, 3], scale)
