"""True label maps of the bundled demo: which of its ten objects each pixel shows."""

import numpy as np

from shapeshift.scene.pose import View
from shapeshift.training.synthetic.tracer import Place, pixel_rays, trace
from shapeshift.training.synthetic.workshop import STOPS, place, things

BACKGROUND = "bench"  # label 0, and what shows nothing at all
OBJECTS = (
    "pipe", "valve", "gauge", "cabinet", "conduit", "mug", "screwdriver", "spanner", "can", "motor",
)  # fmt: skip
LABELS = {BACKGROUND: 0} | {name: label for label, name in enumerate(OBJECTS, 1)}


def is_opened(x: float) -> bool:
    """Whether the workshop is drawn opened at x: whether that stop is the nearest."""
    return min(STOPS, key=lambda stop: abs(stop.x - x)).name == "Opened"


def labels_of_solids(opened: bool) -> np.ndarray:
    """(solids,) uint8 in the order of `place(opened)[0].solids`."""
    return np.array(
        [LABELS[name] for name, solids in things(opened) for _ in solids], dtype=np.uint8
    )


def label_map(view: View, x: float = 0.0, without: tuple[str, ...] = ()) -> np.ndarray:
    """(H, W) uint8: the label of what the ray through each pixel's centre meets first.

    `without` names objects that are taken away.  Objects hide each other as in the photos.
    """
    if unknown := set(without) - set(OBJECTS):
        raise ValueError(f"no objects of the workshop: {', '.join(sorted(unknown))}")
    opened = is_opened(x)
    here, labels = place(opened)[0], labels_of_solids(opened)
    if without:
        keep = ~np.isin(labels, [LABELS[name] for name in without])
        here = Place.of([solid for solid, stays in zip(here.solids, keep, strict=True) if stays])
        labels = labels[keep]
    width, height = view.size
    rows, columns = (g.ravel() + 0.5 for g in np.mgrid[:height, :width])
    directions = pixel_rays(view, columns, rows)
    eyes = np.broadcast_to(view.world_from_eye.position, directions.shape)
    _, index = trace(here, eyes, directions)
    return np.where(index >= 0, labels[index], 0).reshape(height, width).astype(np.uint8)


def labels_of_places(
    points: np.ndarray, x: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (N, 3) metres -> the label of the nearest thing (N,) uint8, metres to it (N,), and
    metres to the next other one (N,): by how much the answer is not in doubt.
    """
    opened = is_opened(x)
    distances = np.full((len(LABELS), len(points)), np.inf)
    solids = place(opened)[0].solids
    for solid, label in zip(solids, labels_of_solids(opened), strict=True):
        distances[label] = np.minimum(distances[label], np.abs(solid.distance(points)))
    nearest, next_one = np.sort(distances, axis=0)[:2]
    return distances.argmin(0).astype(np.uint8), nearest, next_one
