"""What changed between two scenes: the work of the command and of ss.change."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.change.draw_visits import Progress, Visit, own_views, see
from shapeshift.app.errors import UsageError
from shapeshift.renderer.colors.palette import LUMINANCE
from shapeshift.runtime_models.files.whole_file import temporary_folder
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.scene.captures.colmap.colmap_child import run_child
from shapeshift.scene.change.places import (
    HEAT_WORDS,
    LEAST_VIEWS,
    VALUE_WORDS,
    ChangedPlace,
    ChangeSettings,
    SurfaceCells,
    cells_of,
    find_places,
    own_surface,
)
from shapeshift.scene.change.seen import SURFACE, SeenVisit, evidence_at, surface_cells
from shapeshift.scene.change.similarity import Registration, Similarity, fit_surfaces
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from shapeshift.renderer.renderer import Renderer

CELLS = 64  # of the scene's radius, where no size is asked for
LEAST_DEGREES, LEAST_PART = 5.0, 0.05  # of heat; of other values' range
APART = 2.0  # cells that a surface must be off, where no metres are asked for


@dataclass(frozen=True)
class ChangeChoice:
    """What a person says; zeros: by the scene."""

    cell_m: float = 0.0
    least_m: float = 0.0
    least_value: float | None = None  # None: by the values
    least_color: float = 14.0
    size: tuple[int, int] = (320, 240)

    def settings(self, radius: float, stop: Stop | None = None) -> ChangeSettings:
        """Raises UsageError for what is no amount.  stop: of the values."""
        least_value = usual_least(stop) if self.least_value is None else self.least_value
        for name, value in (("cell", self.cell_m), ("least shift", self.least_m)):
            if not 0 <= value < np.inf:
                raise UsageError(f"the {name} is {value:g} m; 0 (by the scene) or more is wanted.")
        for name, value in (("value", least_value), ("colour", self.least_color)):
            if not 0 < value < np.inf:
                raise UsageError(
                    f"the least {name} that counts is {value:g}; more than 0 is wanted."
                )
        cell = self.cell_m or radius / CELLS
        return ChangeSettings(cell, self.least_m or APART * cell, least_value, self.least_color)


def usual_least(stop: Stop | None) -> float:
    """From how much on values count as changed, in their unit."""
    if stop is None or stop.kind != "values" or stop.value_range is None:
        return LEAST_DEGREES
    return LEAST_PART * (stop.value_range[1] - stop.value_range[0])


@dataclass(frozen=True, eq=False)
class SceneChange:
    """What two visits differ in; places are in metres of the earlier scene as it is opened."""

    places: tuple[ChangedPlace, ...]
    registration: Registration
    settings: ChangeSettings
    unit: str  # of values; "" without
    compared: tuple[str, ...]  # of "shape", "colour", "heat" or "values"
    overall: float  # the median of all values less those before: the air, the load; NaN: no values
    judged: tuple[float, float]  # part of the surface of before and after that the other can judge


@dataclass(frozen=True, eq=False)
class FoundChange:
    """The same with what pictures and layers are made of."""

    change: SceneChange
    before: Visit
    after: Visit
    cells: tuple[SurfaceCells, SurfaceCells]  # of before and after
    seen: tuple[SeenVisit, SeenVisit]


def find_change(
    renderer: "Renderer",
    visits: tuple[Visit, Visit],
    names: tuple[str, str],
    choice: ChangeChoice,
    views: list[View] | None,
    progress: Progress,
) -> FoundChange:
    """views: of A's own metres; None: from all around.  Raises BadFile, UsageError."""
    before, after = visits
    heat = check_values(before, after, names)
    stop = before.measured.stop if heat and before.measured else None
    common = common_world(before, after)
    seen_a = see(renderer, before, own_views(before, views, choice.size), Similarity.identity(),
                 heat, "A", progress)  # fmt: skip
    in_b = None if views is None else [common.view_in_b(view) for view in views]
    of_b = own_views(after, in_b, choice.size)
    seen_b = see(renderer, after, of_b, common, heat, "B", progress)
    for name, seen in zip(names, (seen_a, seen_b), strict=True):
        if seen.photographed and len(seen.views) < LEAST_VIEWS:
            raise BadFile(
                f"{name} was photographed from {len(seen.views)} of the {LEAST_VIEWS} places that "
                "are wanted: what one side shows alone is no evidence; take more photos."
            )
    radius = radius_of(before, seen_a)
    settings = choice.settings(radius, stop)
    registration = register((seen_a, seen_b), names, settings, radius, progress)
    found_b = registration.a_from_b
    if registration.how != "common" and views is not None and not seen_b.photographed:
        in_b = [found_b.view_in_b(view) for view in views]
        seen_b = see(renderer, after, (in_b, False), found_b, heat, "B", progress)
    sides = seen_a, replace(seen_b, a_from_own=found_b)
    progress("comparing", 0.0)
    first, second = (own_surface(visit, settings) for visit in sides)
    if views is not None:
        first, second = first.within(views), second.within(views)
    cells = (
        cells_of(first, second, sides[1], settings),
        cells_of(second, first, sides[0], settings),
    )
    judged = judged_part(cells, names, settings)
    unit = stop.unit if stop else ""
    said = VALUE_WORDS if stop and stop.kind == "values" else HEAT_WORDS
    both = (before.photo is not None and after.photo is not None) and "colour"
    counted = settings if both else replace(settings, least_color=np.inf)
    places = find_places(*cells, counted, unit, said)
    values = heat and ("heat" if said == HEAT_WORDS else "values")
    compared = tuple(word for word in ("shape", both, values) if word)
    change = cells[1].value_change
    known = change[np.isfinite(change)]
    overall = -float(np.median(known)) if len(known) else float("nan")
    found = SceneChange(tuple(places), registration, settings, unit, compared, overall, judged)
    return FoundChange(found, before, after, cells, sides)


def judged_part(
    cells: tuple[SurfaceCells, SurfaceCells], names: tuple[str, str], settings: ChangeSettings
) -> tuple[float, float]:
    """Part of each surface that the other visit can judge.  Raises BadFile where that is nothing:
    then nothing is known, which is not that nothing changed.
    """
    told = [np.isfinite(each.through) for each in cells]
    if max(map(np.count_nonzero, told)) < settings.least_cells:
        raise BadFile(
            f"no place was photographed for both {names[0]} and {names[1]} from {LEAST_VIEWS} sides"
            "; nothing can be compared: take more photos of the same places."
        )
    first, second = (float(part.mean()) if len(part) else 0.0 for part in told)
    return first, second


def check_values(before: Visit, after: Visit, names: tuple[str, str]) -> bool:
    """Whether both have values, in one unit.  Raises UsageError."""
    if before.measured is None or after.measured is None:
        return False
    first, second = before.measured.stop.unit, after.measured.stop.unit
    if first != second:
        raise UsageError(
            f"the values of {names[0]} are in '{first}', of {names[1]} in '{second}'; one unit is "
            "wanted: train both captures with the same."
        )
    return True


def without_heat(before: Visit, after: Visit, names: tuple[str, str]) -> str:
    """What is said where values are not compared; "": they are."""
    lacking = [n for n, v in zip(names, (before, after), strict=True) if v.measured is None]
    if not lacking:
        return ""
    verb = "has" if len(lacking) == 1 else "have"
    return f"{' and '.join(lacking)} {verb} no thermal stop: shapes and colours alone are compared."


# Where the later scene's world lies in the earlier one's: the same, near it, or looked for.

SCRIPT = Path(__file__).with_name("match_run.py")
FAILURE = "matching the two scenes ended with code {code}, perhaps for want of memory."
FEWEST = 100  # pixels that a surface must have, over all views; cells that tell of a world
POINTS = 20_000  # of each surface, at most
SHARED = 0.5  # of each surface that must lie on the other's
OVERLAP = 0.6  # of the surfaces that lie together already: then nothing is looked for
RESIDUAL = 0.012  # of the radius, that is allowed between them
BETTER = 0.7  # times the distance of before: only so much is worth moving a world for
ERROR = 0.03  # of the radius, of a match
INLIERS = 20  # matches that agree
MOST_PICTURES = 13, 26  # of A and of B, that features are matched between
REACH = 95  # percentile of what photos show from its middle: the radius of what is compared


def common_world(before: Visit, after: Visit) -> Similarity:
    """A's metres from B's where both files mean one world: each counts from a zero of its own."""
    origins = [np.asarray(each.document.origin) for each in (before, after)]
    return Similarity(np.eye(3), origins[1] - origins[0])


def radius_of(visit: Visit, seen: SeenVisit) -> float:
    """Metres: of the scene, or of what its photos show of it, if that is less."""
    radius = visit.document.bounds()[1]
    points = surface_of(seen) if seen.photographed else np.zeros((0, 3))
    if len(points) < FEWEST:
        return radius
    away = np.linalg.norm(points - np.median(points, axis=0), axis=1)
    return min(radius, float(np.percentile(away, REACH)))


def register(
    seen: tuple[SeenVisit, SeenVisit], names: tuple[str, str], settings: ChangeSettings,
    radius: float, progress: Progress,
) -> Registration:  # fmt: skip
    """A's world from B's.  Raises BadFile, one sentence, where the scenes do not fit together.

    The worlds as they are given are tried first: they stay where what both have photographed lies
    together, unless closest points move them farther than they are apart; else features of drawn
    pictures are matched, and closest points make it exact.
    """
    a, b = surface_of(seen[0]), surface_of(seen[1])
    refuse_empty(a, names[0])
    refuse_empty(b, names[1])
    progress("laying both worlds together", 0.0)
    found = _in_common(a, b, seen, settings, radius)
    if found is not None:
        return found
    progress("matching features", 0.0)
    start = _by_features(seen, radius, names)
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
    a: np.ndarray, b: np.ndarray, seen: tuple[SeenVisit, SeenVisit], settings: ChangeSettings,
    radius: float,
) -> Registration | None:  # fmt: skip
    """Where both lie together already; None: they do not.  a (n, 3), b (m, 3): their surfaces."""
    common = seen[1].a_from_own
    plain = fit_surfaces(a, b, common, radius, scaled=False, rounds=0)
    fitted, residual, shared = fit_surfaces(a, b, common, radius, scaled=False)
    if min(plain[2], shared) >= OVERLAP and residual <= RESIDUAL * radius:
        # along flat walls closest points slide freely: then nothing lies nearer than before
        farther = moved_by(fitted, common, b) > max(plain[1], residual)
        if farther and residual <= BETTER * plain[1]:
            return Registration(fitted, "icp", residual, shared)
        return Registration(common, "common", plain[1], plain[2])
    first, second = seen
    agreed = min(agreement(first, second, settings), agreement(second, first, settings))
    return Registration(common, "common", plain[1], agreed) if agreed >= OVERLAP else None


def agreement(own: SeenVisit, other: SeenVisit, settings: ChangeSettings) -> float:
    """Part of one visit's surface that the other has too, of what both photographed; 0: too little
    of it to tell.
    """
    points, views = surface_cells(own, settings.cell_m)
    points = points[views >= LEAST_VIEWS]
    found = evidence_at(points, other, settings.least_m)
    told = found.same + found.through + found.hidden >= LEAST_VIEWS
    if np.count_nonzero(told) < FEWEST:
        return 0.0
    return float((found.same > found.through + found.hidden)[told].mean())


def moved_by(found: Similarity, start: Similarity, points: np.ndarray) -> float:
    """Metres, median over points (n, 3)."""
    return float(np.median(np.linalg.norm(found.apply(points) - start.apply(points), axis=1)))


def refuse_empty(points: np.ndarray, name: str) -> None:
    """Raises BadFile."""
    if len(points) < FEWEST:
        raise BadFile(f"{name} shows next to nothing from around it; nothing can be compared.")


def surface_of(seen: SeenVisit) -> np.ndarray:
    """(n, 3) metres of its own world: what the views see, evenly thinned."""
    parts = [seen.points(i)[told == SURFACE] for i, told in enumerate(seen.evidence)]
    points = np.concatenate(parts)
    rows = np.random.default_rng(0).permutation(len(points))[:POINTS]
    return points[np.sort(rows)]


def _by_features(
    seen: tuple[SeenVisit, SeenVisit], radius: float, names: tuple[str, str]
) -> Similarity:
    """Roughly A's world from B's, by pictures of both.  Raises BadFile."""
    arrays: dict[str, np.ndarray] = {"error_m": np.array(ERROR * radius)}
    counts = []
    for side, visit, most in zip("ab", seen, MOST_PICTURES, strict=True):
        rows = range(0, len(visit.views), -(-len(visit.views) // most))
        counts.append(len(rows))
        for i, row in enumerate(rows):
            each = visit.sides[row]
            gray = (each.color * each.coverage[..., None]) @ LUMINANCE
            arrays[f"{side}{i}"] = (np.clip(gray, 0, 1) * 255 + 0.5).astype(np.uint8)
            arrays[f"p{side}{i}"] = visit.points(row).astype(np.float32)
    arrays["counts"] = np.array(counts)
    with temporary_folder() as folder:
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
