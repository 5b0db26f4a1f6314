"""What `style` says at the end: where the stops are, what moved, and a sheet of pictures."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.runtime_models.model import AnchorModel

if TYPE_CHECKING:
    from shapeshift.training.styles.add_style import NewStyle

SHEET_VIEWS, SHEET_SIZE = 4, (384, 288)
UNMOVED_DB = 90.0  # below that something is wrong: float rounding alone left 98.6 in the demo


def report(
    model: AnchorModel,
    drift: dict[str, float],
    style: "NewStyle | None",
    inside: np.ndarray | None,
) -> list[str]:
    """Lines: each stop with its x, and how exactly it shows what it showed."""
    lines = []
    for stop in model.stops:
        if stop.name in drift:
            moved = "" if drift[stop.name] >= UNMOVED_DB else ", MOVED: please report this scene"
            what = f"as it was, {drift[stop.name]:.0f} dB in the worst of 8 views{moved}"
        else:
            what = f"new, from {style.source}" if style is not None else "new"
            what = f"new, {stop.formula}" if stop.formula else what
        lines.append(f"x = {stop.x:.3f}  {stop.name}: {what}")
    if inside is not None:
        lines.append(f"It changes {int(inside.sum()):,} of {len(inside):,} anchors.")
    return lines


def write_sheet(
    path: Path, before: AnchorModel, after: AnchorModel, style: "NewStyle", device: str | None
) -> None:
    """A PNG: views of the source stop in the upper row, of the new stop below."""
    from shapeshift.app.drawing import save_png
    from shapeshift.rasterizer.device import open_device
    from shapeshift.scene.cameras.framing import default_background
    from shapeshift.training.evaluation.evaluate import ModelRenderer
    from shapeshift.training.styles.add_style import BEHIND
    from shapeshift.training.styles.style_views import dome_views

    behind, opened = default_background(before, BEHIND), open_device(device)
    views = dome_views(before, SHEET_VIEWS, SHEET_SIZE)
    rows = []
    for model, name in ((before, style.source), (after, style.name)):
        renderer = ModelRenderer(opened, model)
        renderer.set_control(next(stop.x for stop in model.stops if stop.name == name))
        rows.append(np.concatenate([renderer.picture(view, behind) for view in views], axis=1))
    path.parent.mkdir(parents=True, exist_ok=True)
    save_png(np.concatenate(rows), path)
