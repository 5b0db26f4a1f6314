"""Small models and wild new stops that tests of styles share."""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.model import HEADS, AnchorFrames, AnchorModel, ObjectLabel, Stop
from shapeshift.runtime_models.package.refit_encoding import encoding_for
from shapeshift.runtime_models.rotation import normalize
from shapeshift.runtime_models.stops.change_stops import NewUnits, add_units, insert_stop
from tests.support.models import make_random_model

THREE = (
    Stop("RGB", 0.0),
    Stop("Thermal", 0.5, "thermal", "ironbow", (15.0, 95.0), "°C"),
    Stop("Opened", 1.0, "layer"),
)


def framed_model(anchors: int = 120, seed: int = 0, **sizes) -> AnchorModel:
    """As `train` writes it: three stops, anchors with frames and labels, numbers that a file of
    halves holds as they are.
    """
    sizes = {"k": 3, "encoding": encoding_for([0, 0.5, 1])} | sizes
    model = make_random_model(anchors, seed=seed, **sizes)
    rng = np.random.default_rng(seed + 1)
    wxyz = normalize(rng.normal(size=(anchors, 4)).astype(np.float32))
    halves = wxyz.astype(np.float16).astype(np.float32)
    logs = rng.normal(0, 0.5, (anchors, 3)).astype(np.float16).astype(np.float32)
    return replace(
        model,
        stops=THREE,
        features=model.features.astype(np.float16).astype(np.float32),
        frames=AnchorFrames(np.exp(logs), normalize(halves)),
        labels=(np.arange(anchors) % 3 == 0).astype(np.uint8),
        objects=(ObjectLabel(1, "pump"),),
    )


def wild_stop(
    model: AnchorModel, inside: np.ndarray | None = None, seed: int = 5, after: str | None = "RGB"
) -> AnchorModel:
    """The model with a stop `Wild` whose units in all five networks hold large random numbers."""
    rng = np.random.default_rng(seed)
    made, more, count = insert_stop(model, "Wild", "RGB", after), 4, 24
    wide = model.features.shape[1] + more
    units = {}
    for head in HEADS:
        out = rng.normal(size=(made.networks[head].width_out, count))
        units[head] = NewUnits(rng.normal(size=(count, wide)) * 2, rng.normal(size=count), out)
    return add_units(made, "Wild", rng.normal(size=(len(model.anchors), more)), units, inside)
