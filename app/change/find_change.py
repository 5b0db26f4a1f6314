"""What changed between two scenes: the work of the command and of ss.change."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.change.draw_pairs import Progress, Visit, draw_side, rings_around
from shapeshift.app.change.register import common_world, register
from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.model import Stop
from shapeshift.scene.change.cells import SurfaceCells, cells_of
from shapeshift.scene.change.places import (
    HEAT_WORDS,
    VALUE_WORDS,
    ChangedPlace,
    ChangeSettings,
    find_places,
)
from shapeshift.scene.change.seen_pair import SeenPair, samples_of
from shapeshift.scene.change.similarity import Registration, Similarity
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
