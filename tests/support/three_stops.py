"""Three stops on one slider, thermal in the middle, as models and files for tests of ways."""

from dataclasses import replace
from pathlib import Path

from shapeshift.runtime_models.model import AnchorModel, Stop
from shapeshift.runtime_models.package.refit_encoding import encoding_for
from shapeshift.runtime_models.package.write_package import write_package
from tests.support.models import make_random_model

THREE = (
    Stop("RGB", 0.0),
    Stop("Thermal", 0.5, "thermal", "ironbow", (15.0, 95.0), "°C"),
    Stop("Opened", 1.0),
)


def three_stop_model(anchors: int = 60, seed: int = 0) -> AnchorModel:
    """A small random model of RGB, Thermal and Opened."""
    encoding = encoding_for([stop.x for stop in THREE])
    return replace(make_random_model(anchors, k=3, seed=seed, encoding=encoding), stops=THREE)


def three_stop_package(path: Path, anchors: int = 60, seed: int = 0) -> Path:
    """The same as a file."""
    write_package(three_stop_model(anchors, seed), path)
    return path


def four_stop_package(path: Path) -> Path:
    """The same with a stop Melt at 0.3, as the command `style` would have written it."""
    heat = Stop("Thermal", 0.6, "thermal")
    stops = (Stop("RGB", 0.0), Stop("Melt", 0.3, "style"), heat, Stop("Opened", 1.0))
    encoding = encoding_for([stop.x for stop in stops])
    path.parent.mkdir(exist_ok=True)
    write_package(replace(make_random_model(60, k=3, encoding=encoding), stops=stops), path)
    return path
