"""Three modalities of one shape: the demo's closed bench in colours, as depth and as normals.

What a model of all three can share is everything but colours: the case for one model instead of
three, and the one that a capture of several sensors is.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import Stop
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.synthetic import workshop
from shapeshift.training.synthetic.tracer import look

STOPS = (Stop("RGB", 0.0, "rgb"), Stop("Depth", 0.5, "layer"), Stop("Normals", 1.0, "layer"))
NEAR_M, FAR_M = 0.5, 3.0  # metres from the eye that are white and black


def radiance(stop: str) -> workshop.Radiance:
    """What a ray of that stop's camera brings home: colour (n, 3) and solid (n,)."""
    if stop == "RGB":
        return workshop.radiance(stop)
    here, _ = workshop.place(False)

    def shape(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        hits = look(here, o, d)
        if stop == "Normals":
            length = np.linalg.norm(hits.normals, axis=1, keepdims=True)
            color = 0.5 + 0.5 * hits.normals / np.maximum(length, 1e-12)
        else:
            share = (FAR_M - hits.distance) / (FAR_M - NEAR_M)
            color = np.repeat(np.clip(share, 0, 1)[:, None], 3, axis=1)
        color[hits.index < 0] = workshop.GREY
        return color, hits.index

    return shape


def make_one_shape(
    folder: Path,
    size: tuple[int, int] = (384, 288),
    views: int = 72,
    test_views: int = 8,
    processes: int = 2,
    progress: Callable[[int, int], None] = lambda done, count: None,
) -> Capture:
    """Writes the capture as `make_workshop` does: other cameras for each modality, one shape."""
    counts = (views, test_views)
    made = (folder, STOPS, (False,), radiance, size, counts, processes, progress)
    return workshop.photograph_bench(*made)
