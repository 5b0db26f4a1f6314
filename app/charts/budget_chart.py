"""The chart behind --target-ms: measured in seconds, then kept for this scene on this machine."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from shapeshift.app.charts.budget import Choice, FrameBudget, choose
from shapeshift.app.charts.chart_rows import write_text
from shapeshift.app.document import Document
from shapeshift.app.terminal import say
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.files.json_fields import saved_object
from shapeshift.runtime_models.files.whole_file import make_folders

if TYPE_CHECKING:
    from shapeshift.app.charts.chart_measure import ChartRow, Pricing

LARGEST_CHART = 1 << 20  # bytes of a stored chart
FORMAT = 3  # of the stored file, and of what the measure means: others are measured again


@dataclass(frozen=True)
class BudgetRow:
    """What choose() needs of a measured setting."""

    name: str
    settings: RenderSettings
    ms: float
    db: float


@dataclass(frozen=True)
class ChartSubject:
    """What is going to be drawn: the chart belongs to exactly this."""

    subject: Document
    x: float | None  # of all objects; None: each at its own
    size: tuple[int, int]
    eyes: int = 1


def settings_for(
    budget: FrameBudget, renderer: Renderer, ctx, drawn: ChartSubject
) -> RenderSettings:
    """The renderer's settings moved within the budget; says in one line on stderr what it chose.

    Rows that keep an order are not taken: views of render and bench lie far apart.
    """
    rows = budget_rows(renderer, ctx, drawn)
    choice = choose(steady(rows), budget.target_ms, budget.floor_db)
    say(choice.sentence)
    return applied(choice, renderer.settings)


def steady(rows: Sequence[BudgetRow]) -> list[BudgetRow]:
    """Rows whose picture does not depend on how far the frame before was away."""
    return [row for row in rows if row.settings.resort_frames == 1]


def applied(choice: Choice, settings: RenderSettings) -> RenderSettings:
    """The chosen setting; background, debug view and ends of the heat's scale of `settings`."""
    return replace(
        choice.settings,
        background=settings.background, debug=settings.debug, heat_ends=settings.heat_ends,
    )  # fmt: skip


def budget_rows(renderer: Renderer, ctx, drawn: ChartSubject) -> list[BudgetRow]:
    """From the user's cache, or measured now and kept there."""
    path = stored_path(renderer, ctx, drawn)
    rows = read_rows(path)
    if rows is None:
        rows = measure(renderer, ctx, drawn)
        store_rows(path, rows)
    return rows


def stored_path(renderer: Renderer, ctx, drawn: ChartSubject) -> Path:
    """Where the chart of this scene, machine, size, back end and background lies."""
    from shapeshift.app.charts.chart_scene import digest
    from shapeshift.app.charts.chart_settings import SETTINGS
    from shapeshift.app.measure import machine_line
    from shapeshift.runtime_models.files.user_cache import OURS, cache_base

    backends = sorted(renderer.backends.items())
    table = [named for named in SETTINGS if named.quick]
    # The scene by its contents, then everything but that: numbers, names and versions.
    key = digest(drawn.subject.at(drawn.x), drawn.size, drawn.eyes, backends,
                 renderer.settings.background, machine_line(ctx), FORMAT, table)  # fmt: skip
    return cache_base() / OURS / "charts" / f"{key}.json"


def measure(renderer: Renderer, ctx, drawn: ChartSubject) -> list[BudgetRow]:
    """Prices the quick settings with progress on stderr; the renderer keeps its settings."""
    from shapeshift.app.charts.chart_measure import Pricing, twin_of
    from shapeshift.app.charts.chart_scene import QUICK, make_chart_scene
    from shapeshift.app.charts.chart_settings import settings_of
    from shapeshift.app.progress import tracked

    kept = renderer.settings
    chart_scene = make_chart_scene([drawn.subject], drawn.x, drawn.size, QUICK)
    try:
        with twin_of(renderer, ctx) as twin:
            pricing = Pricing((renderer, twin), ctx, chart_scene, kept.background)
            table = [replace(named, eyes=drawn.eyes)
                     for named in settings_of(pricing.drawing, quick=True)]  # fmt: skip
            work = tracked(table, "measuring this scene once")
            priced = [(pricing.settings(named), pricing.row(named, False)) for named in work]
    finally:
        renderer.settings = kept
    return budget_rows_of(priced)


def budget_rows_of(priced: Sequence[tuple[RenderSettings, "ChartRow"]]) -> list[BudgetRow]:
    """Rows as a budget takes them: a moment of load slows one row's ms, not its ratio."""
    base = median(row.exact_ms for _, row in priced)
    return [BudgetRow(row.name, settings, row.ratio * base, row.db) for settings, row in priced]


def keep_chart(
    pricing: "Pricing", renderer: Renderer, ctx, drawn: ChartSubject, rows: Sequence
) -> None:
    """Keeps a whole chart's rows of one eye in place of the quick one that would be measured."""
    from shapeshift.app.charts.chart_settings import settings_of

    named = {each.name: each for each in settings_of(pricing.drawing, eyes=1)}
    priced = [(pricing.settings(named[row.name]), row) for row in rows if row.name in named]
    store_rows(stored_path(renderer, ctx, drawn), budget_rows_of(priced))


def store_rows(path: Path, rows: Sequence[BudgetRow]) -> None:
    """Best kept, never needed: a cache that cannot be written is said and done without."""
    rows_json = [
        {"name": row.name, "ms": row.ms, "db": row.db, "settings": _plain(row.settings)}
        for row in rows
        if math.isfinite(row.ms) and math.isfinite(row.db)
    ]
    try:
        make_folders(path.parent.parent, path.parent.name)
        write_text(path, json.dumps({"format": FORMAT, "rows": rows_json}, indent=1) + "\n")
    except OSError as error:
        say(f"The chart is not kept for the next time: {error}.")


def read_rows(path: Path) -> list[BudgetRow] | None:
    """What store_rows wrote; None where there is nothing or nothing that can be used."""
    try:
        found = saved_object(path, LARGEST_CHART)
        if found["format"] != FORMAT:
            return None
        rows = [_row(each) for each in found["rows"]]
    except (ValueError, KeyError, TypeError, AttributeError):
        return None  # never written, half a file, another program's, or one of long ago
    return rows if any(row.name == "exact" for row in rows) else None


def _plain(settings: RenderSettings) -> dict:
    """As JSON can hold it: no limit is null."""
    return {name: None if value == math.inf else value for name, value in asdict(settings).items()}


def _row(each: dict) -> BudgetRow:
    """Raises what read_rows expects for anything that is no row."""
    values: dict[str, Any] = {
        name: math.inf if v is None else v for name, v in each["settings"].items()
    }
    values["background"] = tuple(values["background"])
    values.pop("heat_ends", None)  # JSON makes a list of it; charts measure with the default
    ms, db = float(each["ms"]), float(each["db"])
    if not (0 < ms < math.inf and math.isfinite(db)):
        raise ValueError("no times")
    return BudgetRow(str(each["name"]), RenderSettings(**values), ms, db)
