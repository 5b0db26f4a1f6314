"""What changed between two scenes: the work of the command and of ss.change."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.change.draw_pairs import Progress, Visit, draw_side, rings_around
from shapeshift.app.errors import UsageError
from shapeshift.renderer.colors.palette import LUMINANCE
from shapeshift.runtime_models.files.whole_file import temporary_folder
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.scene.captures.colmap.colmap_child import run_child
from shapeshift.scene.change.places import (
    HEAT_WORDS,
    VALUE_WORDS,
    ChangedPlace,
    ChangeSettings,
    SurfaceCells,
    cells_of,
    find_places,
)
from shapeshift.scene.change.seen_pair import SeenPair, SeenSide, edge_pixels, samples_of
from shapeshift.scene.change.similarity import Registration, Similarity, fit_surfaces
from shapeshift.scene.inspection.value_picture import world_points
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


@dataclass(frozen=True, eq=False)
class FoundChange:
    """The same with what pictures and layers are made of."""

    change: SceneChange
    before: Visit
    after: Visit
    cells: tuple[SurfaceCells, SurfaceCells]  # of before and after
    pairs: list[SeenPair]


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
    centre, radius = before.document.bounds()
    stop = before.measured.stop if heat and before.measured else None
    settings = choice.settings(radius, stop)
    chosen = views or rings_around(centre, radius, choice.size)
    common = common_world(before, after)
    first = draw_side(renderer, before, chosen, Similarity.identity(), heat, "A", progress)
    second = draw_side(renderer, after, chosen, common, heat, "B", progress)
    registration = register(renderer, visits, names, chosen, (first, second), progress)
    if registration.how != "common":
        found_b = registration.a_from_b
        second = draw_side(renderer, after, chosen, found_b, heat, "B", progress)
    pairs = [SeenPair(*three) for three in zip(chosen, first, second, strict=True)]
    progress("comparing", 0.0)
    samples = [samples_of(pairs, later, settings.least_m) for later in (False, True)]
    cells = (
        cells_of(samples[0], samples[1], settings.cell_m),
        cells_of(samples[1], samples[0], settings.cell_m),
    )
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
    found = SceneChange(tuple(places), registration, settings, unit, compared, overall)
    return FoundChange(found, before, after, cells, pairs)


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
