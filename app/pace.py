"""What the commands that write packages do for an even slider, with their progress."""

from dataclasses import replace
from pathlib import Path

from shapeshift.runtime_models.model import AnchorModel
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import write_package

PATIENCE_S = 2.0  # a bar is shown from then on


def pace_package(path: Path) -> None:
    """A package that was just written, with its pace."""
    model = read_package(path)
    if len(model.stops) > 1:
        write_package(with_pace(model), path)


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
