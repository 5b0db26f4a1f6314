"""Objects out of label maps: whose pixels does each anchor show?  (OWD, section 3.3)

Evidence is summed over the pictures at each one's own x; an anchor goes to the object with the
largest share of its evidence, with all its splats, so that every object keeps the five networks.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.evidence import Evidence
from shapeshift.rasterizer.pack import pack
from shapeshift.rasterizer.project import Camera, Projected
from shapeshift.rasterizer.project_arena import project_arena
from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import (
    AnchorModel,
    BadFile,
    Model,
    ObjectLabel,
    SplatLayers,
    is_antialiased,
)
from shapeshift.runtime_models.program import program
from shapeshift.runtime_models.stop_weights import Controls
from shapeshift.scene.pose import View

LEAST_SHARE = 0.4  # of its evidence, from which an anchor is an object's (tau).  Less forgives
#                    masks that are too small or missing, more those that are too large.
LEAST_PIXELS = 1e-3  # of evidence, below which an anchor counts as unseen
NEIGHBOURS = 8  # that tell an unseen anchor's label
Progress = Callable[[int, int], None]  # views done, views in all


@dataclass(frozen=True)
class LabelledView:
    """What one picture says."""

    view: View
    x: Controls  # of the model as the picture shows it
    labels: np.ndarray  # (H, W) uint8 of view.size; SILENT: nothing is known of the pixel
    photo: Path | None = None  # that it is of


class ViewEvidence:
    """Evidence of a model's rows: its anchors, of plain splats the splats."""

    def __init__(self, device: Device, model: Model, labels: int) -> None:
        """labels: 0 to labels - 1 occur.  Raises BadFile for a kind of model without rows."""
        if not isinstance(model, AnchorModel | SplatLayers):
            raise BadFile(
                "a Scaffold-GS model's splats depend on the eye, so no label stays with them; "
                f"export it as plain splats, or train one with `{program()} train`."
            )
        self._device, self._model = device, model
        self._x: tuple[Controls] | None = None
        self._evaluator, count = Evaluator(model), model.splat_count
        self._antialiased = (True,) if is_antialiased(model) else ()
        each = model.splats_per_anchor if isinstance(model, AnchorModel) else 1
        self._evidence = Evidence(device, count, labels, each)
        # Colours show no evidence, and there is one object, which stands where the world does.
        self._means, self._covariance = device.zeros((count, 4)), device.zeros((count, 8))
        self._color, self._object = device.zeros((count, 4)), device.zeros(count, np.int32)
        self._projected: list[Projected] | None = None

    def add(self, picture: LabelledView) -> None:
        """Pictures of one x in a row are quicker: the networks run once.  Raises ValueError."""
        if self._x is None or picture.x != self._x[0]:
            self._x = (picture.x,)
            splats = self._evaluator.geometry(picture.x)
            pack(self._device, splats, 0, self._means, self._covariance)
        view = picture.view
        camera = Camera(*view.pinhole(), view.size, view.near, view.widest_tangents())
        projected = self._projected = project_arena(
            self._device, self._means, self._covariance, self._color, self._object,
            np.eye(4)[None], [camera], into=self._projected, antialiased=self._antialiased,
        )  # fmt: skip
        tiles = bin_tiles(self._device, projected[0], view.size)
        self._evidence.add(projected[0], tiles, picture.labels)

    def sums(self) -> np.ndarray:
        """(rows, labels) float64 pixels."""
        return self._evidence.sums()


def gather_evidence(
    device: Device,
    model: Model,
    pictures: Iterable[LabelledView],
    labels: int,
    progress: Progress = lambda done, count: None,
) -> np.ndarray:
    """(rows, labels) pixels of evidence of all pictures, one x after the other.

    Raises BadFile, ValueError.
    """
    pictures = sorted(pictures, key=lambda picture: str(picture.x))
    evidence = ViewEvidence(device, model, labels)
    for done, picture in enumerate(pictures):
        progress(done, len(pictures))
        evidence.add(picture)
    progress(len(pictures), len(pictures))
    return evidence.sums()


def label_rows(
    sums: np.ndarray, least_share: float = LEAST_SHARE, least_pixels: float = LEAST_PIXELS
) -> np.ndarray:
    """(rows,) int32: the object with the largest evidence where its share is above least_share,
    else 0, the background, which also takes what nothing is known of.

    sums: (rows, labels) pixels; what is NaN goes to the background.
    """
    total, best = sums[:, 0].copy(), np.zeros(len(sums), np.int32)
    most = np.zeros(len(sums))
    for label in range(1, sums.shape[1]):  # column by column: numpy's argmax takes four times it
        column = sums[:, label]
        total += column
        better = column > most  # of equal ones the smaller label
        best[better] = label
        np.maximum(most, column, out=most, where=better)
    best[~((most > least_share * total) & (total > least_pixels))] = 0
    return best


def fill_unseen(
    places: np.ndarray, labels: np.ndarray, seen: np.ndarray, neighbours: int = NEIGHBOURS
) -> np.ndarray:
    """(rows,) labels in which rows that no picture shows have the commonest of the nearest seen.

    places (rows, 3) metres, seen (rows,) bool.  Insides and undersides stay with their object, and
    are not left behind as ghosts.  Of equally common labels the smaller one is taken.
    """
    from scipy.spatial import cKDTree

    out, unseen = labels.copy(), ~seen
    if not unseen.any() or not seen.any():
        return out
    near = min(neighbours, int(seen.sum()))
    # Splats lie on surfaces: a tree of middles instead of medians is as quick to ask, and is made
    # in half of the time.
    tree = cKDTree(places[seen], 32, balanced_tree=False, compact_nodes=False)
    _, at = tree.query(places[unseen], near, workers=1)
    votes = np.sort(labels[seen][at.reshape(-1, near)], axis=1)  # (unseen, near)
    # How often each sorted label has stood there so far: the first of the longest runs wins.
    runs = np.ones_like(votes)
    for k in range(1, near):
        runs[:, k] = np.where(votes[:, k] == votes[:, k - 1], runs[:, k - 1] + 1, 1)
    out[unseen] = votes[np.arange(len(votes)), runs.argmax(axis=1)]
    return out


def partition(
    model: AnchorModel | SplatLayers,
    sums: np.ndarray,
    objects: tuple[ObjectLabel, ...],
    numbers: np.ndarray | None = None,
) -> AnchorModel | SplatLayers:
    """The model with a label for every row, by the evidence (rows, columns) of its pictures.

    numbers: (columns,) the label of each, 0 first; by default they are counted.  objects: names of
    the labels above 0; plain splats have a place for the labels alone.
    """
    places = model.anchors if isinstance(model, AnchorModel) else model.means
    labels = fill_unseen(places, label_rows(sums), sums.sum(axis=1) > LEAST_PIXELS)
    if numbers is not None:
        labels = numbers.astype(np.int32)[labels]
    if isinstance(model, AnchorModel):
        return replace(model, labels=labels.astype(np.uint8), objects=objects)
    return replace(model, labels=labels)
