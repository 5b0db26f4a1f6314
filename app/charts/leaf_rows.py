"""Rows of a chart for budgets of splats: scenes in levels of detail, drawn leaf by leaf."""

from dataclasses import fields
from pathlib import Path

from shapeshift.app.charts.chart_settings import Named
from shapeshift.app.charts.comparison import exact
from shapeshift.app.document import Document, open_document
from shapeshift.app.opening import MOST_BUDGET, DrawingOptions, ReadingOptions
from shapeshift.renderer.limits import arena_rows
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.scene.scene import Scene

PARTS = (2, 4, 8)  # of all splats
MILLIONS = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25)  # splats, where the scene has more


def has_levels(subject: Document) -> bool:
    """Whether a folder of leaves is among its models, whichever level of it was read."""
    return any("leaves" in model.provenance for model in subject.models)


def by_leaves(path: Path, options: ReadingOptions) -> Document:
    """The scene opened anew so that every leaf has all its levels, and all splats may be drawn.

    Raises BadFile, UsageError.
    """
    shared = {each.name: getattr(options, each.name) for each in fields(ReadingOptions)}
    return open_document(path, DrawingOptions(**shared, budget=str(MOST_BUDGET)))


def budgets_of(scene: Scene, drawing: str, quick: bool = False) -> tuple[Named, ...]:
    """The rows of a scene's chart, all splats first; quick: only all and parts.  None without
    leaves.

    Their target is that of the exact setting: a row says what its budget costs and nothing else.
    All comes first since both renderers have read the same leaves in the same order then.
    """
    models = [obj.model for obj in scene.objects]
    leaves = [m.leaves for m in models if isinstance(m, SplatLayers) and m.leaves is not None]
    if not leaves:
        return ()
    fixed = sum(map(arena_rows, models))  # of objects without levels, which are drawn in full
    whole = fixed + sum(int(source.levels.finest_counts.sum()) for source in leaves)
    budgets = {"budget all": whole} | {f"budget 1/{part}": whole // part for part in PARTS}
    if not quick:
        budgets |= {f"budget {m:g}M": int(m * 1e6) for m in MILLIONS if m * 1e6 < whole}
    target = exact(RenderSettings(), drawing).target
    return tuple(
        Named(name, {"budget": budget, "target": target})
        for name, budget in budgets.items()
        if budget > fixed
    )
