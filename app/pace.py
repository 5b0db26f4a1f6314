"""What the commands that write packages do for an even slider, with their progress."""

from dataclasses import replace
from pathlib import Path

from shapeshift.runtime_models.model import AnchorModel, Stop
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.stops.formula_stop import with_placed_formulas

PATIENCE_S = 2.0  # a bar is shown from then on


def pace_package(path: Path, formulas: tuple[Stop, ...] = ()) -> None:
    """A package that was just written, with the stops by formula of its capture, and its pace."""
    model = read_package(path)
    if len(model.stops) + len(formulas) > 1:
        write_package(with_pace(with_placed_formulas(model, formulas)), path)


def with_pace(model: AnchorModel) -> AnchorModel:
    """The model with the measured pace of its pairs of stops, a second or two of a core each; with
    that which it has, where it has one.
    """
    return model if model.pace else with_every_pace(model)


def with_every_pace(model: AnchorModel) -> AnchorModel:
    """The model with its pace, and with that of every pair of stops that lacks one."""
    from shapeshift.app.opening import progress_after
    from shapeshift.renderer.pace import measure_pace

    with progress_after(PATIENCE_S) as progress:
        return replace(model, pace=measure_pace(model, progress))
